"""Strict JSON: the one JSON object that a model's text holds, or the reason why there is none.

What stands around the object is forgiven, what stands inside is not.  Python's own parser is too
kind for this border: it lets the last of two equal keys win, knows ``NaN``, turns ``1e999`` into
infinity and recurses as deep as the text asks.  The work is linear in the length of the text.
"""

from __future__ import annotations

import json
import re
from typing import Any

from unilavira_drake.errors import ReplyFormatError

MAX_BYTES = 100_000
MAX_DEPTH = 32
MAX_DIGITS = 40
MAX_OBJECTS = 8

TEXT_IGNORED = "text around the JSON object was ignored"
OBJECT_IGNORED = "a second JSON object was ignored"

_TOKEN = re.compile(
    # A string runs to its closing quote or to the end of the text, a last backslash included:
    # nothing is read far and then given up, so the scan stays linear.
    r'"(?:[^"\\]|\\.)*(?:"|\\?\Z)'
    r"|[\[\]{}]"
    r"|-?(?:NaN|Infinity)"
    r"|-?\d[\d.eE+-]*",
    re.DOTALL,
)
# The brace of an object is followed by a key; one in a sentence hardly ever is.
_OPENING = re.compile(r'\{\s*"')
_FENCE = re.compile(r"```[A-Za-z0-9_-]*\s*")
_THOUGHTS = re.compile(r"\s*<think>")
_THOUGHTS_END = "</think>"
_CUT_OFF = "the reply is cut off inside <think>; no JSON object follows it."
_SURROGATE = re.compile(r"[\ud800-\udfff]")
_PYTHON_WORD = re.compile(r"(?:True|False|None)\b")


def parse_json_object(text: str) -> dict[str, Any]:
    """Returns the object of :func:`read_json_object`, without the repairs."""
    return read_json_object(text)[0]


def read_json_object(text: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Returns the first JSON object of a text, and what had to be repaired to find it.

    A ``<think>...</think>`` prefix (its opening tag may be missing: some chat templates keep it)
    and one code fence around the object are no repair.  Other text around the object is: it is
    ignored and named.  So is a second object, unless it has the same keys and other values: which
    one is meant cannot be known.  An object inside a list or another JSON value is not taken out.

    Raises:
        ReplyFormatError: if the text is empty, over 100 kB, holds no object or two equally good
            ones; if the object is no JSON, nested deeper than 32, or holds a duplicate key, NaN,
            an infinite or overlong number, a raw line break in a string or an unpaired surrogate.
            The message says what is wrong and where.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_BYTES:
        raise ReplyFormatError(f"the reply has {size} bytes; at most {MAX_BYTES} are read.")
    body = text.strip("\ufeff \t\r\n")
    body = body[_end_of_thoughts(body) :].strip()
    if not body:
        raise ReplyFormatError("the reply is empty; one JSON object is asked for.")
    start = _opening(body)
    if "<think>" in body[:start]:
        raise ReplyFormatError(_CUT_OFF)
    value, end = _decode(body, start)
    _check_kind(value)
    _check_strings(value)
    repairs = []
    if not _is_wrapping(body[:start].strip(), body[end:].strip()):
        repairs.append(TEXT_IGNORED)
    if _has_second_object(value, body, end):
        repairs.append(OBJECT_IGNORED)
    return value, tuple(repairs)


def _end_of_thoughts(body: str) -> int:
    position = 0
    if body and body[0] not in "{`" and not _THOUGHTS.match(body):
        end = body.find(_THOUGHTS_END)
        if 0 <= end < body.rfind("{") and not _stands_in_object(end, body):
            position = end + len(_THOUGHTS_END)
    while opened := _THOUGHTS.match(body, position):
        end = body.find(_THOUGHTS_END, opened.end())
        if end < 0:
            raise ReplyFormatError(_CUT_OFF)
        position = end + len(_THOUGHTS_END)
    return position


def _stands_in_object(position: int, body: str) -> bool:
    found = _OPENING.search(body, 0)
    try:
        return found is not None and _decode(body, found.start())[1] > position > found.start()
    except ReplyFormatError:
        return False


def _opening(body: str) -> int:
    """Returns where the first object begins, or what it stands in when that is not text."""
    fence = _FENCE.match(body)
    first = fence.end() if fence else 0
    found = _OPENING.search(body, first)
    start = found.start() if found else body.find("{", first)
    if start < 0 or body[first] == '"':
        _refuse_other_value(body, first)
    if start < 0:
        raise ReplyFormatError(
            f"the reply holds no JSON object, it begins with {json.dumps(body[:40])}; one object "
            "{...} is asked for."
        )
    outer = [
        body.find(opening, first)
        for opening, closing in ("{}", "[]")
        if body.count(opening, first, start) > body.count(closing, first, start)
    ]
    return min(outer, default=start)


def _refuse_other_value(body: str, first: int) -> None:
    try:
        value, end = _decode(body, first)
    except ReplyFormatError:
        return
    if body[end:].strip() in ("", "```"):
        _check_kind(value)


def _check_kind(value: Any) -> None:
    names = {list: "list", str: "string", bool: "boolean", type(None): "null"}
    if not isinstance(value, dict):
        kind = names.get(type(value), "number")
        raise ReplyFormatError(f"the reply is a JSON {kind}; one JSON object {{...}} is asked for.")


def _decode(body: str, start: int) -> tuple[Any, int]:
    _scan(body, start)
    try:
        return _DECODER.raw_decode(body, start)
    except json.JSONDecodeError as error:
        raise ReplyFormatError(
            f"the reply is not JSON: {_reason(body, error)} {_where(body, error.pos)}."
        ) from None


def _scan(body: str, start: int) -> int:
    """Returns where the value ends by its brackets, having checked its depth and numbers."""
    depth = 0
    for match in _TOKEN.finditer(body, start):
        token = match[0]
        if token in "{[":
            depth += 1
            if depth > MAX_DEPTH:
                where = _where(body, match.start())
                raise ReplyFormatError(f"the reply nests deeper than {MAX_DEPTH} {where}.")
        elif token in "}]":
            depth -= 1
            if depth <= 0:
                return match.end()
        elif token[0] != '"':
            _check_number(token, body, match.start())
    return len(body)


def _check_number(token: str, body: str, position: int) -> None:
    if len(token) > MAX_DIGITS:
        where = _where(body, position)
        raise ReplyFormatError(f"a number has more than {MAX_DIGITS} characters {where}.")
    try:
        finite = abs(float(token)) < float("inf")
    except ValueError:
        return  # No number after all: the JSON parser reports it with its own words.
    if not finite:
        raise ReplyFormatError(f"{token} is no finite number {_where(body, position)}.")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value: dict[str, Any] = {}
    for key, item in pairs:
        if key in value:
            raise ReplyFormatError(f"the key {json.dumps(key)[:80]} appears twice in one object.")
        value[key] = item
    return value


_DECODER = json.JSONDecoder(object_pairs_hook=_unique)


def _check_strings(value: Any) -> None:
    if isinstance(value, str):
        if _SURROGATE.search(value):
            raise ReplyFormatError(f"the text {ascii(value)[:80]} holds an unpaired surrogate.")
    elif isinstance(value, list):
        for item in value:
            _check_strings(item)
    elif isinstance(value, dict):
        for key, item in value.items():
            _check_strings(key)
            _check_strings(item)


def _is_wrapping(before: str, after: str) -> bool:
    if not before:
        return not after
    return after == "```" and _FENCE.fullmatch(before) is not None


def _has_second_object(value: dict[str, Any], body: str, position: int) -> bool:
    seen = 0
    while found := _OPENING.search(body, position):
        seen += 1
        if seen > MAX_OBJECTS:
            raise ReplyFormatError(f"the reply holds more than {MAX_OBJECTS} objects; give one.")
        position = _scan(body, found.start())
        try:
            other, _ = _DECODER.raw_decode(body, found.start())
        except (json.JSONDecodeError, ReplyFormatError):
            # Broken or cut off, so it is known by how it begins.
            rival = bool(value) and body.startswith(json.dumps(next(iter(value))), found.end() - 1)
        else:
            rival = other.keys() == value.keys() and _canonical(other) != _canonical(value)
        if rival:
            raise ReplyFormatError(
                "the reply holds two JSON objects with the same keys and other values; give one "
                f"object. The second is {_where(body, found.start())}."
            )
    return seen > 0


def _canonical(value: dict[str, Any]) -> str:
    return json.dumps(value, sort_keys=True)


def _reason(body: str, error: json.JSONDecodeError) -> str:
    if error.msg.startswith("Invalid control character"):
        return "a string holds a raw line break or control character (write \\n)"
    if _PYTHON_WORD.match(body, error.pos):
        return "a word of Python (write true, false or null)"
    return error.msg.removesuffix(" at")


def _where(body: str, position: int) -> str:
    line = body.count("\n", 0, position) + 1
    column = position - body.rfind("\n", 0, position)
    near = f"near {json.dumps(body[position : position + 24])}"
    return f"at line {line}, column {column}, {near if position < len(body) else 'where it ends'}"
