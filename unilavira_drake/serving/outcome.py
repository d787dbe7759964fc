"""What came of a call, whatever the format in which it is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

from unilavira_drake.errors import (
    ContextLengthError,
    InputError,
    MllmAuthenticationError,
    MllmError,
    MllmQuotaError,
    MllmTimeout,
    MllmUnreachable,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
)
from unilavira_drake.messages import Message
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.serving.question import Question

Kind = Literal[
    "invalid",
    "too_long",
    "unauthorized",
    "forbidden",
    "not_found",
    "too_large",
    "quota",
    "internal",
    "unreachable",
    "timeout",
]
STATUS: dict[Kind, int] = {
    "invalid": 400,
    "too_long": 400,
    "unauthorized": 401,
    "forbidden": 403,
    "not_found": 404,
    "too_large": 413,
    "quota": 429,
    "internal": 500,
    "unreachable": 503,
    "timeout": 504,
}


@dataclass(frozen=True)
class Answer(Message):
    """A reply of the backend."""

    text: str = ""
    usage: Usage = Usage()
    ended: Literal["complete", "truncated", "refused"] = "complete"
    reason: str = ""
    """Of a refusal."""


@dataclass(frozen=True)
class Refusal(Message):
    """Why there is no reply."""

    kind: Kind = "invalid"
    message: str = ""


class Format(Protocol):
    """One provider's JSON, as its server speaks it."""

    def question(self, body: dict[str, Any]) -> Question:
        """Returns what a body asks.

        Raises:
            InputError: if it has another form.
        """

    def answer(self, answer: Answer, model: str, number: int) -> dict[str, Any]:
        """Returns the body that tells an answer."""

    def refusal(self, refusal: Refusal) -> dict[str, Any]:
        """Returns the body that tells why there is none."""


_ANSWERS: tuple[tuple[type[Exception], Literal["complete", "truncated", "refused"]], ...] = (
    (ReplyTruncated, "truncated"),
    (ReplyRefused, "refused"),
    # A reply without any text.
    (ReplyFormatError, "complete"),
)
_REFUSALS: tuple[tuple[type[Exception], Kind], ...] = (
    (ContextLengthError, "too_long"),
    (MllmAuthenticationError, "unauthorized"),
    (MllmQuotaError, "quota"),
    (MllmTimeout, "timeout"),
    (MllmUnreachable, "unreachable"),
    # The request does not suit the backend, or the cassette does not hold it.
    (MllmError, "invalid"),
    (InputError, "invalid"),
)


def outcome_of(error: Exception) -> Answer | Refusal | None:
    """Returns how a backend's error is told to a client; None for a bug."""
    for kind, told in _ANSWERS:
        if isinstance(error, kind):
            return Answer(ended=told, reason=str(error))
    for kind, named in _REFUSALS:
        if isinstance(error, kind):
            return Refusal(named, str(error))
    return None
