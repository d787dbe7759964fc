"""Goals in the air: off the things, off the ground, no farther than the plan horizon."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mapping.flight_goals import OPEN_SKY, FlightGoals
from unilavira_drake.mapping.goal_selector import select_goal
from unilavira_drake.mapping.projection import project_to_pixel
from unilavira_drake.messages import (
    DIRECTIONS,
    DOWN,
    VIEW_YAW,
    Frame,
    Goal,
    History,
    Intrinsics,
    LanguageAction,
    Panorama,
    VisionAction,
)

SIDE = 101
LENS = Intrinsics(SIDE, SIDE, 50.0, 50.0, 50.0, 50.0)
RULES = FlightGoals(stand_off=5.0, clearance=4.0, horizon=40.0)
RANGE = 60.0


def camera(view, position, yaw):
    heading = yaw + VIEW_YAW.get(view, 0.0)
    c, s = math.cos(heading), math.sin(heading)
    forward = np.array([0.0, 0.0, -1.0]) if view == DOWN else np.array([c, s, 0.0])
    right = np.array([s, -c, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    X_WC[:3, 3] = position
    return X_WC


def depth_of(X_WC, boxes):
    u, v = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    rays = np.stack(((u - 50.0) / 50.0, (v - 50.0) / 50.0, np.ones_like(u)), -1) @ X_WC[:3, :3].T
    rays = np.where(np.abs(rays) < 1e-9, 1e-9, rays)
    best = np.full((SIDE, SIDE), np.inf)
    for low, high in boxes:
        a, b = (np.array(low) - X_WC[:3, 3]) / rays, (np.array(high) - X_WC[:3, 3]) / rays
        near, far = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        best = np.where((near <= far) & (near > 0.0), np.minimum(best, near), best)
    return np.where(best <= RANGE, best, np.inf).astype(np.float32)


GROUND = ((-500.0, -500.0, -1.0), (500.0, 500.0, 0.0))
TOWER = ((30.0, -6.0, 0.0), (40.0, 6.0, 45.0))
CAR = ((20.0, 8.0, 0.0), (24.0, 10.0, 1.5))


def seen(position=(0.0, 0.0, 12.0), yaw=0.0, boxes=(GROUND, TOWER, CAR)):
    frames = []
    for view in (*DIRECTIONS, DOWN):
        X_WC = camera(view, position, yaw)
        depth = depth_of(X_WC, boxes)
        frames.append(Frame(view, depth=depth, intrinsics=LENS, X_WC=X_WC))
    c, s = math.cos(yaw), math.sin(yaw)
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[c, -s], [s, c]]
    X_WB[:3, 3] = position
    return Panorama(n=3, first=3, X_WB=X_WB, frames=tuple(frames))


def goal_at(panorama, p_W, view="front", climb=None):
    frame = panorama.frame(view)
    u, v, _ = project_to_pixel(p_W, intrinsics=LENS, X_WC=frame.X_WC)
    vision = VisionAction(3, view, point=(u, v), target_desc="it")
    return goal_of(panorama, LanguageAction(3, "decide", "turn", view, climb=climb), vision)


def goal_of(panorama, action, vision=VisionAction()):  # noqa: B008 (frozen)
    history = History(n=3)
    return select_goal(action, vision, history, panorama, max_range=RANGE, flight=RULES)


def test_what_lies_lower_is_flown_over_at_the_present_height():
    goal = goal_at(seen(), (22.0, 9.0, 1.5))
    assert goal.kind == "go"
    assert goal.p_WG == pytest.approx((22.0, 9.0, 12.0), abs=1.0)
    assert goal.p_WT == pytest.approx((22.0, 9.0, 1.5), abs=1.0)
    assert not goal.partial


@pytest.mark.parametrize("height", [3.0, 12.0, 20.0])
def test_before_a_wall_it_stops_and_rises_but_does_not_sink(height):
    goal = goal_at(seen(), (30.0, 0.0, height))
    assert goal.p_WG == pytest.approx((25.0, 0.0, max(height, 12.0)), abs=0.8)
    assert goal.p_WT[2] == pytest.approx(height, abs=0.8)


def test_a_mark_below_is_come_down_to_but_not_onto():
    goal = goal_at(seen((22.0, 9.0, 25.0)), (22.0, 9.0, 1.5), DOWN)
    assert goal.p_WG == pytest.approx((22.0, 9.0, 1.5 + RULES.clearance), abs=0.5)


@pytest.mark.parametrize(
    ("climb", "height"), [(10.0, 22.0), (0.0, 12.0), (-4.0, 8.0), (-50.0, 4.0), (25.0, 37.0)]
)
def test_a_height_that_is_asked_for_counts_down_to_the_clearance(climb, height):
    goal = goal_at(seen(), (0.0, 0.0, 0.0), DOWN, climb)
    assert goal.p_WG == pytest.approx((0.0, 0.0, height), abs=0.5)


def test_a_far_mark_is_flown_towards_as_far_as_one_move_goes():
    goal = goal_at(seen(boxes=(GROUND,)), (55.0, 10.0, 0.0))
    assert goal.partial
    assert math.dist(goal.p_WG, (0.0, 0.0, 12.0)) == pytest.approx(RULES.horizon)
    assert goal.p_WT == pytest.approx((55.0, 10.0, 0.0), abs=3.0)


@pytest.mark.parametrize("height", [-3.0, 0.0, 10.0])
def test_a_mark_beyond_the_range_is_flown_towards_at_the_present_height(height):
    goal = goal_at(seen(boxes=()), (100.0, 0.0, 12.0 + height))
    assert goal == Goal(3, "go", (40.0, 0.0, 12.0), pixel=goal.pixel, partial=True)


def test_the_sky_is_no_target():
    goal = goal_at(seen(boxes=()), (100.0, 0.0, 12.0 + 50.0))
    assert goal == Goal(3, "none", reason=f"no target: {OPEN_SKY}")


def test_a_view_in_which_nothing_was_marked_says_why():
    action = LanguageAction(3, "decide", "turn", "left")
    goal = goal_of(seen(), action, VisionAction(3, "left", reason="only houses"))
    assert goal == Goal(3, "none", reason="no target: only houses")


@pytest.mark.parametrize(
    ("bearing", "distance", "climb", "place"),
    [
        (0.0, 10.0, 0.0, (0.0, 10.0, 12.0)),
        (90.0, 20.0, 3.0, (-20.0, 0.0, 15.0)),
        (-90.0, 20.0, -3.0, (20.0, 0.0, 9.0)),
        (0.0, 0.0, 8.0, (0.0, 0.0, 20.0)),
        (0.0, 80.0, 0.0, (0.0, 40.0, 12.0)),
    ],
)
def test_a_flight_by_numbers_counts_from_the_front(bearing, distance, climb, place):
    action = LanguageAction(3, "decide", "fly", bearing=bearing, distance=distance, climb=climb)
    goal = goal_of(seen(yaw=math.pi / 2), action)
    assert goal.p_WG == pytest.approx(place, abs=1e-9)
    assert goal.partial is (distance > 40.0)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    st.sampled_from((*DIRECTIONS, DOWN)),
    st.floats(0.0, SIDE - 1.0),
    st.floats(0.0, SIDE - 1.0),
    st.none() | st.floats(-60.0, 60.0),
)
def test_no_goal_lies_in_the_ground_in_a_thing_or_beyond_the_horizon(view, u, v, climb):
    vision = VisionAction(3, view, point=(u, v), target_desc="it")
    goal = goal_of(PANORAMA, LanguageAction(3, "decide", "turn", view, climb=climb), vision)
    if goal.kind == "none":
        assert goal.reason.startswith("no target: ")
        return
    here = PANORAMA.position
    assert math.dist(goal.p_WG, here) <= RULES.horizon + 1e-6
    if climb is None or goal.p_WT is not None:
        assert goal.p_WG[2] >= min(RULES.clearance, here[2]) - 1.0
    for low, high in (TOWER, CAR):
        if climb is None:
            inside = all(a < p < b for p, a, b in zip(goal.p_WG, low, high, strict=True))
            assert not inside


PANORAMA = seen((3.0, 2.0, 12.0), 0.3)
