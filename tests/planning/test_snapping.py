import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning.navigation_grid import make_navigation_grid
from unilavira_drake.planning.snapping import BESIDE, TIGHT, UNREACHABLE, snap

RADIUS, TURNING = 0.3, 0.4


def room(boxes=(), size=(6.0, 4.0), unknown=()):
    """A walled room of free cells with occupied boxes, (x0, y0, x1, y1) in metres."""
    log_odds = np.full((round(size[1] / 0.05), round(size[0] / 0.05)), -20, np.int8)
    log_odds[[0, 1, -2, -1]] = 20
    log_odds[:, [0, 1, -2, -1]] = 20
    for value, areas in ((0, unknown), (20, boxes)):
        for x0, y0, x1, y1 in areas:
            rows = slice(round(y0 / 0.05), round(y1 / 0.05))
            log_odds[rows, round(x0 / 0.05) : round(x1 / 0.05)] = value
    return OccupancyMap(n=1, version=1, log_odds=log_odds)


def snapped(occupancy, target, position, viewpoint=None, max_distance=1.5):
    grid = make_navigation_grid(
        occupancy,
        position=position,
        targets=(target,),
        radius=RADIUS,
        turning_radius=TURNING,
    )
    found = snap(
        grid,
        grid.reachable(grid.cell(*position)),
        target=target,
        position=position,
        viewpoint=viewpoint or position,
        max_distance=max_distance,
        turning_radius=TURNING,
    )
    return found, grid, None if found.cell is None else grid.center(found.cell)


def test_open_floor_is_its_own_goal():
    found, _, center = snapped(room(), (4.0, 2.0), (1.0, 2.0))
    assert math.dist(center, (4.0, 2.0)) < 0.04
    assert found.reason == ""


def test_a_thing_is_approached_from_the_side_that_was_seen():
    shelf = (2.9, 0.0, 3.1, 4.0 - 1.2)
    for position in ((1.0, 1.0), (5.0, 1.0)):
        front = 2.9 if position[0] < 3 else 3.1
        _, _, center = snapped(room((shelf,)), (front, 1.0), position)
        assert center[1] == pytest.approx(1.0, abs=0.06)
        assert abs(center[0] - front) == pytest.approx(TURNING, abs=0.08)
        assert (center[0] < 3) == (position[0] < 3)


def test_the_seen_side_is_kept_when_the_other_side_is_nearer():
    wall = (2.9, 0.0, 3.0, 4.0 - 1.2)
    clutter = (2.0, 0.4, 2.7, 1.2)
    _, _, center = snapped(room((wall, clutter)), (2.9, 1.0), (2.2, 3.0))
    assert center[0] < 2.9
    assert math.dist(center, (2.9, 1.0)) > 0.7  # across the wall it would be 0.5 m


def test_room_to_turn_is_preferred_and_a_place_to_get_stuck_refused():
    # A passage 0.7 m wide holds the robot but does not let it turn.
    passage = ((2.5, 0.0, 3.5, 1.65), (2.5, 2.35, 3.5, 4.0))
    found, grid, center = snapped(room(passage), (3.0, 2.0), (1.0, 2.0))
    assert grid.clearance[found.cell] >= TURNING
    assert center[0] < 2.5
    found, _, _ = snapped(room(passage), (3.0, 2.0), (1.0, 2.0), max_distance=0.4)
    assert found.cell is None
    # One of 0.8 m just does.
    passage = ((2.5, 0.0, 3.5, 1.6), (2.5, 2.4, 3.5, 4.0))
    found, grid, center = snapped(room(passage), (3.0, 2.0), (1.0, 2.0), max_distance=0.4)
    assert TIGHT * TURNING <= grid.clearance[found.cell] < TURNING
    assert math.dist(center, (3.0, 2.0)) < 0.06


def test_a_closed_place_is_unreachable():
    closed = ((2.0, 0.0, 2.1, 4.0),)
    occupancy = room(closed, size=(6.0, 4.0))
    found, _, _ = snapped(occupancy, (4.0, 2.0), (1.0, 2.0))
    assert found.reason == UNREACHABLE


def test_a_solid_place_has_no_free_space():
    found, _, _ = snapped(room(((2.2, 0.0, 6.0, 4.0),)), (4.2, 2.0), (1.0, 2.0))
    assert found.reason == "no free space within 1.5 m"


def test_the_goal_is_never_the_robot_itself_unless_it_is_beside_the_target():
    wall = (2.6, 0.0, 2.7, 4.0)
    position = (2.2, 2.0)  # already as near as it can be
    found, _, center = snapped(room((wall,)), (3.2, 2.0), position)
    assert found.cell is None or math.dist(center, position) >= BESIDE - 0.04
    _, _, center = snapped(room((wall,)), (2.6, 2.0), position)
    assert math.dist(center, position) < 0.1


def test_a_target_beyond_the_mapped_range_leads_into_the_unknown():
    occupancy = room(unknown=((3.0, 0.1, 5.9, 3.9),))
    found, grid, center = snapped(occupancy, (5.5, 2.0), (1.0, 2.0))
    assert grid.log_odds[found.cell] == 0
    assert center[0] <= 5.5
    assert math.dist(center, (5.5, 2.0)) < 0.1
    near, grid, _ = snapped(occupancy, (3.6, 2.0), (1.0, 2.0))
    assert grid.log_odds[near.cell] < 0  # known floor is near enough


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 2**31))
def test_a_snapped_goal_keeps_every_promise(seed):
    rng = np.random.default_rng(seed)
    boxes = [
        (x, y, x + w, y + h) for x, y, w, h in rng.uniform((0, 0, 0.1, 0.1), (5, 3, 1.5, 1), (5, 4))
    ]
    occupancy = room(boxes)
    position, target = rng.uniform((0.5, 0.5), (5.5, 3.5), (2, 2))
    found, grid, center = snapped(occupancy, tuple(target), tuple(position))
    reachable = grid.reachable(grid.cell(*position))
    if found.cell is None:
        assert found.reason
        return
    assert reachable[found.cell]
    assert not grid.blocked[found.cell]
    assert math.dist(center, target) <= 1.5 + 1e-9
    if math.dist(position, target) > TURNING + BESIDE:
        assert math.dist(center, position) >= BESIDE - 1e-9
