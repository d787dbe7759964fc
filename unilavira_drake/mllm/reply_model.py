"""The base of every reply model: what a form forgives, and errors a model can act on.

Two things are forgiven and named as repairs: a number written as text, and a key nobody asked for.
All other types are strict.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from typing import Annotated, Any, TypeVar

import pydantic

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.mllm.strict_json import MAX_DIGITS, read_json_object

M = TypeVar("M", bound="ReplyModel")

MAX_REPAIRS = 8

_MAX_COMPLAINTS = 3
_MAX_KEYS = 5
_WHOLE = re.compile(r"[+-]?[0-9]+")
_DECIMAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def _whole_from_text(value: Any, info: pydantic.ValidationInfo) -> Any:
    return _number_from_text(value, info, _WHOLE, int)


def _decimal_from_text(value: Any, info: pydantic.ValidationInfo) -> Any:
    return _number_from_text(value, info, _DECIMAL, float)


Whole = Annotated[int, pydantic.BeforeValidator(_whole_from_text)]
"""A whole number, also when it is given as text."""
Number = Annotated[float, pydantic.BeforeValidator(_decimal_from_text)]
"""A finite number, also when it is given as text."""
Share = Annotated[
    float, pydantic.Field(ge=0.0, le=1.0), pydantic.BeforeValidator(_decimal_from_text)
]
"""A number from 0 to 1, also when it is given as text."""
Mark = Annotated[int, pydantic.Field(ge=1, le=5), pydantic.BeforeValidator(_whole_from_text)]
"""A whole number from 1 to 5, also when it is given as text."""
Bearing = Annotated[
    float, pydantic.Field(ge=-180.0, le=180.0), pydantic.BeforeValidator(_decimal_from_text)
]
"""Degrees to the left of the front, also when they are given as text."""
Distance = Annotated[
    float, pydantic.Field(ge=0.0, le=100.0), pydantic.BeforeValidator(_decimal_from_text)
]
"""Metres along the ground in one move, also when they are given as text."""
Climb = Annotated[
    float, pydantic.Field(ge=-100.0, le=100.0), pydantic.BeforeValidator(_decimal_from_text)
]
"""Metres to end higher (below zero: lower) than now, also when they are given as text."""


class ReplyModel(pydantic.BaseModel):
    """One JSON object of a reply; the order of its fields is the order asked of the model."""

    model_config = pydantic.ConfigDict(
        strict=True,
        extra="ignore",
        frozen=True,
        # The schema that a model is held to is stricter than what is read.
        json_schema_extra={"additionalProperties": False},
    )

    @classmethod
    def read(cls: type[M], text: str) -> tuple[M, tuple[str, ...]]:
        """Returns the reply that a model's text holds, and what was repaired to read it.

        Raises:
            ReplyFormatError: if the text holds no JSON object of this form.
        """
        value, found = read_json_object(text)
        repairs = list(found)
        try:
            return cls.model_validate(value, context=repairs), listed_repairs(repairs)
        except pydantic.ValidationError as error:
            complaints = [_complaint(dict(item)) for item in error.errors(include_url=False)]
        more = len(complaints) - _MAX_COMPLAINTS
        tail = f" (and {more} more)" if more > 0 else ""
        raise ReplyFormatError("; ".join(complaints[:_MAX_COMPLAINTS]) + tail + ".")

    @pydantic.model_validator(mode="before")
    @classmethod
    def _note_other_keys(cls, value: Any, info: pydantic.ValidationInfo) -> Any:
        if isinstance(value, dict) and isinstance(info.context, list):
            others = [key for key in value if key not in cls.model_fields]
            if others:
                names = ", ".join(json.dumps(key[:40]) for key in others[:_MAX_KEYS])
                more = len(others) - _MAX_KEYS
                tail = f" and {more} more" if more > 0 else ""
                info.context.append(f"keys that are not asked for were ignored: {names}{tail}")
        return value


def listed_repairs(repairs: Iterable[str]) -> tuple[str, ...]:
    """Returns each repair once, in order; of very many only the first and how many more."""
    each = tuple(dict.fromkeys(repairs))
    more = len(each) - MAX_REPAIRS
    return each if more <= 0 else (*each[:MAX_REPAIRS], f"and {more} further repairs")


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
    message = str(error["msg"])
    given = json.dumps(error["input"], ensure_ascii=False, default=str)
    shown = given if len(given) <= 60 else given[:59] + "…"
    return f"{place}: {message[:1].lower()}{message[1:300]} (given: {shown})"


def _step(part: int | str) -> str:
    # Lists count from 0 in Python; every number that a model sees here counts from 1.
    return f"#{part + 1}" if isinstance(part, int) else part


def _number_from_text(
    value: Any,
    info: pydantic.ValidationInfo,
    grammar: re.Pattern[str],
    kind: type[int] | type[float],
) -> Any:
    """Returns the number that a text is, or the value as it came for the type check to judge."""
    if not isinstance(value, str) or len(value) > MAX_DIGITS or not isinstance(info.context, list):
        return value
    if grammar.fullmatch(value.strip()) is None:
        return value
    number = kind(value)
    if not math.isfinite(number):
        return value
    info.context.append(f"the text {json.dumps(value)} was read as a number")
    return number
