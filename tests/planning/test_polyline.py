import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.planning.polyline import (
    extract_path,
    final_heading,
    length,
    remaining_length,
    segment_cost,
)

PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)


def world(seed, rows=40, columns=50, boxes=14):
    rng = np.random.default_rng(seed)
    blocked = np.zeros((rows, columns), bool)
    for _ in range(boxes):
        i, j = rng.integers(0, rows), rng.integers(0, columns)
        h, w = rng.integers(1, 12, 2)
        blocked[i : i + h, j : j + w] = True
    free = np.argwhere(~blocked)
    return rng, blocked, free[rng.integers(len(free))], free[rng.integers(len(free))]


def touches(blocked, a, b):
    """Whether any of many samples of a segment lies inside a blocked cell."""
    t = np.linspace(0, 1, 2000)[:, None]
    points = a + t * (b - a)
    off_border = np.all(np.abs(points - np.round(points)) > 1e-7, axis=1)
    cells = np.floor(points[off_border]).astype(int)
    return bool(blocked[cells[:, 1], cells[:, 0]].any())


@PROPERTY
@given(st.integers(0, 2**31), st.booleans())
def test_a_path_keeps_off_blocked_cells_and_is_nearly_shortest(seed, weighted):
    rng, blocked, source, start = world(seed)
    slowness = np.ones(blocked.shape, np.float32)
    if weighted:
        slowness = rng.uniform(1, 4, blocked.shape).astype(np.float32)
    times = distance_field(blocked, source[None], slowness=slowness)
    begin = (start[1] + rng.uniform(), start[0] + rng.uniform())
    points = extract_path(times, blocked, slowness, begin)
    if not np.isfinite(times[tuple(start)]):
        assert len(points) == 0
        return
    np.testing.assert_array_equal(points[0], begin)
    np.testing.assert_array_equal(points[-1], (source[1] + 0.5, source[0] + 0.5))
    assert not any(touches(blocked, a, b) for a, b in itertools.pairwise(points))
    assert length(points) >= math.dist(points[0], points[-1]) - 1e-9
    cost = sum(segment_cost(blocked, slowness, *a, *b) for a, b in itertools.pairwise(points))
    assert cost <= 1.15 * times[tuple(start)] + 8.0


@PROPERTY
@given(st.integers(0, 2**31))
def test_unweighted_paths_are_not_longer_than_the_field(seed):
    _, blocked, source, start = world(seed)
    times = distance_field(blocked, source[None])
    value = times[tuple(start)]
    if np.isfinite(value):
        begin = (start[1] + 0.5, start[0] + 0.5)
        points = extract_path(times, blocked, np.ones(blocked.shape, np.float32), begin)
        assert length(points) <= value * 1.02 + 0.5


def test_open_floor_is_crossed_in_one_line():
    blocked = np.zeros((60, 80), bool)
    times = distance_field(blocked, np.array([[50, 70]]))
    points = extract_path(times, blocked, np.ones(blocked.shape, np.float32), (3.2, 4.7))
    np.testing.assert_array_equal(points, [(3.2, 4.7), (70.5, 50.5)])


def test_a_path_around_one_corner_has_the_closed_form_length():
    blocked = np.zeros((61, 61), bool)
    blocked[:31, 30] = True
    times = distance_field(blocked, np.array([[10, 50]]))
    points = extract_path(times, blocked, np.ones(blocked.shape, np.float32), (10.5, 10.5))
    exact = 2 * math.hypot(20, 21)
    assert exact - 0.8 <= length(points) <= 1.01 * exact + 0.5


@PROPERTY
@given(*[st.floats(0.01, 11.99)] * 4)
def test_the_cost_of_a_segment_is_the_integral_along_it(x0, y0, x1, y1):
    rng = np.random.default_rng(3)
    slowness = rng.uniform(1, 5, (12, 12)).astype(np.float32)
    cost = segment_cost(np.zeros((12, 12), bool), slowness, x0, y0, x1, y1)
    t = (np.arange(20000) + 0.5) / 20000
    cells = slowness[(y0 + t * (y1 - y0)).astype(int), (x0 + t * (x1 - x0)).astype(int)]
    assert cost == pytest.approx(cells.mean() * math.hypot(x1 - x0, y1 - y0), abs=0.01)


def test_a_segment_through_a_corner_touches_both_sides():
    slowness = np.ones((4, 4), np.float32)
    for cell in ((1, 2), (2, 1)):
        blocked = np.zeros((4, 4), bool)
        blocked[cell] = True
        assert math.isinf(segment_cost(blocked, slowness, 0.5, 0.5, 3.5, 3.5))
        assert math.isinf(segment_cost(blocked, slowness, 3.5, 3.5, 0.5, 0.5))


def test_outside_and_unreachable_starts_have_no_path():
    blocked = np.zeros((3, 5), bool)
    blocked[:, 2] = True
    times = distance_field(blocked, np.array([[1, 0]]))
    ones = np.ones(blocked.shape, np.float32)
    for start in ((4.5, 1.5), (-1.0, 1.0), (1.0, 7.0)):
        assert len(extract_path(times, blocked, ones, start)) == 0
    assert length(np.zeros((0, 2))) == length(np.zeros((1, 2))) == 0.0


def test_what_remains_of_a_path():
    points = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)])
    assert remaining_length(points, 0.0, 0.0) == pytest.approx(7.0)
    assert remaining_length(points, 1.0, 0.5) == pytest.approx(6.0 + 0.5)
    assert remaining_length(points, 4.0, 2.0) == pytest.approx(1.0)
    assert remaining_length(points, 4.0, 4.0) == pytest.approx(1.0)


def test_final_heading_looks_back_over_the_last_stretch():
    corner = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    assert final_heading(corner) == pytest.approx(math.pi / 2)
    hooked = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.05]])
    assert final_heading(hooked) == pytest.approx(math.atan2(0.05, 2.0))
    assert final_heading(np.array([[1.0, 1.0], [0.9, 1.0]])) == pytest.approx(math.pi)
