"""Distances over stairs against the closed form of a straight way."""

import itertools
import math

import pytest

from unilavira_drake.evaluation.scoring import in_room, make_goal_field, shortest_path
from unilavira_drake.evaluation.stair_ways import climb_length
from unilavira_drake.worlds.load import load_world

RADIUS = 0.36
HOUSE = load_world("two_storey")
STAIRS = HOUSE.stairs[0]


def way_over(stairs) -> float:
    corners = [*stairs.profile, (stairs.length, stairs.top)]
    return sum(math.dist(a, b) for a, b in itertools.pairwise(corners))


def test_the_length_of_the_stairs() -> None:
    assert climb_length(STAIRS, 0.0, STAIRS.length) == pytest.approx(way_over(STAIRS))
    assert climb_length(STAIRS, STAIRS.length, 0.0) == pytest.approx(way_over(STAIRS))
    assert climb_length(STAIRS, -1.0, STAIRS.length + 0.5) == pytest.approx(way_over(STAIRS) + 1.5)


@pytest.mark.parametrize("mirror", [False, True])
def test_straight_up_the_stairs(mirror: bool) -> None:
    world = load_world("two_storey", mirror=mirror)
    stairs = world.stairs[0]
    x, y = stairs.point(stairs.length + 1.0)
    sign = -1.0 if mirror else 1.0
    goal = make_goal_field(f"{x},{sign * y},2.8", world, radius=RADIUS)
    expected = way_over(stairs) + 1.0 + 1.2
    start = stairs.point(-1.2)
    assert shortest_path(goal, *start, 0.0) == pytest.approx(expected, abs=0.12)
    assert goal.distance(*start, 0.0) == pytest.approx(expected, rel=0.04, abs=0.12)
    # On the stairs the height tells the storey, and the way counts from there.
    middle = stairs.point(2.0)
    z = stairs.height(*middle)
    up = climb_length(stairs, 2.0, stairs.length) + 1.0
    assert goal.distance(*middle, z) == pytest.approx(up, abs=0.12)


def test_the_same_place_on_another_floor_is_far() -> None:
    goal = make_goal_field("bathtub_1", HOUSE, radius=RADIUS)
    x, y = 10.6, 3.4
    assert goal.distances(x, y, 2.8)[0] < 0.5
    assert goal.distances(x, y, 0.0)[0] > 15.0
    (target,) = goal.targets
    assert in_room(target, HOUSE, x, y, 2.8)
    assert not in_room(target, HOUSE, x, y, 0.0)


def test_every_room_is_reached_from_every_floor() -> None:
    for room in HOUSE.rooms:
        goal = make_goal_field(room.name, HOUSE, radius=RADIUS)
        assert math.isfinite(shortest_path(goal, 6.0, 1.4, 0.0)), room.name
        assert math.isfinite(shortest_path(goal, 6.0, 1.4, 2.8)), room.name
