"""The reference along a path in the air: on the path, within the limits, at rest at its end."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.flight_path_following import (
    CORNER,
    GATE,
    IN_LINE,
    NARROW_SPEED,
    NOSE_IN_LINE,
    corner_speed,
    follow,
    hold,
)

LIMITS = FlightLimits()
POINT = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.5, 4))


def flown(path, *, start=None, yaw=0.0, ticks=1500, backwards=False, narrow=()):
    """Rolls the reference out with an aircraft that is always where it should be."""
    path = np.array(path, float)
    gaps = np.isin(np.arange(len(path)), narrow)
    reference = np.array([*(path[0] if start is None else start), yaw, 0.0, 0.0, 0.0])
    rows, travelled = [reference], math.nan
    for _ in range(ticks):
        *moved, travelled = follow(
            path, gaps, reference, reference[:3], reference[3], travelled, backwards, 4.0, LIMITS
        )
        reference = np.array(moved)
        rows.append(reference)
        if np.allclose(reference[:3], path[-1], atol=1e-6) and not reference[4:].any():
            break
    return np.array(rows)


def distance_to(path, points):
    path = np.array(path, float)
    best = np.full(len(points), np.inf)
    for a, b in itertools.pairwise(path):
        step = b - a
        share = np.clip((points - a) @ step / max(step @ step, 1e-12), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - np.outer(share, step), axis=1))
    return best


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.lists(POINT, min_size=2, max_size=6))
def test_it_stays_on_the_path_and_within_its_limits_and_reaches_the_end(path):
    rows = flown(path)
    assert distance_to(path, rows[:, :3]).max() < 1e-6
    assert np.hypot(rows[:, 4], rows[:, 5]).max() <= LIMITS.max_speed + 1e-6
    assert rows[:, 6].max() <= LIMITS.max_climb_speed + 1e-6
    assert rows[:, 6].min() >= -LIMITS.max_descent_speed - 1e-6
    speed = np.linalg.norm(rows[:, 4:], axis=1)
    assert np.diff(speed).max() <= LIMITS.max_acceleration * LIMITS.period + 1e-9
    yaw_rate = np.abs(np.diff(rows[:, 3])) / LIMITS.period
    assert yaw_rate.max() <= LIMITS.max_yaw_rate + 1e-9
    np.testing.assert_allclose(rows[-1, :3], path[-1], atol=0.02)


def test_a_straight_way_takes_the_time_of_a_trapezoid():
    rows = flown([(0, 0, 1), (6, 0, 1)])
    a = 0.8 * LIMITS.max_acceleration
    expected = 6.0 / (0.9 * LIMITS.max_speed) + 0.9 * LIMITS.max_speed / a
    assert len(rows) * LIMITS.period == pytest.approx(expected, abs=0.5)


def test_the_speed_at_a_corner_is_that_of_an_arc_within_the_deviation():
    """The arc that touches both legs and passes the corner at CORNER: v^2 = a r."""
    for turn in (0.3, 1.0, 2.0, 3.0):
        before = np.array([1.0, 0.0, 0.0])
        after = np.array([math.cos(turn), math.sin(turn), 0.0])
        radius = CORNER / (1.0 / math.cos(turn / 2.0) - 1.0)
        assert corner_speed(before, after, 1.2) == pytest.approx(math.sqrt(1.2 * radius), rel=1e-6)


def test_it_slows_down_for_a_corner_it_cannot_yet_feel():
    rows = flown([(0, 0, 1), (4, 0, 1), (4, 4, 1)])
    at_corner = np.argmin(np.linalg.norm(rows[:, :3] - [4, 0, 1], axis=1))
    speed = np.linalg.norm(rows[:, 4:], axis=1)
    assert speed.max() > 0.88
    assert speed[at_corner] < 0.65


def test_it_turns_its_nose_before_it_flies_that_way():
    rows = flown([(0, 0, 1), (0, -5, 1)], yaw=1.5)
    first = np.argmax(np.linalg.norm(rows[:, 4:], axis=1) > 0.05)
    assert abs(rows[first, 3] + math.pi / 2) < 1.3
    assert rows[-1, 3] == pytest.approx(-math.pi / 2, abs=0.05)


def test_it_rises_on_the_spot_without_turning():
    rows = flown([(1, 1, 0.2), (1, 1, 3)], yaw=0.7)
    np.testing.assert_allclose(rows[:, 3], 0.7)


def test_it_goes_once_round_a_closed_path():
    path = [(0, 0, 1), (3, 0, 1), (3, 3, 1), (0, 3, 1), (0, 0, 1)]
    rows = flown(path)
    length = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1).sum()
    assert length == pytest.approx(12.0, abs=0.3)


def test_it_waits_for_an_aircraft_that_is_held_up():
    path = np.array([(0.0, 0, 1), (9.0, 0, 1)])
    reference, travelled = np.array([0.0, 0, 1, 0, 0, 0, 0]), math.nan
    for _ in range(400):
        hangs = (reference, np.array([0.0, 0, 1]), 0.0, travelled, False)
        *moved, travelled = follow(path, np.zeros(2, np.bool_), *hangs, 4.0, LIMITS)
        reference = np.array(moved)
    assert reference[0] <= 1.05
    assert abs(reference[4]) < 1e-3


def test_without_a_path_it_comes_to_rest_and_turns():
    reference = np.array([0.0, 0, 1, 0, 1.0, 0, 0])
    for _ in range(100):
        reference = hold(reference, 2.0, 4.0, LIMITS)
    assert reference[0] == pytest.approx(1.0 / (2 * 0.8 * 1.5), abs=0.05)
    assert reference[3] == pytest.approx(2.0, abs=1e-3)
    assert not reference[4:].any()


def test_backwards_is_the_same_way_at_once_with_the_nose_where_it_was():
    path = [(0, 0, 1), (-1, 0, 1), (-1.5, 0.5, 1.2)]
    back = flown(path, yaw=0.3, backwards=True)
    assert (back[:, 3] == 0.3).all()
    np.testing.assert_allclose(back[-1, :3], path[-1], atol=0.02)
    assert distance_to(path, back[:, :3]).max() < 1e-6
    assert len(back) < len(flown(path, yaw=0.3))


GAP = [(0.0, -2.0, 1.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0), (3.0, 3.0, 1.0)]
"""Its second segment is a gap."""


def test_in_a_gap_it_is_slow_and_its_nose_along_the_way():
    rows = flown(GAP, narrow=[1])
    inside = (rows[:, 0] > 2.0 + GATE) & (rows[:, 0] < 3.0) & (np.abs(rows[:, 1]) < 1e-9)
    assert inside.sum() > 50
    speed = np.linalg.norm(rows[:, 4:], axis=1)
    assert speed[inside].max() <= NARROW_SPEED + 1e-9
    assert np.abs(rows[inside, 3]).max() <= NOSE_IN_LINE
    assert speed[~inside].max() > 0.6
    np.testing.assert_allclose(rows[-1, :3], GAP[-1], atol=0.02)


@pytest.mark.parametrize(
    ("off", "yaw", "passes"), [((0, 0), 0.0, True), ((0, 0.1), 0.0, False), ((0, 0), 0.3, False)]
)
def test_before_a_gap_it_waits_until_the_aircraft_is_in_line(off, yaw, passes):
    path, narrow = np.array(GAP), np.array([False, True, False, False])
    reference, travelled = np.array([*GAP[0], 0.8, 0.0, 0.0, 0.0]), math.nan
    for _ in range(300):
        p_WB = reference[:3] + np.array([*off, 0.0])
        *moved, travelled = follow(
            path, narrow, reference, p_WB, yaw, travelled, False, 4.0, LIMITS
        )
        reference = np.array(moved)
    if passes:
        assert reference[0] > 2.9
    else:
        assert np.linalg.norm(reference[:3] - GAP[1]) < GATE
        assert reference[3] == pytest.approx(0.0, abs=0.02)


def test_its_nose_stays_along_a_gap_until_the_aircraft_is_out_of_it():
    path, narrow = np.array(GAP), np.array([False, True, False, False])
    reference, travelled = np.array([2.9, 0.0, 1.0, 0.0, 0.3, 0.0, 0.0]), math.nan
    behind = np.array([2.7, 0.0, 1.0])
    for _ in range(40):
        *moved, travelled = follow(
            path, narrow, reference, behind, 0.0, travelled, False, 4.0, LIMITS
        )
        reference = np.array(moved)
    assert reference[1] > 0.1
    assert reference[3] == 0.0


@pytest.mark.parametrize("leg", [0.0, 0.02, 0.1, 0.2])
@pytest.mark.parametrize("degrees", [0, 30, -60, 90])
def test_before_the_next_gap_too_it_waits_for_an_aircraft_that_lags(leg, degrees):
    """An airlock: two gaps, and between them less than the aircraft is behind."""
    turn = math.radians(degrees)
    way = np.array([math.cos(turn), math.sin(turn), 0.0])
    out = np.array([2.0, 0.0, 1.0])
    next_gap = out + np.array([leg, 0.0, 0.0])
    between = [next_gap] if leg else []
    path = np.array([(0, 0, 1), (1, 0, 1), out, *between, next_gap + way, next_gap + 3 * way])
    narrow = np.isin(np.arange(len(path)), [1, 2 + len(between)])
    reference, travelled = np.array([0.0, 0, 1, 0, 0, 0, 0]), math.nan
    p_WB, yaw = reference[:3], 0.0
    for _ in range(1500):
        *moved, travelled = follow(
            path, narrow, reference, p_WB, yaw, travelled, False, 4.0, LIMITS
        )
        reference = np.array(moved)
        if p_WB[0] < out[0] - GATE:
            assert reference[3] == pytest.approx(0.0, abs=1e-9)
        if 2.0 + leg + GATE < travelled < 2.0 + leg + 0.2:
            off = p_WB - next_gap
            assert off @ way > -GATE - leg
            assert np.linalg.norm(off - (off @ way) * way) < IN_LINE
            assert abs(yaw - turn) < NOSE_IN_LINE
        # It is half a second late.
        p_WB = p_WB + (reference[:3] - p_WB) * (LIMITS.period / 0.5)
        yaw += (reference[3] - yaw) * (LIMITS.period / 0.5)
    np.testing.assert_allclose(reference[:3], path[-1], atol=0.02)


@pytest.mark.parametrize("yaw", [0.03, math.pi - 0.03, -3.0])
def test_who_is_in_a_gap_leaves_it_as_its_nose_points(yaw):
    path = [(0.0, 0.0, 1.0), (0.6, 0.0, 1.0), (2.0, 1.5, 1.0)]
    rows = flown(path, yaw=yaw, narrow=[0])
    inside = rows[:, 0] < 0.6 - 1e-9
    turned = np.abs(np.arctan2(np.sin(rows[:, 3] - yaw), np.cos(rows[:, 3] - yaw)))
    assert turned[inside].max() < 0.2
    np.testing.assert_allclose(rows[-1, :3], path[-1], atol=0.02)
    assert math.cos(rows[-1, 3] - math.atan2(1.5, 1.4)) > 0.99
