"""What comes back from a model: the text, what it cost, and how each attempt went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from unilavira_drake.messages import Message
from unilavira_drake.mllm.request import MllmRequest


@dataclass(frozen=True)
class Usage(Message):
    """What a reply cost; zero for models that count no tokens."""

    input_tokens: int = 0
    """All tokens of the prompt, cached ones included."""
    output_tokens: int = 0
    """All tokens written, reasoning included."""
    images: int = 0
    cost_usd: float | None = None
    """None when the price is not known; never a guess."""
    cached_tokens: int = 0
    """How many of ``input_tokens`` came out of the provider's cache."""
    reasoning_tokens: int = 0
    """How many of ``output_tokens`` were hidden reasoning."""

    def __add__(self, other: Usage) -> Usage:
        known = self.cost_usd is not None and other.cost_usd is not None
        return Usage(
            self.input_tokens + other.input_tokens,
            self.output_tokens + other.output_tokens,
            self.images + other.images,
            (self.cost_usd or 0.0) + (other.cost_usd or 0.0) if known else None,
            self.cached_tokens + other.cached_tokens,
            self.reasoning_tokens + other.reasoning_tokens,
        )


@dataclass(frozen=True)
class Attempt(Message):
    """One request on the wire, whatever came of it: a row of the ledger."""

    model: str = ""
    """The model that was asked, as its provider calls it."""
    status: str = "ok"
    """``ok``, ``replayed`` (by a cassette), ``cancelled`` or the name of the error."""
    http_status: int | None = None
    """None when no answer came, and for models without HTTP."""
    usage: Usage = Usage()
    latency: float = 0.0
    """Wall-clock seconds."""
    detail: str = ""
    """The error in words; holds no key."""

    @property
    def uncounted(self) -> bool:
        """Whether a server answered without counting the tokens."""
        return self.status == "ok" and self.http_status is not None and not self.usage.input_tokens


@dataclass(frozen=True)
class Completion(Message):
    """What a backend returns: the raw text, its whole cost, and the attempts that led there."""

    text: str = ""
    usage: Usage = Usage()
    """Sum over all attempts, failed ones included."""
    latency: float | None = None
    """Wall-clock seconds from the call to the reply; a cassette gives the recorded ones; None
    when the backend does not say."""
    attempts: tuple[Attempt, ...] = ()
    """One row each; empty for a backend that has none to tell apart."""


@dataclass(frozen=True)
class MllmReply(Message):
    """A reply as it becomes visible on a port, or the named error that took its place."""

    n: int = 0
    attempt: int = 0
    text: str = ""
    error: str = ""
    """The name and the words of the model's own error, e.g. ``ReplyRefused: ...``; of any other
    error the name alone, for its words tell of addresses, files and times of the day."""
    usage: Usage = Usage()
    latency: float = 0.0
    """Simulated seconds from request to reply."""
    infrastructure: bool = False
    """Whether the error is the machine's or the service's: the episode ends, never scored."""
    unusable: bool = False
    """Whether the model replied, but with nothing that can be read: worth asking once more, unlike
    a refusal or a reply that was cut off."""


class Mllm(Protocol):
    """A model backend: a deterministic function of one request, safe to call from a thread."""

    @property
    def name(self) -> str:
        """Name for results and the first line of a run."""

    @property
    def perception(self) -> str:
        """``ground_truth`` (gets the simulator's labels as evidence) or ``images``."""

    @property
    def reasoning(self) -> str:
        """``rules`` | ``model`` | ``human``."""

    @property
    def description(self) -> str:
        """One honest sentence about what this model is."""

    @property
    def box_space(self) -> str:
        """How it writes places in a picture, a key of ``boxes.BOX_SPACES``."""

    @property
    def deadline(self) -> float:
        """Wall-clock seconds after which a reply is given up, all attempts together."""

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request.

        Raises:
            MllmError: if no reply can be had; ``attempts`` on it tells what was tried.
            ReplyFormatError: if the model replied, but not with a text: a refusal, or a reply
                that was cut off.
        """

    def close(self) -> None:
        """Gives up calls under way and frees connections; the model is not asked again."""
