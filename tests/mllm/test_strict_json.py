from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.mllm.strict_json import MAX_BYTES, MAX_DEPTH, parse_json_object

settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=100)
settings.load_profile("fixed")

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**18), 10**18)
    | texts
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=12,
)
objects = st.dictionaries(texts, values, max_size=5)


@given(objects, st.booleans(), st.sampled_from([None, 2]))
def test_any_object_comes_back(value: dict[str, object], ascii_only: bool, indent: object) -> None:
    text = json.dumps(value, ensure_ascii=ascii_only, indent=indent)
    for wrapped in (
        text,
        f"\ufeff  {text}\n",
        f"```json\n{text}\n```",
        f"```\n{text}\n```\n",
        f"<think>a {{ brace and ``` fence</think>\n{text}",
        f"thoughts without the opening tag</think>```json\n{text}```",
    ):
        assert parse_json_object(wrapped) == value


FRAGMENTS = [
    "{", "}", "[", "]", ":", ",", '"', "\\", '"a"', '"b"', "1", "-", "1e999", "NaN", "-Infinity",
    "true", "null", "```", "```json", "\n", " ", "<think>", "</think>", '"\\ud800"',
    "\x00", "é", "0",
]  # fmt: skip


def _value_or_reply_format_error(text: str) -> None:
    complaint = ""
    try:
        value = parse_json_object(text)
    except ReplyFormatError as error:
        complaint = str(error)
    if complaint:
        assert 10 < len(complaint) < 300
        complaint.encode()
    else:
        assert isinstance(value, dict)
        json.dumps(value, allow_nan=False, ensure_ascii=False).encode()


@given(st.lists(st.sampled_from(FRAGMENTS), max_size=25).map("".join))
def test_json_like_text_gives_an_object_or_the_named_error(text: str) -> None:
    _value_or_reply_format_error(text)


@given(st.text(max_size=60))
def test_any_text_gives_an_object_or_the_named_error(text: str) -> None:
    _value_or_reply_format_error(text)


@given(objects, st.data())
def test_damaged_json_gives_an_object_or_the_named_error(
    value: dict[str, object], data: st.DataObject
) -> None:
    text = json.dumps(value)
    cut = data.draw(st.integers(0, len(text)))
    _value_or_reply_format_error(text[:cut] + data.draw(st.sampled_from(FRAGMENTS)) + text[cut:])
    _value_or_reply_format_error(text[:cut])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        (" \n", "empty"),
        ("<think>still thinking", "cut off inside <think>"),
        ("<think>x</think>", "empty"),
        ("Sure, here it is: {}", 'at line 1, column 1, near "Sure, here'),
        ('{"a": 1,}', "is not JSON"),
        ('{"a": tru}', "line 1, column 7"),
        ("{'a': 1}", "is not JSON"),
        ('{"a": "line\nbreak"}', "Invalid control character"),
        ('{"a": 1} and more', 'after the JSON value at line 1, column 10, near "and more"'),
        ('{"a": 1}{"a": 1}', "after the JSON value"),
        ('```json\n{"a": 1}', "code fence"),
        ('```json\n{"a": 1}\n``` hope this helps', "code fence"),
        ('{"a": 1, "b": {"c": 1, "c": 1}}', 'key "c" appears twice'),
        ('{"a": NaN}', "NaN is no finite number at line 1, column 7"),
        ('{\n"a": [-Infinity]}', "-Infinity is no finite number at line 2, column 7"),
        ('{"a": 1e999}', "1e999 is no finite number"),
        ('{"a": ' + "9" * 5000 + "}", "more than 40 characters"),
        ("[1, 2]", "JSON list"),
        ('"text"', "JSON string"),
        ("12", "JSON number"),
        ("true", "JSON boolean"),
        ("null", "JSON null"),
        ('{"a": "\\ud800"}', "unpaired surrogate"),
        ('{"\\udfff": 1}', "unpaired surrogate"),
        ('{"a": "' + "x" * MAX_BYTES + '"}', "at most 100000"),
    ],
)
def test_what_and_where(text: str, words: str) -> None:
    with pytest.raises(ReplyFormatError) as error:
        parse_json_object(text)
    assert words in str(error.value)


def test_words_inside_strings_are_only_words() -> None:
    value = {"a": 'NaN [[[ Infinity ``` </think> 1e999 " \\', "b": "{" * 100}
    assert parse_json_object(json.dumps(value)) == value


def test_depth() -> None:
    deepest = '{"a": ' + "[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1) + "}"
    parse_json_object(deepest)
    for text in (f'{{"b": {deepest}}}', '{"a": ' + "[" * 30_000):
        with pytest.raises(ReplyFormatError, match="nests deeper than 32"):
            parse_json_object(text)


def test_quotes_without_end_are_scanned_in_linear_time() -> None:
    with pytest.raises(ReplyFormatError):
        parse_json_object('{"' + '\\"' * 45_000)


def test_numbers_keep_their_types() -> None:
    value = parse_json_object('{"a": 1, "b": 1.0, "c": -2.5e-3}')
    assert isinstance(value["a"], int)
    assert isinstance(value["b"], float)
    assert math.isclose(value["c"], -0.0025)
