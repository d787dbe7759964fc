from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import VisionAction
from unilavira_drake.mllm.reply_forms import reply_schema
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables
from unilavira_drake.vision.reply import parse_vision_reply

REQUEST = MllmRequest(
    role="vision",
    n=5,
    call="ground",
    variables=VisionVariables(direction="left", width=640, height=480),
)
REPLY: dict[str, Any] = {
    "target_desc": "white door",
    "box": [10, 20, 110.5, 220],
    "point": None,
    "confidence": 1,
    "reason": "",
}


def _parse(**changes: Any) -> VisionAction:
    return parse_vision_reply(json.dumps({**REPLY, **changes}), REQUEST)


def test_box() -> None:
    assert _parse() == VisionAction(
        n=5,
        direction="left",
        box=(10.0, 20.0, 110.5, 220.0),
        target_desc="white door",
        confidence=1,
    )


def test_point() -> None:
    action = _parse(box=None, point=[0, 479.5], confidence=None)
    assert (action.box, action.point, action.confidence) == (None, (0.0, 479.5), None)


def test_neither_with_a_reason() -> None:
    action = _parse(box=None, target_desc="", reason="only a wall")
    assert (action.box, action.point, action.reason) == (None, None, "only a wall")


def test_a_reason_beside_a_box_is_dropped() -> None:
    assert _parse(reason="it is plainly there").reason == ""


def test_a_box_over_the_edge_is_clipped() -> None:
    assert _parse(box=[-50, -1, 700, 481]).box == (0.0, 0.0, 640.0, 480.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point": [1, 1]}, "both box and point"),
        ({"box": None}, "say why not"),
        ({"box": None, "reason": " "}, "say why not"),
        ({"box": [110, 20, 10, 220]}, "turned round"),
        ({"box": [10, 220, 110, 20]}, "turned round"),
        ({"box": [10, 20, 10, 220]}, "turned round"),
        ({"box": [10, 20, 13.9, 24]}, "less than 16 square pixels"),
        ({"box": [650, 20, 700, 220]}, "640 wide and 480 high"),
        ({"box": [-90, -90, -10, -10]}, "less than 16"),
        ({"box": [10, 20, 110]}, "box: list should have at least 4 items"),
        ({"box": [10, 20, 110, 220, 1]}, "box: list should have at most 4 items"),
        ({"box": [10, 20, 110, "220"]}, "box.#4"),
        ({"box": [10, 20, 110, True]}, "box.#4"),
        ({"box": None, "point": [640, 10]}, "outside the image"),
        ({"box": None, "point": [10, -1]}, "outside the image"),
        ({"box": None, "point": [10]}, "point"),
        ({"target_desc": " "}, "target_desc is empty"),
        ({"target_desc": "x" * 121}, "at most 120 characters"),
        ({"confidence": 1.5}, "confidence"),
        ({"confidence": "high"}, "confidence"),
        ({"label": "door"}, "the key label is not asked for"),
    ],
)
def test_what_cannot_be_used(changes: Any, words: str) -> None:
    with pytest.raises(ReplyFormatError) as error:
        _parse(**changes)
    assert words in str(error.value)


def test_a_language_request_is_a_bug() -> None:
    with pytest.raises(TypeError):
        parse_vision_reply("{}", MllmRequest(role="vision", variables=LanguageVariables()))


numbers = st.integers(-2000, 2000) | st.floats(-1e4, 1e4)


@given(st.lists(numbers, min_size=4, max_size=4))
@settings(derandomize=True, deadline=None, max_examples=100)
def test_an_accepted_box_lies_in_the_image(box: list[float]) -> None:
    try:
        action = _parse(box=box)
    except ReplyFormatError:
        return
    assert action.box is not None
    u_min, v_min, u_max, v_max = action.box
    assert 0 <= u_min < u_max <= 640
    assert 0 <= v_min < v_max <= 480
    assert (u_max - u_min) * (v_max - v_min) >= 16


def test_schema() -> None:
    schema = reply_schema("ground")
    assert list(schema["properties"]) == schema["required"] == list(REPLY)
    assert schema["additionalProperties"] is False
