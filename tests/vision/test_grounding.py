"""When a mark is doubted, and what may take its place."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.messages import Candidate, Frame, Grounding, VisionAction
from unilavira_drake.messages.grounding import Box
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.vision.grounding import (
    CANDIDATES_KEPT,
    IT_IS_HERE,
    NOTHING_BETTER,
    NOTHING_FOUND,
    GroundingLimits,
    from_pictures,
    ground,
)

WIDTH, HEIGHT = 160, 120
HERE = (0.0, 0.0, 0.0)
LIMITS = GroundingLimits()
MARK = (60.0, 40.0, 100.0, 80.0)
ACTION = VisionAction(n=3, direction="front", box=MARK, target_desc="red sofa", confidence=0.2)


def frame(depth: float | np.ndarray = 3.0) -> Frame:
    """A level camera 1 m above the robot's middle, looking along +x."""
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    X_WC[:3, 3] = (0.0, 0.0, 1.0)
    return Frame(
        color=np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        depth=np.full((HEIGHT, WIDTH), depth, np.float32) if np.isscalar(depth) else depth,
        label=np.zeros((HEIGHT, WIDTH), np.int16),
        intrinsics=pinhole(WIDTH, HEIGHT, 79.0),
        X_WC=X_WC,
    )


def proposer(*candidates: Candidate) -> Callable[[Frame, str, Box], Sequence[Candidate]]:
    return lambda view, target, box: candidates


def never(*_: Any) -> Sequence[Candidate]:
    raise AssertionError("the grounder was asked")


def result(
    action: VisionAction, *candidates: Candidate, view: Frame | None = None, **limits: float
) -> Grounding:
    bounds = dataclasses.replace(LIMITS, **limits)
    return ground(action, view or frame(), HERE, proposer(*candidates), bounds)


@pytest.mark.parametrize("confidence", [None, 0.5, 1.0])
def test_a_mark_that_is_not_doubted_passes_unasked(confidence: float | None) -> None:
    action = dataclasses.replace(ACTION, confidence=confidence)
    assert ground(action, frame(), HERE, never, LIMITS) == Grounding(n=3, action=action)


@pytest.mark.parametrize(
    "action",
    [
        VisionAction(n=3, direction="front", reason="nothing serves", target_desc="red sofa"),
        VisionAction(n=3, direction="front", reason="unreadable", fallback=True),
        VisionAction(n=3, direction="front", box=MARK, confidence=0.1),
    ],
)
def test_without_a_mark_or_a_description_there_is_nothing_to_ask(action: VisionAction) -> None:
    assert ground(action, frame(), HERE, never, LIMITS) == Grounding(n=3, action=action)


def test_low_confidence_takes_the_surest_candidate_near_the_mark() -> None:
    close = Candidate((50, 40, 70, 60), 0.8)
    surest = Candidate((85, 45, 125, 75), 0.9)
    far_off = Candidate((0, 0, 20, 20), 1.0)
    found = result(ACTION, close, far_off, surest)
    assert (found.doubt, found.refined, found.reason) == ("low confidence", True, "")
    assert found.action == dataclasses.replace(ACTION, box=surest.box, confidence=0.9)
    assert found.candidates == (surest, far_off, close)


def test_equal_scores_are_settled_by_the_distance_to_the_mark() -> None:
    a, b = Candidate((50, 40, 60, 60)), Candidate((76, 52, 86, 70))
    assert result(ACTION, a, b).action.box == b.box
    assert result(ACTION, b, a).action.box == b.box


def test_a_candidate_with_a_pixel_of_its_own_becomes_a_point() -> None:
    found = result(ACTION, Candidate((60, 40, 100, 80), 1.0, (77, 66)))
    assert (found.action.box, found.action.point) == (None, (77.0, 66.0))


def test_a_point_is_searched_in_a_square_around_it() -> None:
    asked = []

    def propose(view: Frame, target: str, box: Box) -> Sequence[Candidate]:
        asked.append((target, box))
        return [Candidate((80, 60, 100, 80))]

    action = dataclasses.replace(ACTION, box=None, point=(80.0, 60.0))
    assert ground(action, frame(), HERE, propose, LIMITS).refined
    assert asked == [("red sofa", (60.0, 40.0, 100.0, 80.0))]


@pytest.mark.parametrize(
    ("candidates", "reason"),
    [
        ((), NOTHING_FOUND),
        ((Candidate((200, 200, 260, 260)),), NOTHING_FOUND),
        ((Candidate((60, 40, 100, 80), 0.49),), NOTHING_BETTER),
        ((Candidate((0, 0, 20, 20), 1.0),), NOTHING_BETTER),
    ],
)
def test_otherwise_the_models_own_mark_stays(candidates: Any, reason: str) -> None:
    found = result(ACTION, *candidates)
    assert (found.action, found.refined, found.reason) == (ACTION, False, reason)


@pytest.mark.parametrize("depth", [0.0, math.inf, 12.0, 0.5])
def test_no_candidate_without_a_place_to_go_to_is_taken(depth: float) -> None:
    found = result(ACTION, Candidate((70, 50, 90, 70)), view=frame(depth))
    assert (found.refined, found.reason) == (False, NOTHING_BETTER)


def hallway() -> np.ndarray:
    """Depths from 1 m at the lower edge to 9 m at the upper one."""
    return np.repeat(np.linspace(9.0, 1.0, HEIGHT, dtype=np.float32)[:, None], WIDTH, axis=1)


LARGE = VisionAction(
    n=4, direction="front", box=(5.0, 5.0, 155.0, 118.0), target_desc="hallway", confidence=0.9
)


def test_a_large_box_without_one_depth_is_a_region() -> None:
    point = Candidate((0, 60, 160, 120), 1.0, (80, 70))
    found = result(LARGE, point, view=frame(hallway()))
    assert (found.doubt, found.refined, found.action.point) == ("large region", True, (80.0, 70.0))


def test_a_large_thing_from_near_is_no_region() -> None:
    assert ground(LARGE, frame(1.5), HERE, never, LIMITS).doubt == ""


def test_a_region_does_not_take_the_place_of_a_region() -> None:
    found = result(LARGE, Candidate((0, 0, 160, 120)), view=frame(hallway()))
    assert (found.doubt, found.refined) == ("large region", False)
    assert result(LARGE, Candidate((60, 40, 90, 60)), view=frame(hallway())).refined


def near_and_far() -> np.ndarray:
    """The left half 0.5 m away, the right half 4 m."""
    depth = np.full((HEIGHT, WIDTH), 4.0, np.float32)
    depth[:, : WIDTH // 2] = 0.5
    return depth


CLOSE = VisionAction(
    n=5, direction="front", point=(60.0, 60.0), target_desc="white door", confidence=1.0
)
FAR_DOOR = Candidate((120, 30, 150, 90))


def test_a_mark_at_the_robots_feet_goes_to_what_was_described() -> None:
    found = result(CLOSE, FAR_DOOR, view=frame(near_and_far()))
    assert (found.doubt, found.refined, found.action.box) == ("too close", True, FAR_DOOR.box)


def test_a_mark_on_the_target_itself_stays_however_close() -> None:
    here = Candidate((50, 30, 75, 90), 0.3)
    found = result(CLOSE, FAR_DOOR, here, view=frame(near_and_far()))
    assert (found.action, found.reason) == (CLOSE, IT_IS_HERE)


def test_another_thing_that_is_close_too_is_not_taken() -> None:
    beside = Candidate((10, 30, 30, 90))
    found = result(CLOSE, beside, view=frame(near_and_far()))
    assert (found.refined, found.reason) == (False, NOTHING_BETTER)


def test_close_means_along_the_floor_from_the_robot() -> None:
    view = frame(1.0)
    assert ground(CLOSE, view, (0.5, 0.0, 0.0), proposer(), LIMITS).doubt == "too close"
    assert ground(CLOSE, view, (0.0, 0.0, 0.0), proposer(), LIMITS).doubt == ""
    assert result(CLOSE, view=view, nearest=2.0).doubt == "too close"


def test_bounds_can_be_chosen() -> None:
    assert result(ACTION, confidence=0.1).doubt == ""
    assert result(dataclasses.replace(ACTION, confidence=0.7), confidence=0.8).doubt != ""
    assert result(LARGE, view=frame(hallway()), region=0.95).doubt == ""


def test_only_the_best_candidates_are_kept() -> None:
    many = [Candidate((60, 40, 70 + i, 80), 0.5 + i / 100) for i in range(20)]
    found = result(ACTION, *many)
    assert len(found.candidates) == CANDIDATES_KEPT
    assert found.candidates[0] == many[-1]


def test_a_chosen_candidate_is_always_among_those_kept() -> None:
    surer = [Candidate((0, 0, 5 + i, 5), 0.9) for i in range(20)]
    chosen = Candidate((70, 50, 90, 70), 0.6)
    found = result(ACTION, *surer, chosen)
    assert found.refined
    assert found.candidates[0] == chosen
    assert len(found.candidates) == CANDIDATES_KEPT


boxes = st.tuples(*[st.floats(-20, 180)] * 4).filter(lambda b: b[0] < b[2] and b[1] < b[3])


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(st.tuples(boxes, st.floats(0, 1)), max_size=6), st.permutations(range(6)))
def test_the_order_of_the_candidates_does_not_matter(
    given_: list[tuple[Box, float]], order: list[int]
) -> None:
    candidates = [Candidate(box, score) for box, score in given_]
    shuffled = [candidates[i] for i in order if i < len(candidates)]
    found = result(ACTION, *candidates)
    assert result(ACTION, *shuffled) == found
    if found.refined:
        u_min, v_min, u_max, v_max = found.action.box or (0, 0, 0, 0)
        assert 0 <= u_min < u_max <= WIDTH
        assert 0 <= v_min < v_max <= HEIGHT
        assert (found.action.confidence or 0) >= LIMITS.confidence


def test_a_detector_gets_the_pictures_and_nothing_else() -> None:
    def detect(*given_: Any) -> Sequence[Candidate]:
        color, depth, target, box = given_
        assert color.shape == (HEIGHT, WIDTH, 3)
        assert depth.shape == (HEIGHT, WIDTH)
        assert (target, box) == ("red sofa", MARK)
        return [Candidate((70, 50, 90, 70))]

    assert ground(ACTION, frame(), HERE, from_pictures(detect), LIMITS).refined


@pytest.mark.parametrize(
    "wrong",
    [
        {"box": (10, 10, 10, 20)},
        {"box": (0, 0, math.nan, 3)},
        {"score": 1.5},
        {"score": math.nan},
        {"point": (math.inf, 0)},
    ],
)
def test_a_candidate_that_makes_no_sense_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="candidate"):
        Candidate(**wrong)


def test_a_candidate_may_be_written_in_numpys_numbers() -> None:
    candidate = Candidate(tuple(np.array([1, 2, 3, 4])), np.float32(0.5), tuple(np.array([2, 3])))
    numbers = (*candidate.box, candidate.score, *(candidate.point or ()))
    assert all(type(number) is float for number in numbers)
