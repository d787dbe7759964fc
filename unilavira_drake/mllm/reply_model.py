"""The base of every reply model: strict types, no unknown key, and errors a model can act on."""

from __future__ import annotations

import json
from typing import Any, TypeVar

import pydantic

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.mllm.strict_json import parse_json_object

M = TypeVar("M", bound="ReplyModel")

_MAX_COMPLAINTS = 3


class ReplyModel(pydantic.BaseModel):
    """One JSON object of a reply; the order of its fields is the order asked of the model."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid", frozen=True)

    @classmethod
    def read(cls: type[M], text: str) -> M:
        """Returns the reply that a model's text holds.

        Raises:
            ReplyFormatError: if the text is not one JSON object of this form.
        """
        value = parse_json_object(text)
        try:
            return cls.model_validate(value)
        except pydantic.ValidationError as error:
            complaints = [_complaint(dict(item)) for item in error.errors(include_url=False)]
        more = len(complaints) - _MAX_COMPLAINTS
        tail = f" (and {more} more)" if more > 0 else ""
        raise ReplyFormatError("; ".join(complaints[:_MAX_COMPLAINTS]) + tail + ".")


def clipped(text: str, limit: int) -> str:
    """Returns the text on one line, cut with an ellipsis at ``limit`` characters.

    For words that explain.  Words that decide something go through :func:`bounded`.
    """
    line = " ".join(text.split())
    return line if len(line) <= limit else line[: limit - 1] + "…"


def bounded(text: str, limit: int, place: str) -> str:
    """Returns the text on one line.

    Raises:
        ReplyFormatError: if it is longer than ``limit`` characters.
    """
    line = " ".join(text.split())
    if len(line) > limit:
        raise ReplyFormatError(
            f"{place} has {len(line)} characters; say it in at most {limit} characters."
        )
    return line


def _complaint(error: dict[str, Any]) -> str:
    place = ".".join(_step(part) for part in error["loc"])[:80] or "the reply"
    if error["type"] == "missing":
        return f"the key {place} is missing"
    if error["type"] == "extra_forbidden":
        return f"the key {place} is not asked for"
    message = str(error["msg"])
    given = json.dumps(error["input"], ensure_ascii=False, default=str)
    shown = given if len(given) <= 60 else given[:59] + "…"
    return f"{place}: {message[:1].lower()}{message[1:300]} (given: {shown})"


def _step(part: int | str) -> str:
    # Lists count from 0 in Python; every number that a model sees here counts from 1.
    return f"#{part + 1}" if isinstance(part, int) else part
