"""Box conventions: known values, and the way there and back."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mllm.baselines import FrontierModel, RandomModel
from unilavira_drake.mllm.boxes import BOX_SPACES, MAX_PIXELS, MIN_PIXELS, PATCH, resized
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import MllmRequest, VisionVariables
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.vision.reply import parse_vision_reply

sides = st.integers(32, 4000)
shares = st.floats(0, 1)


@pytest.mark.parametrize(
    ("name", "box", "point"),
    [
        ("pixels", (64, 120, 320, 360), (480, 120)),
        ("xyxy_1000", (100, 250, 500, 750), (750, 250)),
        ("yxyx_1000", (250, 100, 750, 500), (250, 750)),
        ("xyxy_resized", (64.4, 119, 322, 357), (483, 119)),
    ],
)
def test_one_rectangle_in_each_space(name: str, box: object, point: object) -> None:
    space = BOX_SPACES[name]
    assert space.from_pixels_box((64, 120, 320, 360), 640, 480) == pytest.approx(box)
    assert space.from_pixels_point((480, 120), 640, 480) == pytest.approx(point)


@given(st.sampled_from(sorted(BOX_SPACES)), sides, sides, shares, shares, shares, shares)
@settings(derandomize=True, deadline=None, max_examples=200)
def test_there_and_back(
    name: str, width: int, height: int, u0: float, v0: float, u1: float, v1: float
) -> None:
    space = BOX_SPACES[name]
    box = (u0 * width, v0 * height, u1 * width, v1 * height)
    written = space.from_pixels_box(box, width, height)
    assert space.to_pixels_box(written, width, height) == pytest.approx(box, rel=1e-12, abs=1e-9)
    assert space.from_pixels_point(box[:2], width, height) == written[:2]
    assert space.to_pixels_point(written[2:], width, height) == pytest.approx(box[2:], abs=1e-9)
    if name == "pixels":
        assert written == box


@pytest.mark.parametrize(
    ("size", "seen"),
    [
        ((640, 480), (644, 476)),
        ((28, 28), (56, 56)),
        ((56, 56), (56, 56)),
        ((57, 83), (56, 84)),
        ((100, 30), (112, 28)),
        ((10, 10), (56, 56)),
        ((1920, 1080), (1316, 728)),
        ((4000, 4000), (980, 980)),
        ((5000, 20), (5012, 28)),
        ((200_000, 2_000), (9_996, 84)),
    ],
)
def test_the_size_at_which_a_picture_is_seen(size: tuple[int, int], seen: tuple[int, int]) -> None:
    assert resized(*size) == seen
    assert resized(*size[::-1]) == seen[::-1]


@given(sides, sides)
@settings(derandomize=True, deadline=None, max_examples=200)
def test_a_resized_picture_keeps_its_shape_and_the_limits(width: int, height: int) -> None:
    columns, rows = resized(width, height)
    assert columns % PATCH == rows % PATCH == 0
    assert MIN_PIXELS <= columns * rows <= MAX_PIXELS
    scale = min(1.0, math.sqrt(MAX_PIXELS / (width * height)))
    if width * height >= 2 * MIN_PIXELS:
        assert abs(columns - scale * width) <= PATCH
        assert abs(rows - scale * height) <= PATCH


def test_the_rule_states_the_grid_and_hides_the_pixels() -> None:
    rules = {name: space.rule(640, 480) for name, space in BOX_SPACES.items()}
    for name in ("xyxy_1000", "yxyx_1000"):
        assert "on a grid from 0 to 1000 over the picture's width and height" in rules[name]
        assert "640" not in rules[name]
        assert "480" not in rules[name]
    assert "which is 640 wide and 480 high" in rules["pixels"]
    assert "which is 644 wide and 476 high" in rules["xyxy_resized"]
    for name, rule in rules.items():
        first = "v" if name == "yxyx_1000" else "u"
        assert f"box is [{first}_min" in rule
        assert f"point is [{first}, " in rule


DOOR = Detection(
    id="front#1", category="sofa", color="red", box=(100.0, 150.0, 300.0, 400.0),
    point=(200.0, 300.0), pixels=45_000, distance=2.0, point_distance=2.0,
)  # fmt: skip
FLOOR = Detection(
    id="front#2", category="floor", room="kitchen", box=(0.0, 250.0, 640.0, 480.0),
    point=(320.0, 400.0), pixels=60_000, distance=2.0, point_distance=2.0,
)  # fmt: skip


@pytest.mark.parametrize("model", [RulesModel(), RandomModel(), FrontierModel()])
@pytest.mark.parametrize("order", ["the red sofa", "the kitchen"])
def test_the_models_inside_answer_in_the_space_asked_for(model: object, order: str) -> None:
    actions = {}
    for name in BOX_SPACES:
        request = MllmRequest(
            role="vision",
            n=3,
            call="ground",
            variables=VisionVariables(reasoning_action=order, box_space=name),
            evidence=(ViewEvidence("front", detections=(DOOR, FLOOR)),),
        )
        text = model.complete(request).text
        actions[name] = parse_vision_reply(text, request)
        if name != "pixels":
            inner = json.loads(text)
            outer = actions["pixels"]
            assert (inner["box"] or inner["point"]) != list(outer.box or outer.point)
    for action in actions.values():
        assert action.repairs == ()
        assert action.box == pytest.approx(actions["pixels"].box)
        assert action.point == pytest.approx(actions["pixels"].point)
    if isinstance(model, RulesModel) and order == "the red sofa":
        assert actions["pixels"].box == DOOR.box
