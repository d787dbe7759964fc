"""The aircraft seen from above: its width beside a way, what it meets when it turns, and gaps."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_flight_governor import RADIUS, SIZE, STANDOFF, Bench

from unilavira_drake.messages.voxels import TILE
from unilavira_drake.robots.flight_footprint import half_width, overlaps, turn_meets
from unilavira_drake.robots.flight_governor import width_between

SIDE = st.floats(0.1, 1.0)
ANGLE = st.floats(-7.0, 7.0)
PLACE = st.floats(-0.8, 0.8)


def corners_of(size, yaw):
    x, y = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]).T * 0.5
    x, y = x * size[0], y * size[1]
    return np.array([x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)])


@settings(derandomize=True, deadline=None, max_examples=50)
@given(SIDE, SIDE, ANGLE, ANGLE, st.floats(-2.0, 2.0))
def test_its_width_is_that_of_its_corners_across_the_way(length, width, yaw, way, rise):
    across = np.array([-math.sin(way), math.cos(way)])
    expected = np.abs(across @ corners_of((length, width), yaw)).max()
    direction = np.array([math.cos(way), math.sin(way), rise])
    direction /= np.linalg.norm(direction)
    assert half_width((length, width), yaw, direction) == pytest.approx(expected, abs=1e-9)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(SIDE, SIDE, ANGLE, st.floats(-3.0, 3.0), ANGLE)
def test_its_width_on_a_turn_is_the_greatest_on_the_way(length, width, yaw, turn, way):
    direction = np.array([math.cos(way), math.sin(way), 0.0])
    size, between = (length, width), yaw + np.linspace(0.0, turn, 2001)
    expected = max(half_width(size, angle, direction) for angle in between)
    for after in (yaw + turn, yaw + turn - 2.0 * math.pi):
        assert width_between(size, (yaw, after), direction) == pytest.approx(expected, abs=1e-5)
    assert width_between(size, (yaw, math.nan), direction) == half_width(size, yaw, direction)


def test_a_climb_needs_room_for_the_corners():
    assert half_width(SIZE, 0.3, np.array([0.0, 0.0, 1.0])) == pytest.approx(RADIUS)


def grid(half_x, half_y):
    x, y = np.meshgrid(np.linspace(-half_x, half_x, 41), np.linspace(-half_y, half_y, 41))
    return np.stack((x.ravel(), y.ravel()))


@settings(derandomize=True, deadline=None, max_examples=50)
@given(SIDE, SIDE, ANGLE, PLACE, PLACE, st.floats(0.02, 0.3))
def test_an_overlap_is_one_of_points(length, width, yaw, x, y, half):
    """Points of either that are in the other; what only just touches may count or not."""
    c, s = math.cos(yaw), math.sin(yaw)
    square = grid(half, half) + np.array([[x], [y]])
    body = np.array([[c, -s], [s, c]]) @ grid(0.5 * length, 0.5 * width)
    square_B = np.array([[c, s], [-s, c]]) @ square
    limit = [[0.5 * length], [0.5 * width]]

    def meets(slack):
        in_body = (np.abs(square_B) < np.array(limit) + slack).all(axis=0)
        in_square = (np.abs(body - [[x], [y]]) < half + slack).all(axis=0)
        return bool(in_body.any() or in_square.any())

    found = overlaps((length, width), yaw, x, y, half)
    assert found or not meets(0.0)
    assert not found or meets(0.03)


def met(cell, yaw, turned, p=(1.6, 1.6, 1.6)):
    window = np.zeros((TILE, TILE, TILE), np.int8)
    window[cell] = 20
    bounds = np.array([0, 0, 0, TILE, TILE, TILE])
    return turn_meets(window, (0, 0, 0), bounds, 0.1, np.array(p), yaw, turned, SIZE)


def test_a_turn_meets_what_its_corners_reach_and_no_more():
    beside, corner, above = (18, 15, 15), (17, 17, 15), (18, 15, 18)
    assert met(beside, 0.0, math.pi / 4)
    assert not met(beside, math.pi / 4, 0.0)
    assert not met(beside, 0.0, math.pi / 2)
    # What the corner is in already, and what is above it, is no reason not to turn.
    assert not met(corner, 0.0, math.pi / 4)
    assert not met(above, 0.0, math.pi / 4)


MIDDLE = 0.05


def gap(x=1.0, half=8):
    """Voxels of a wall of 0.2 m with a gap of 0.5 m around y = 0.05."""
    free = range(-2, 3)
    columns = [j for j in range(-half, half) if j not in free]
    return [(round(x / 0.1) + i, j, k) for i in range(2) for j in columns for k in range(2, 20)]


@pytest.mark.parametrize("degrees", [0, 90, -180, 3])
def test_it_lets_an_aircraft_through_a_gap_in_line_with_it(degrees):
    yaw = math.radians(degrees)
    bench = Bench(gap(), start=(0.0, MIDDLE, 1.0), yaw=yaw)
    rows = bench.chase((3.0, MIDDLE, 1.0), ticks=200, yaw=yaw)
    assert rows[-1, 0] == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize(("degrees", "beside"), [(45, 0.0), (-20, 0.0), (110, 0.0), (0, 0.07)])
def test_but_not_askew_nor_beside_the_middle(degrees, beside):
    yaw, y = math.radians(degrees), MIDDLE + beside
    bench = Bench(gap(), start=(0.0, y, 1.0), yaw=yaw)
    rows = bench.chase((3.0, y, 1.0), ticks=200, yaw=yaw)
    assert rows[-1, 0] <= 1.0 - STANDOFF
    assert np.linalg.norm(rows[-1, 4:]) < 0.05


def test_nor_one_that_is_in_line_as_it_should_be_and_not_as_it_is():
    bench = Bench(gap(), start=(0.0, MIDDLE, 1.0))
    bench.tick([0, MIDDLE, 1, 0, 0, 0, 0])
    bench.yaw = math.radians(30)
    rows = bench.chase((3.0, MIDDLE, 1.0), ticks=200)
    assert rows[-1, 0] <= 1.0 - STANDOFF


def test_nor_one_that_still_turns_from_askew_to_in_line():
    """Across the way it is as wide at both yaws as the gap lets through, and wider between."""
    bench = Bench(gap(), start=(0.0, MIDDLE, 1.0))
    bench.tick([0, MIDDLE, 1, 0, 0, 0, 0])
    bench.yaw = math.radians(90)
    rows = bench.chase((3.0, MIDDLE, 1.0), ticks=200)
    assert rows[-1, 0] <= 1.0 - STANDOFF


def test_in_a_gap_it_does_not_turn_and_behind_it_it_does():
    bench = Bench(gap(), start=(1.1, MIDDLE, 1.0))
    bench.tick([1.1, MIDDLE, 1.0, 0, 0, 0, 0])
    rows = np.array([bench.tick([1.1, MIDDLE, 1.0, 0.8, 0, 0, 0]) for _ in range(60)])
    assert 0.1 < rows[-1, 3] < 0.5
    bench.chase((2.0, MIDDLE, 1.0), ticks=100)
    rows = bench.chase((2.0, MIDDLE, 1.0), ticks=60, yaw=0.8)
    assert rows[-1, 3] == pytest.approx(0.8)


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.floats(-0.5, 0.5), st.floats(-1.6, 1.6), st.floats(-1.0, 1.0))
def test_whatever_is_asked_for_no_corner_of_the_setpoint_is_in_the_wall(start, yaw, aim):
    voxels = gap()
    bench = Bench(voxels, start=(0.0, start, 1.0), yaw=yaw)
    rows = bench.chase((2.5, aim, 1.0), ticks=150, yaw=yaw + 0.7)
    places = {(i, j) for i, j, _ in voxels}
    for row in rows:
        for x, y in (corners_of(SIZE, row[3]) + row[:2, None]).T:
            assert (math.floor(x / 0.1), math.floor(y / 0.1)) not in places
