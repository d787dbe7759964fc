"""100,000 damaged replies: each is a value or a ``ReplyFormatError``, nothing else."""

from __future__ import annotations

import dataclasses
import json
import math
import random
import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.messages import CALLS, DIRECTIONS, TodoItem
from unilavira_drake.messages.actions import TOOLS
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.reply_forms import REPLY_MODELS
from unilavira_drake.mllm.request import (
    LanguageVariables,
    MllmRequest,
    VisionVariables,
    WaypointNote,
)
from unilavira_drake.vision.reply import parse_vision_reply

CHUNKS = 20
CHUNK = 5_000

DECISION: dict[str, Any] = {
    "progress_analysis": "Just left the bedroom; “étage” 😀.",
    "reasoning_todo": "The first item is proved by the door behind.",
    "todo_updates": [
        {"op": "update", "index": 1, "status": "completed", "result": "the door is behind me"},
        {"op": "rewrite", "index": 2, "content": "find the red sofa"},
        {"op": "add", "content": "stop there", "index": None},
        {"op": "remove", "index": 2},
    ],
    "reasoning_action": 'A door to the left: "exit".',
    "action": {"tool": "turn", "direction": "left"},
    "scene": "A corridor.",
}
GROUND: dict[str, Any] = {
    "target_desc": "white door",
    "box": [100, 200.5, 300, 400],
    "point": None,
    "confidence": 0.9,
    "reason": "",
}
VALID: list[tuple[str, dict[str, Any]]] = [
    ("plan_todo", {"reasoning": "Two steps.", "todo": ["leave the room", "find the sofa"]}),
    ("decide", DECISION),
    ("decide", {**DECISION, "action": {"tool": "backtrack", "waypoint": 5}}),
    ("recover", {**DECISION, "action": {"tool": "go_stair", "stair": "up"}}),
    ("recover", {**DECISION, "action": {"tool": "double_check"}}),
    ("double_check", {"reasoning": "Compared.", "confirmed": False, "reason": "no sofa"}),
    ("answer", {"reasoning": "Seen.", "answer": "dark red"}),
    ("ground", GROUND),
    ("ground", {**GROUND, "box": None, "point": [320, 240]}),
    ("ground", {**GROUND, "box": None, "reason": "only a wall"}),
]
SNIPPETS = [
    "{", "}", "[", "]", ":", ",", '"', "\\", "\n", "\x00", "\x1b[2J", "\ufeff", "\u2028", "\ud800",
    "\\ud800", "\\u0000", "😀", "é", "٣", "NaN", "-Infinity", "1e999", "True", "None", "null",
    "true", "9" * 60, "0x1F", "1_000", "-0", "-1", "1e-400", "```", "```json\n", "<think>",
    "</think>", '{"a": 1}', '"a": 1,', "[" * 40, "// no", "<b>", "'", "{}", "todo", "op",
    "9" * 5_000, "[" * 2_000,
]  # fmt: skip
VALUES: list[Any] = [
    None, True, False, 0, -1, 1, 2, 5, 99, 10**39, 0.5, -0.0, 1e308, 5e-324, 1000, 1019.9, math.nan,
    math.inf, "", " ",
    "1", "0.5", "-3", "1e999", "nan", "left", "backtrack", "x" * 500, "<script>", "\x07", [], {},
    [[]], [1, 2], [1, 2, 3], [10, 10, 200, 200], [200, 200, 10, 10], [0, 0, 1e9, 1],
    ["5", 5, "99", 99], {"tool": "turn"}, {"op": "remove", "index": "2"},
    {"tool": "backtrack", "waypoint": "1"},
]  # fmt: skip
TOKENS = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}:,]|[^\s\[\]{}:,"]+|\s+')


def _request(call: str, generator: random.Random) -> MllmRequest:
    if call == "ground":
        space = generator.choice(sorted(BOX_SPACES))
        return MllmRequest(
            role="vision", n=3, call=call, variables=VisionVariables(box_space=space)
        )
    variables = LanguageVariables(
        family=generator.choice(("vln", "eqa")),
        todo=None if generator.random() < 0.1 else (TodoItem("leave"), TodoItem("find")),
        waypoints=(WaypointNote(1, offered=True), WaypointNote(2), WaypointNote(5, offered=True)),
        second_chance=generator.random() < 0.9,
        failed_direction=generator.choice(("", "left")),
        can_climb=generator.random() < 0.5,
    )
    return MllmRequest(n=3, call=call, variables=variables)


def _check(text: str, request: MllmRequest) -> bool:
    """Returns whether the text was a value, after a look at what stands in it."""
    try:
        action: Any = (
            parse_vision_reply(text, request)
            if request.role == "vision"
            else parse_language_reply(text, request)
        )
    except ReplyFormatError as error:
        sentence = str(error)
        assert 10 < len(sentence) < 1_500
        sentence.encode()
        return False
    assert (action.n, action.fallback) == (3, False)
    assert all(isinstance(repair, str) and len(repair) < 400 for repair in action.repairs)
    json.dumps(dataclasses.asdict(action), ensure_ascii=False, allow_nan=False).encode()
    if request.role == "vision":
        for place, sides in ((action.box, (640, 480, 640, 480)), (action.point, (640, 480))):
            for number, side in zip(place or (), sides, strict=False):
                assert math.isfinite(number)
                assert 0 <= number <= side
        assert action.box is None or action.point is None
    else:
        assert action.tool in TOOLS
        assert (action.tool == "turn") == (action.direction in DIRECTIONS)
        assert action.waypoint in (None, 1, 5)
    return True


def _cut(text: str, generator: random.Random) -> str:
    return text[: generator.randrange(len(text) + 1)]


def _delete(text: str, generator: random.Random) -> str:
    start = generator.randrange(len(text) + 1)
    return text[:start] + text[start + generator.randrange(1, 9) :]


def _double(text: str, generator: random.Random) -> str:
    start = generator.randrange(len(text) + 1)
    end = start + generator.choice((1, 5, 40, len(text)))
    return text[:end] + text[start:end] + text[end:]


def _insert(text: str, generator: random.Random) -> str:
    start = generator.randrange(len(text) + 1)
    return text[:start] + generator.choice(SNIPPETS) + text[start:]


def _letter(text: str, generator: random.Random) -> str:
    start = generator.randrange(len(text) + 1)
    letter = chr(generator.choice((generator.randrange(128), generator.randrange(0x11000))))
    return text[:start] + letter + text[start + 1 :]


def _swap_tokens(text: str, generator: random.Random) -> str:
    tokens = TOKENS.findall(text)
    if len(tokens) > 1:
        i, j = generator.randrange(len(tokens)), generator.randrange(len(tokens))
        tokens[i], tokens[j] = tokens[j], tokens[i]
    return "".join(tokens)


def _drop_or_double_token(text: str, generator: random.Random) -> str:
    tokens = TOKENS.findall(text)
    if tokens:
        i = generator.randrange(len(tokens))
        tokens[i] = generator.choice(("", tokens[i] * 2, generator.choice(SNIPPETS)))
    return "".join(tokens)


def _wrap(text: str, generator: random.Random) -> str:
    form = generator.choice(
        ("```json\n{}\n```", "<think>hm {{</think>{}", "Sure: {} Bye.", "[{}]", "{}{}", "{} or {}")
    )
    return form.format(text, text)


DAMAGES: list[Callable[[str, random.Random], str]] = [
    _cut, _delete, _double, _insert, _letter, _swap_tokens, _drop_or_double_token, _wrap,
]  # fmt: skip


def _exchanged(value: Any, generator: random.Random, rate: float = 0.02) -> Any:
    """Returns the JSON value with other values, keys too many or too few somewhere in it."""
    if generator.random() < rate:
        return generator.choice(VALUES)
    if isinstance(value, dict):
        key = generator.choice([*value, "other"])
        if key == "other" or generator.random() < 0.1:
            return {**value, generator.choice(("other", "index", "why")): generator.choice(VALUES)}
        if generator.random() < 0.1:
            return {name: item for name, item in value.items() if name != key}
        return {**value, key: _exchanged(value[key], generator, 0.1)}
    if isinstance(value, list) and value:
        index = generator.randrange(len(value))
        item = _exchanged(value[index], generator, 0.1)
        return [*value[:index], item, *value[index + (generator.random() < 0.9) :]]
    if isinstance(value, int | float) and not isinstance(value, bool):
        near = generator.choice((generator.randint(-50, 1050), generator.uniform(-50, 1050)))
        return generator.choice((near, near, str(near), str(value), f" {value} ", -value))
    return generator.choice(VALUES)


def _damaged(reply: dict[str, Any], generator: random.Random) -> str:
    value: Any = reply
    for _ in range(generator.choice((0, 1, 1, 2, 4))):
        value = _exchanged(value, generator)
    text = json.dumps(value, ensure_ascii=generator.random() < 0.5)
    for _ in range(generator.choice((0, 0, 1, 1, 2, 6))):
        text = generator.choice(DAMAGES)(text, generator)
    return text


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_a_damaged_reply_is_a_value_or_the_named_error(chunk: int) -> None:
    generator = random.Random(chunk)
    accepted = 0
    for i in range(CHUNK):
        call, reply = VALID[i % len(VALID)]
        accepted += _check(_damaged(reply, generator), _request(call, generator))
    # Both ends are met, or the damage is too small or too great to test anything.
    assert CHUNK * 0.12 < accepted < CHUNK * 0.5


def test_what_is_damaged_was_sound() -> None:
    assert {call for call, _ in VALID} == {*CALLS, "ground"} == set(REPLY_MODELS) - {"judge"}
    for call, reply in VALID:
        variables: Any = (
            VisionVariables()
            if call == "ground"
            else LanguageVariables(
                todo=(TodoItem("leave"), TodoItem("find")),
                waypoints=(WaypointNote(5, offered=True),),
                can_climb=True,
            )
        )
        role = "vision" if call == "ground" else "language"
        request = MllmRequest(role=role, n=3, call=call, variables=variables)
        assert _check(json.dumps(reply), request), call


keys = st.sampled_from(sorted({key for _, reply in VALID for key in reply} | {"tool", "op", ""}))
scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12)
jsonish = st.recursive(
    scalars | st.sampled_from(["turn", "left", "remove", "completed", "3", "0.5"]),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(keys, inner, max_size=6),
    max_leaves=15,
)


@given(st.sampled_from(VALID), st.dictionaries(keys, jsonish, max_size=6), st.integers(0, 99))
@settings(
    derandomize=True, deadline=None, max_examples=1_000, suppress_health_check=list(HealthCheck)
)
def test_json_like_text_is_a_value_or_the_named_error(
    valid: tuple[str, dict[str, Any]], other: dict[str, Any], seed: int
) -> None:
    call, reply = valid
    generator = random.Random(seed)
    request = _request(call, generator)
    for value in (other, {**reply, **other}):
        text = json.dumps(value, ensure_ascii=False)
        _check(text, request)
        _check(generator.choice(DAMAGES)(text, generator), request)
