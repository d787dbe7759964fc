"""What the two wire dialects have in common: one protocol between a request and its bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from unilavira_drake.errors import MllmUnreachable, UniLaviraError
from unilavira_drake.messages import Message
from unilavira_drake.mllm.profile import Profile, StructuredMode
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import MllmRequest


@dataclass(frozen=True)
class WireReply(Message):
    """A text that a server has generated."""

    text: str = ""
    usage: Usage = Usage()
    """As counted by the server; without a price."""
    model: str = ""
    """The model's name as the server tells it; empty when it does not."""


@dataclass(frozen=True)
class WireFailure(Message):
    """Why an answer holds no text."""

    error: type[UniLaviraError] = MllmUnreachable
    """A subclass of ``MllmError`` or of ``ReplyFormatError``."""
    message: str = ""
    retryable: bool = False
    """Whether the same request may succeed later."""
    retry_after: float | None = None
    """Seconds that the server asks to wait, from a header or the body."""
    step_down: bool = False
    """Whether the server does not know this way of asking for JSON."""
    usage: Usage = Usage()
    """What the failed attempt cost all the same."""


class WireDialect(Protocol):
    """Pure functions between our requests and one provider's JSON; no HTTP here."""

    def url(self, profile: Profile) -> str:
        """Returns the address to which a request is posted."""

    def headers(self, key: str | None) -> dict[str, str]:
        """Returns the headers that carry the key; the only place where it stands."""

    def body(
        self,
        prompt: Prompt,
        request: MllmRequest,
        profile: Profile,
        *,
        structured: StructuredMode,
        temperature: float,
        max_output_tokens: int,
    ) -> bytes:
        """Returns the JSON body of a request."""

    def read(
        self, status: int, headers: Mapping[str, str], data: Any, body: bytes
    ) -> WireReply | WireFailure:
        """Returns what an answer means; never raises.

        Args:
            headers: names in lower case.
            data: the parsed JSON body, or None when the body is no JSON.
            body: the body itself, for messages.
        """
