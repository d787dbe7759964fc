from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.mllm import strict_json
from unilavira_drake.mllm.strict_json import (
    MAX_BYTES,
    MAX_DEPTH,
    OBJECT_IGNORED,
    TEXT_IGNORED,
    parse_json_object,
    read_json_object,
)

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
        f"<think>one</think>\n<think>two</think>{text}",
    ):
        assert read_json_object(wrapped) == (value, ())
        assert parse_json_object(wrapped) == value


@given(objects.filter(bool), st.sampled_from([None, 2]))
def test_any_object_comes_back_out_of_the_text_around_it(
    value: dict[str, object], indent: object
) -> None:
    text = json.dumps(value, indent=indent)
    for around in (
        f"Sure, here it is: {text}",
        f"{text}\nHope this helps!",
        f'He said "go {{left}} or [right]", so {text} it is. {{}}',
        f"The reply:\n```json\n{text}\n```\nDone.",
        f"```json\nFirst of all: {text}\n```",
        f"```json\n{text}",
        f"<think>x</think>So:\n{text}",
        f"{text}}}",
    ):
        assert read_json_object(around) == (value, (TEXT_IGNORED,))


def test_a_second_object_is_ignored_unless_it_may_be_the_one_that_is_meant() -> None:
    both = (TEXT_IGNORED, OBJECT_IGNORED)
    for text in (
        '{"a": 1}{"a": 1}',
        '{"a": 1, "b": 2} {"b": 2, "a": 1}',
        '{"a": 1} and {"b": 2}',
        '{"a": 1} and {"b": 2',
        '{"a": 1} and {"b": {"a": 2}}',
        '{"a": 1} {"a": 1, "b": 2}',
    ):
        value, repairs = read_json_object(text)
        assert value["a"] == 1
        assert repairs == both


def test_the_end_of_thoughts_is_a_word_inside_of_an_object() -> None:
    for text in ('So: {"a": "</think>"} or {}', 'x</think>{"a": "</think>"}'):
        assert parse_json_object(text) == {"a": "</think>"}
    assert parse_json_object('Try {"draft": NaN}, {"a": 1}, no.</think>{"a": 2}') == {"a": 2}


def test_empty_braces_are_text_beside_an_object_with_keys() -> None:
    assert read_json_object('Fill in {}: {"a": 1}') == ({"a": 1}, (TEXT_IGNORED,))
    assert read_json_object("Nothing: {}") == ({}, (TEXT_IGNORED,))


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
        ('<think>maybe {"a": 1}', "cut off inside <think>"),
        ('Well, <think>maybe {"a": 1}', "cut off inside <think>"),
        ("<think>x</think>", "empty"),
        ("<think>x</think>I cannot.", 'no JSON object, it begins with "I cannot."'),
        ("Sure, I will turn left.", 'no JSON object, it begins with "Sure, I will'),
        ("```json\n```", "no JSON object"),
        ("```json", "no JSON object"),
        ('{"a": 1,}', "is not JSON"),
        ('{"a": tru}', "line 1, column 7"),
        ("{'a': 1}", "is not JSON"),
        ("""{'a': {"b": 1}}""", "double quotes at line 1, column 2"),
        ('Here: {a: {"b": 1}}', "double quotes at line 1, column 8"),
        ('{{"a": 1}}', "double quotes at line 1, column 2"),
        ('{"a": {"b": 1}, "c": "cut', "Unterminated string starting at line 1, column 22"),
        ('Here: {"a": {"b": 1}, "c": ', "Expecting value at line 1, column 27, where it ends"),
        ('{"a": "line\nbreak"}', "raw line break or control character (write \\n) at line 1"),
        (
            '{"a": True}',
            'a word of Python (write true, false or null) at line 1, column 7, near "T',
        ),
        ('{"a": [None]}', "a word of Python"),
        ('{"a":\ufeff1}', 'Expecting value at line 1, column 6, near "\\ufeff1}"'),
        ('{"a": 1}{"a": 2}', "two JSON objects with the same keys and other values"),
        ('{"a": 1, "b": 2} or {"b": 1, "a": 2}', 'The second is at line 1, column 21, near "{'),
        ('{"a": 1, "b": 2} no, {"a": 1, "b', "two JSON objects with the same keys"),
        ('{"a": 1}' * 10, "more than 8 objects"),
        ('{"a": 1, "b": {"c": 1, "c": 1}}', 'key "c" appears twice'),
        ('{"a": NaN}', "NaN is no finite number at line 1, column 7"),
        ('{\n"a": [-Infinity]}', "-Infinity is no finite number at line 2, column 7"),
        ('{"a": 1e999}', "1e999 is no finite number"),
        ('{"a": ' + "9" * 10_000 + "}", "more than 40 characters"),
        ("9" * 10_000, "no JSON object"),
        ("[1, 2]", "JSON list"),
        ('[{"a": 1}]', "JSON list"),
        ('```json\n[{"a": 1}]\n```', "JSON list"),
        ('Boxes: [{"a": 1}, {"a": 2}].', "JSON list"),
        ('[{"a": 1}, {"a', "is not JSON"),
        ('"text"', "JSON string"),
        ('"{\\"a\\": 1}"', "JSON string"),
        ("12", "JSON number"),
        ("true", "JSON boolean"),
        ("null", "JSON null"),
        ('{"a": "\\ud800"}', "unpaired surrogate"),
        ('{"\\udfff": 1}', "unpaired surrogate"),
        ('{"a": "\ud800"}', "unpaired surrogate"),
        ('{"a": "' + "x" * MAX_BYTES + '"}', "at most 100000"),
        (" " * MAX_BYTES + '{"a": 1}', "at most 100000"),
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


N = MAX_BYTES - 10
ADVERSARIES = {
    "braces": "{" * N,
    "spaced braces": "{ " * (N // 2),
    "quotes": '"' * N,
    "keys": '{"' * (N // 2),
    "nested": '{"a":' * (N // 5),
    "wide": '{"a":[' + "[]," * (N // 3 - 5),
    "escaped quotes": '{"' + '\\"' * (N // 2 - 2) + "\\",
    "broken objects": '{"}' * (N // 3),
    "an object and broken ones": '{"a":1}' + '{"b"}' * (N // 5 - 3),
    "objects": '{"a":1}' * (N // 7),
    "empty objects": "{}" * (N // 2),
    "lists": "[{" * (N // 2),
    "open lists": "[1," * (N // 3 - 5) + '{"a":1}',
    "fence of letters": "```" + "a" * (N - 3),
    "fence of blanks": "```" + " " * (N - 4) + "x",
    "brace and blanks": '{"a":1}' + "{" + " " * (N - 8),
    "thoughts": "<think></think>" * (N // 15),
    "open thoughts": "<think>" * (N // 7),
    "closed thoughts": "</think>" * (N // 8),
    "objects in thoughts": "x" + '{"a":1}' * (N // 7 - 10) + "</think>" + '{"a":1}',
    "digits": "1" * N,
    "minuses": '{"a":' + "-" * (N - 10),
    "letters": "N" * N,
    "backslashes": '{"a":"' + "\\" * (N - 10),
}


class _Counting:
    """Stands for a compiled pattern and adds up how much text it has gone through."""

    def __init__(self, pattern: re.Pattern[str]) -> None:
        self.pattern, self.matches, self.characters = pattern, 0, 0

    def finditer(self, text: str, position: int) -> Iterator[re.Match[str]]:
        for match in self.pattern.finditer(text, position):
            self._count(position, match.end())
            position = match.end()
            yield match
        self._count(position, len(text))

    def search(self, text: str, position: int) -> re.Match[str] | None:
        match = self.pattern.search(text, position)
        self._count(position, match.end() if match else len(text))
        return match

    def _count(self, start: int, end: int) -> None:
        self.matches += 1
        self.characters += end - start


# The limit of time is no measurement: a quadratic reader would take minutes.
@pytest.mark.timeout(60)
@pytest.mark.parametrize("text", ADVERSARIES.values(), ids=ADVERSARIES.keys())
def test_the_work_is_linear_whatever_the_text(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    counters = [_Counting(strict_json._TOKEN), _Counting(strict_json._OPENING)]
    monkeypatch.setattr(strict_json, "_TOKEN", counters[0])
    monkeypatch.setattr(strict_json, "_OPENING", counters[1])
    assert len(text) <= MAX_BYTES
    _value_or_reply_format_error(text)
    for counter in counters:
        # At most: the text in search of thoughts, as another value, as the object and behind it.
        assert counter.characters <= 4 * len(text)
        assert counter.matches <= 4 * len(text)


def test_numbers_keep_their_types() -> None:
    value = parse_json_object('{"a": 1, "b": 1.0, "c": -2.5e-3}')
    assert isinstance(value["a"], int)
    assert isinstance(value["b"], float)
    assert math.isclose(value["c"], -0.0025)
