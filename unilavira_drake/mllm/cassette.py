"""Cassettes: files that keep the replies of an episode, so that it runs again without a model.

A cassette is JSON lines: a header, then one line for each reply with the request's key, prompt
and pictures (as hashes).  It holds no path, no address and no key of an endpoint.
"""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, Literal

import pydantic

from unilavira_drake.errors import CassetteError, ReplyFormatError, ReplyRefused, ReplyTruncated
from unilavira_drake.mllm.likeness import content_digest, look, prompt_difference, same_look
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import paid

VERSION = 1
_OWN_ERRORS = {kind.__name__: kind for kind in (ReplyRefused, ReplyTruncated, ReplyFormatError)}

Key = tuple[str, int, int, int]
"""Role, number, attempt and seed of a request."""


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"expected text, got {type(value).__name__}")
    return value


# Pydantic's own text refuses half a surrogate pair, which a model may well have written.
Text = Annotated[str, pydantic.PlainValidator(_text)]


class _Record(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="ignore", frozen=True)


class RecordedModel(_Record):
    """What a recorded model declared about itself, as in ``mllm.reply.Mllm``."""

    name: str
    perception: Literal["ground_truth", "images"]
    reasoning: Literal["rules", "model", "human"]
    box_space: str


class CassetteHeader(_Record):
    """The first line: who answered, when, and to what."""

    cassette: Literal[1] = 1
    answered_by: str = ""
    date: str = ""
    preset: str = ""
    scenario: str = ""
    task: str = ""
    ablation: str = ""
    seed: int = 0
    language: RecordedModel
    vision: RecordedModel
    judge: RecordedModel | None = None

    def model(self, role: str) -> RecordedModel | None:
        """Returns the model of a role; None where no judge was recorded."""
        return {"vision": self.vision, "judge": self.judge}.get(role, self.language)


class RecordedImage(_Record):
    """A picture of a recorded request; ``look`` as in ``likeness.look``."""

    label: Text
    sha256: str
    look: str


class RecordedReply(_Record):
    """One line: a request and the reply to it, or the model's own error in its place."""

    role: str
    n: int
    attempt: int
    seed: int
    call: str
    digest: str
    prompt: Text
    images: tuple[RecordedImage, ...] = ()
    text: Text = ""
    error: Text = ""
    usage: Usage = Usage()
    latency: float = pydantic.Field(default=0.0, ge=0.0)
    """Wall-clock seconds."""

    @property
    def key(self) -> Key:
        """Role, number, attempt and seed."""
        return self.role, self.n, self.attempt, self.seed

    def check(self, prompt: Prompt, place: str) -> None:
        """Checks that a prompt is the recorded one, but for another machine's rounding.

        Raises:
            CassetteError: says what differs.
        """
        if content_digest(prompt) == self.digest:
            return
        told = f"{place}: the prompt of {named(self.key)} ({self.call}) is not the recorded one: "
        difference = prompt_difference(self.prompt, prompt.text)
        if not difference and len(prompt.images) != len(self.images):
            difference = f"it had {len(self.images)} pictures and now has {len(prompt.images)}"
        if difference:
            raise CassetteError(f"{told}{difference}.")
        for number, (image, recorded) in enumerate(
            zip(prompt.images, self.images, strict=True), start=1
        ):
            if hashlib.sha256(image.jpeg).hexdigest() == recorded.sha256:
                continue
            if not same_look(recorded.look, look(image.jpeg)):
                raise CassetteError(
                    f"{told}picture {number} ({image.label!r}) shows something else."
                )

    def own_error(self) -> ReplyFormatError:
        """Returns the error of the model that stands in the place of a reply."""
        name, _, words = self.error.partition(": ")
        return _OWN_ERRORS.get(name, ReplyFormatError)(words)


def key_of(request: MllmRequest) -> Key:
    """Returns the key under which a cassette keeps the reply to a request."""
    return request.role, request.n, request.attempt, request.seed


def named(key: Key) -> str:
    """Returns a key in words."""
    role, n, attempt, seed = key
    return f"{role} call {n}, attempt {attempt}, seed {seed}"


def recorded_reply(
    request: MllmRequest, prompt: Prompt, outcome: Completion | ReplyFormatError, latency: float
) -> RecordedReply:
    """Returns the line of a cassette for a request and what came of it."""
    failed = isinstance(outcome, ReplyFormatError)
    return RecordedReply(
        role=request.role,
        n=request.n,
        attempt=request.attempt,
        seed=request.seed,
        call=request.call,
        digest=content_digest(prompt),
        prompt=prompt.text,
        images=tuple(
            RecordedImage(
                label=image.label,
                sha256=hashlib.sha256(image.jpeg).hexdigest(),
                look=look(image.jpeg),
            )
            for image in prompt.images
        ),
        text="" if isinstance(outcome, ReplyFormatError) else outcome.text,
        error=f"{type(outcome).__name__}: {outcome}" if failed else "",
        usage=paid(outcome.attempts) if isinstance(outcome, ReplyFormatError) else outcome.usage,
        latency=latency,
    )
