"""What every provider's refusal has in common: status codes, times to wait, words."""

from __future__ import annotations

import datetime
import email.utils
import json
import math
import re
from collections.abc import Mapping
from typing import Any

from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmQuotaError,
    MllmRequestError,
    MllmUnreachable,
    ReplyRefused,
    UniLaviraError,
)
from unilavira_drake.mllm.wire import WireFailure

MESSAGE_LIMIT = 300
"""Characters of a server's own words that a message shows."""
_MOST_TOKENS = 10**9
"""A larger count is no count."""

_RETRYABLE = frozenset({408, 409, 425})
"""Besides 429 and all of 500 and above."""

_TOO_LONG = re.compile(
    r"exceed_?context_?size|context_?length|maximum context|context (length|window|size)"
    r"|(input|prompt|number of) tokens?.{0,40}exceed|input token count|(prompt|input) is too long"
    r"|too many (input )?tokens|range of input length",
    re.IGNORECASE,
)
_FILTERED = re.compile(
    r"data_?inspection_?failed|inappropriate content|content_policy_violation|content_filter"
    r"|content management policy|requires moderation|flagged_input",
    re.IGNORECASE,
)
_UNPAID = re.compile(
    r"insufficient_(quota|balance|credits?)|insufficient (balance|credits?)|arrearage"
    r"|billing_(hard_limit_reached|not_active)|credits are depleted|credit balance is too low",
    re.IGNORECASE,
)
_BAD_KEY = re.compile(r"api_?key_?invalid|invalid_?api_?key|api key not valid", re.IGNORECASE)
_SAID: tuple[tuple[type[UniLaviraError], re.Pattern[str]], ...] = (
    (ReplyRefused, _FILTERED),
    (MllmQuotaError, _UNPAID),
    (MllmAuthenticationError, _BAD_KEY),
    (ContextLengthError, _TOO_LONG),
)
"""What the words of an answer below status 500 tell, whatever its status is."""
_NAMED: dict[int, type[UniLaviraError]] = {
    401: MllmAuthenticationError,
    402: MllmQuotaError,
    403: MllmAuthenticationError,
    429: MllmQuotaError,
}


def failure_of_status(
    status: int, message: str, *, marks: str = "", retry_after: float | None = None
) -> WireFailure:
    """Returns what a refusal means by its status and its words.

    Args:
        message: what the server says to a person.
        marks: its machine-readable codes and types, joined; searched beside the message.
        retry_after: seconds that the server asks to wait.
    """
    error, retryable = _meaning(status, f"{marks} {message}")
    return WireFailure(
        error=error,
        message=status_words(status, message),
        retryable=retryable,
        retry_after=retry_after if retryable else None,
    )


def status_words(status: int, message: str) -> str:
    """Returns a status and what the server says about it as one sentence."""
    said = message.rstrip(". ")
    return f"HTTP {status}: {said}." if said else f"HTTP {status}."


def _meaning(status: int, said: str) -> tuple[type[UniLaviraError], bool]:
    """The error, and whether the same request may succeed later."""
    if status >= 500:
        return MllmUnreachable, True
    for error, pattern in _SAID:
        if pattern.search(said):
            return error, False
    if status in _NAMED:
        return _NAMED[status], status == 429
    # Below 300 stand errors in an answer that pretends to be one.
    if status in _RETRYABLE or status < 300:
        return MllmUnreachable, True
    # A redirect, too: followed, it would carry the key to another address.
    return MllmRequestError, False


def unusable(message: str) -> WireFailure:
    """Returns the failure of an answer that is none: the same request may be answered next time."""
    return WireFailure(error=MllmUnreachable, message=message, retryable=True)


def header_delay(headers: Mapping[str, str]) -> float | None:
    """Returns the seconds that ``retry-after-ms`` or ``retry-after`` ask to wait, or None.

    ``retry-after`` may be a number or the date of HTTP, which is read by this machine's clock.
    """
    milliseconds = _number(headers.get("retry-after-ms", ""))
    if milliseconds is not None:
        return milliseconds / 1000.0
    text = headers.get("retry-after", "").strip()
    seconds = _number(text)
    if seconds is not None or not text:
        return seconds
    try:
        moment = email.utils.parsedate_to_datetime(text)
    except (TypeError, ValueError, IndexError, OverflowError):
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.timezone.utc)
    now = datetime.datetime.now(datetime.timezone.utc)
    return max((moment - now).total_seconds(), 0.0)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0.0 else None


def told_status(code: Any) -> int | None:
    """Returns the HTTP status that an error object names as its code, or None."""
    known = isinstance(code, int) and not isinstance(code, bool) and 400 <= code < 600
    return code if known else None


def tokens(data: Any, *path: str) -> int:
    """Returns a count of tokens somewhere in a parsed body; 0 for whatever is no such count."""
    for key in path:
        if not isinstance(data, dict):
            return 0
        data = data.get(key)
    if isinstance(data, bool) or not isinstance(data, int):
        return 0
    return data if 0 <= data <= _MOST_TOKENS else 0


def words_of(value: Any) -> str:
    """Returns a server's words on one line, clipped and without control characters."""
    text = value if isinstance(value, str) else ""
    line = "".join(c if c.isprintable() else " " for c in text[: 8 * MESSAGE_LIMIT])
    line = " ".join(line.split())
    return line if len(line) <= MESSAGE_LIMIT else line[: MESSAGE_LIMIT - 1] + "…"


def words_of_body(body: bytes) -> str:
    """Returns what a body without JSON says, its tags left out."""
    text = body[: 16 * MESSAGE_LIMIT].decode("utf-8", "replace")
    text = re.sub(r"(?is)<(script|style)\b.*?</\1\s*>", " ", text)
    return words_of(re.sub(r"<[^<>]*>", " ", text))


def marks_of(*values: Any) -> str:
    """Returns machine-readable codes and types of an error as one text to search."""
    return " ".join(str(value) for value in values if isinstance(value, str | int))[:2000]


def as_json_text(value: Any) -> str:
    """Returns the arguments of a tool call as JSON text: many servers give text, some objects."""
    if isinstance(value, str):
        return value
    if isinstance(value, dict):
        return json.dumps(value, ensure_ascii=False)
    return ""
