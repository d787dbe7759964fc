from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import VisionAction
from unilavira_drake.mllm.boxes import BOX_SPACES
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


def _request(space: str) -> MllmRequest:
    variables = dataclasses.replace(REQUEST.variables, box_space=space)
    return dataclasses.replace(REQUEST, variables=variables)


def _parse(space: str = "pixels", **changes: Any) -> VisionAction:
    return parse_vision_reply(json.dumps({**REPLY, **changes}), _request(space))


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


CLAMPED = "reached over the edge of the picture and was cut to it"
REORDERED = "the corners of box were in the wrong order and were swapped"


@pytest.mark.parametrize(
    ("space", "changes", "box"),
    [
        ("pixels", {"box": [64, 48, 320, 240]}, (64, 48, 320, 240)),
        ("xyxy_1000", {"box": [100, 100, 500, 500]}, (64, 48, 320, 240)),
        ("xyxy_1000", {"box": [0, 0, 1000, 1000]}, (0, 0, 640, 480)),
        ("yxyx_1000", {"box": [100, 200, 300, 400]}, (128, 48, 256, 144)),
        ("xyxy_resized", {"box": [0, 0, 644, 476]}, (0, 0, 640, 480)),
        ("xyxy_resized", {"box": [322, 119, 483, 238]}, (320, 120, 480, 240)),
    ],
)
def test_each_box_space_is_read_as_pixels(space: str, changes: Any, box: Any) -> None:
    action = _parse(space, **changes)
    assert action.box == pytest.approx(box, abs=1e-9)
    assert action.repairs == ()


@pytest.mark.parametrize(
    ("space", "given", "point"),
    [
        ("pixels", [639.5, 3], (639.5, 3)),
        ("xyxy_1000", [250, 500], (160, 240)),
        ("yxyx_1000", [250, 500], (320, 120)),
        ("xyxy_resized", [161, 357], (160, 360)),
        # The last line of the grid is the edge of the last pixel.
        ("xyxy_1000", [1000, 1000], (639, 479)),
        ("yxyx_1000", [1000, 0], (0, 479)),
        ("pixels", [640, 480], (639, 479)),
    ],
)
def test_each_point_is_read_as_a_pixel(space: str, given: Any, point: Any) -> None:
    action = _parse(space, box=None, point=given)
    assert action.point == pytest.approx(point, abs=1e-9)
    assert action.repairs == ()


@pytest.mark.parametrize(
    ("space", "changes", "box"),
    [
        ("pixels", {"box": [-12.8, -9.6, 652.8, 489.6]}, (0, 0, 640, 480)),
        ("xyxy_1000", {"box": [-20, 100, 500, 1020]}, (0, 48, 320, 480)),
        ("yxyx_1000", {"box": [500, -1, 1001, 500]}, (0, 240, 320, 480)),
        ("xyxy_resized", {"box": [0, 0, 650, 480]}, (0, 0, 640, 480)),
    ],
)
def test_a_box_a_little_over_the_edge_is_cut(space: str, changes: Any, box: Any) -> None:
    action = _parse(space, **changes)
    assert action.box == pytest.approx(box, abs=1e-9)
    assert action.repairs == (f"box {CLAMPED}",)


def test_a_point_a_little_over_the_edge_is_moved_inside() -> None:
    action = _parse(box=None, point=[650, -9])
    assert (action.point, action.repairs) == ((639.0, 0.0), (f"point {CLAMPED}",))


@pytest.mark.parametrize("box", [[300, 20, 100, 200], [100, 200, 300, 20], [300, 200, 100, 20]])
def test_swapped_corners_are_put_in_order(box: Any) -> None:
    action = _parse(box=box)
    assert (action.box, action.repairs) == ((100, 20, 300, 200), (REORDERED,))
    action = _parse("yxyx_1000", box=box)
    assert action.repairs == (REORDERED,)


def test_all_repairs_are_named_in_order() -> None:
    value = {**REPLY, "label": "door", "box": [300, "20", 100, 485], "confidence": "0.5"}
    action = parse_vision_reply(f"Here: {json.dumps(value)}", REQUEST)
    assert (action.box, action.confidence) == ((100, 20, 300, 480), 0.5)
    assert action.repairs == (
        "text around the JSON object was ignored",
        'keys that are not asked for were ignored: "label"',
        'the text "20" was read as a number',
        'the text "0.5" was read as a number',
        f"box {CLAMPED}",
        REORDERED,
    )


def test_neither_keeps_the_repairs() -> None:
    action = _parse(box=None, label="x", reason="only a wall")
    assert action.repairs == ('keys that are not asked for were ignored: "label"',)


GRID = "on a grid from 0 to 1000 over the picture's width and height"


@pytest.mark.parametrize(
    ("space", "changes", "words"),
    [
        ("xyxy_1000", {"box": [0, 0, 1021, 500]}, f"[u_min, v_min, u_max, v_max] {GRID}."),
        ("xyxy_1000", {"box": [-21, 0, 100, 500]}, "box [-21, 0, 100, 500] is outside"),
        ("yxyx_1000", {"box": [0, 0, 2000, 500]}, f"[v_min, u_min, v_max, u_max] {GRID}."),
        ("xyxy_1000", {"box": [5, 5, 8, 8]}, f"{GRID} and cover at least 53 square units."),
        ("yxyx_1000", {"box": None, "point": [1100, 5]}, f"it must be [v, u] {GRID}."),
        ("xyxy_resized", {"box": [0, 0, 700, 50]}, "which is 644 wide and 476 high"),
        ("xyxy_resized", {"box": [0, 0, 3, 5]}, "at least 16 square pixels"),
    ],
)
def test_errors_speak_in_the_space_of_the_model(space: str, changes: Any, words: str) -> None:
    with pytest.raises(ReplyFormatError) as error:
        _parse(space, **changes)
    assert words in str(error.value)
    assert "640" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point": [1, 1]}, "both box and point"),
        ({"box": None}, "say why not"),
        ({"box": None, "reason": " "}, "say why not"),
        ({"box": [10, 20, 10, 220]}, "too small"),
        ({"box": [10, 20, 13.9, 24]}, "cover at least 16 square pixels"),
        ({"box": [630, 20, 652, 20.5]}, "cover at least 16 square pixels"),
        ({"box": [-50, -1, 700, 481]}, "box [-50, -1, 700, 481] is outside of the picture"),
        ({"box": [650, 20, 700, 220]}, "640 wide and 480 high"),
        ({"box": [-10, -9, -5, -1]}, "too small"),
        ({"box": [1e39, 0, 1, 1]}, "outside"),
        ({"box": [10, 20, 110]}, "box: list should have at least 4 items"),
        ({"box": [10, 20, 110, 220, 1]}, "box: list should have at most 4 items"),
        ({"box": [10, 20, 110, "far"]}, "box.#4"),
        ({"box": [10, 20, 110, "1e999"]}, "box.#4"),
        ({"box": [10, 20, 110, "NaN"]}, "box.#4"),
        ({"box": [10, 20, 110, ""]}, "box.#4"),
        ({"box": [10, 20, 110, "٣"]}, "box.#4"),
        ({"box": [10, 20, 110, True]}, "box.#4"),
        ({"box": None, "point": [653, 10]}, "point [653, 10] is outside of the picture; it must"),
        ({"box": None, "point": [10, -9.7]}, "which is 640 wide and 480 high"),
        ({"box": None, "point": [10]}, "point"),
        ({"target_desc": " "}, "target_desc is empty"),
        ({"target_desc": "x" * 121}, "at most 120 characters"),
        ({"confidence": 1.5}, "confidence"),
        ({"confidence": "1.5"}, "confidence"),
        ({"confidence": "high"}, "confidence"),
        ({"confidence": True}, "confidence"),
    ],
)
def test_what_cannot_be_used(changes: Any, words: str) -> None:
    with pytest.raises(ReplyFormatError) as error:
        _parse(**changes)
    assert words in str(error.value)


def test_a_language_request_is_a_bug() -> None:
    with pytest.raises(TypeError):
        parse_vision_reply("{}", MllmRequest(role="vision", variables=LanguageVariables()))


numbers = st.integers(-100, 1100) | st.floats(-1e4, 1e4) | st.floats(-30, 1030)


@given(st.sampled_from(sorted(BOX_SPACES)), st.lists(numbers, min_size=4, max_size=4))
@settings(derandomize=True, deadline=None, max_examples=200)
def test_an_accepted_box_lies_in_the_image(space: str, box: list[float]) -> None:
    try:
        action = _parse(space, box=box)
    except ReplyFormatError:
        return
    assert action.box is not None
    u_min, v_min, u_max, v_max = action.box
    assert 0 <= u_min < u_max <= 640
    assert 0 <= v_min < v_max <= 480
    assert (u_max - u_min) * (v_max - v_min) >= 16


@given(st.sampled_from(sorted(BOX_SPACES)), st.lists(numbers, min_size=2, max_size=2))
@settings(derandomize=True, deadline=None, max_examples=200)
def test_an_accepted_point_lies_on_a_pixel(space: str, point: list[float]) -> None:
    try:
        action = _parse(space, box=None, point=point)
    except ReplyFormatError:
        return
    assert action.point is not None
    assert 0 <= action.point[0] < 640
    assert 0 <= action.point[1] < 480


pixels_u, pixels_v = st.floats(0, 640), st.floats(0, 480)


@given(st.sampled_from(sorted(BOX_SPACES)), pixels_u, pixels_v, pixels_u, pixels_v)
@settings(derandomize=True, deadline=None, max_examples=200)
def test_a_box_written_in_any_space_is_read_back_without_repair(
    space: str, u0: float, v0: float, u1: float, v1: float
) -> None:
    box = (min(u0, u1), min(v0, v1), max(u0, u1), max(v0, v1))
    if (box[2] - box[0]) * (box[3] - box[1]) < 17:
        return
    written = BOX_SPACES[space].from_pixels_box(box, 640, 480)
    action = _parse(space, box=written)
    assert action.box == pytest.approx(box, abs=1e-9)
    assert action.repairs == ()


def test_schema() -> None:
    schema = reply_schema("ground")
    assert list(schema["properties"]) == schema["required"] == list(REPLY)
    assert schema["additionalProperties"] is False
