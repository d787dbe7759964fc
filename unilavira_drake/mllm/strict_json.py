"""Strict JSON: a model's text is exactly one JSON object, or the reason why not.

Python's own parser is too kind for this border: it lets the last of two equal keys win, knows
``NaN``, turns ``1e999`` into infinity and recurses as deep as the text asks.
"""

from __future__ import annotations

import json
import re
from typing import Any

from unilavira_drake.errors import ReplyFormatError

MAX_BYTES = 100_000
MAX_DEPTH = 32
MAX_DIGITS = 40

_TOKEN = re.compile(
    # A string runs to its closing quote or to the end of the text, so the scan stays linear.
    r'"(?:[^"\\]|\\.)*(?:"|\Z)'
    r"|[\[\]{}]"
    r"|-?(?:NaN|Infinity)"
    r"|-?\d[\d.eE+-]*",
    re.DOTALL,
)
_FENCE = re.compile(r"```[A-Za-z0-9_-]*\s*(.*)```", re.DOTALL)
_SURROGATE = re.compile(r"[\ud800-\udfff]")


def parse_json_object(text: str) -> dict[str, Any]:
    """Returns the one JSON object that a reply consists of.

    A ``<think>...</think>`` prefix (its opening tag may be missing: some chat templates keep it)
    and one code fence around the object are taken off; nothing else is repaired.

    Raises:
        ReplyFormatError: if the text is empty, over 100 kB, no JSON, no object, followed by more
            text, nested deeper than 32, or holds a duplicate key, NaN, an infinite number or an
            unpaired surrogate.  The message says what is wrong and where.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_BYTES:
        raise ReplyFormatError(f"the reply has {size} bytes; at most {MAX_BYTES} are read.")
    body = _unwrap(text)
    _check_tokens(body)
    try:
        value, end = json.JSONDecoder(object_pairs_hook=_unique).raw_decode(body)
    except json.JSONDecodeError as error:
        where = _where(body, error.pos)
        raise ReplyFormatError(f"the reply is not JSON: {error.msg} {where}.") from None
    if body[end:].strip():
        end += len(body[end:]) - len(body[end:].lstrip())
        raise ReplyFormatError(f"there is text after the JSON value {_where(body, end)}.")
    if not isinstance(value, dict):
        raise ReplyFormatError(
            f"the reply is a JSON {_kind(value)}; one JSON object {{...}} is asked for."
        )
    _check_strings(value)
    return value


def _unwrap(text: str) -> str:
    body = text.strip("\ufeff \t\r\n")
    if body and body[0] not in "{`" and "</think>" in body:
        body = body.partition("</think>")[2].strip()
    if not body:
        raise ReplyFormatError("the reply is empty; one JSON object is asked for.")
    if body.startswith("<think>"):
        raise ReplyFormatError("the reply is cut off inside <think>; no JSON object follows it.")
    if body.startswith("```"):
        fenced = _FENCE.fullmatch(body)
        if fenced is None:
            raise ReplyFormatError(
                "the code fence around the reply is not closed, or text follows it."
            )
        body = fenced[1].strip()
    return body


def _check_tokens(body: str) -> None:
    depth = 0
    for match in _TOKEN.finditer(body):
        token = match[0]
        if token in "{[":
            depth += 1
            if depth > MAX_DEPTH:
                where = _where(body, match.start())
                raise ReplyFormatError(f"the reply nests deeper than {MAX_DEPTH} {where}.")
        elif token in "}]":
            depth -= 1
        elif token[0] != '"':
            _check_number(token, body, match.start())


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


def _where(body: str, position: int) -> str:
    line = body.count("\n", 0, position) + 1
    column = position - body.rfind("\n", 0, position)
    near = json.dumps(body[position : position + 24])
    return f"at line {line}, column {column}, near {near}"


def _kind(value: Any) -> str:
    names = {list: "list", str: "string", bool: "boolean", type(None): "null"}
    return names.get(type(value), "number")
