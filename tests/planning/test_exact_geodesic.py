"""The exact shortest way of the benchmark, and how near to it our paths come."""

import importlib.util
import itertools
import math
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.planning.navigation_grid import make_navigation_grid
from unilavira_drake.planning.polyline import extract_path, length

PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)
SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "planning_peers.py"


def load_peers():
    # Under its own name: numba's cache on disk tells the benchmark which module to import.
    spec = importlib.util.spec_from_file_location(SOURCE.stem, SOURCE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


peers = load_peers()
UNIT = peers.UNIT


def boxes(*rectangles, size=30):
    blocked = np.zeros((size, size), bool)
    for x0, y0, x1, y1 in rectangles:
        blocked[y0:y1, x0:x1] = True
    return blocked


def along(*points):
    return sum(math.dist(a, b) for a, b in itertools.pairwise(points))


def test_open_floor_is_crossed_in_a_straight_line():
    found = peers.exact_geodesic(boxes(), (2.5, 3.125), (27.875, 20.5))
    assert found == pytest.approx(math.dist((2.5, 3.125), (27.875, 20.5)), rel=1e-12)


@pytest.mark.parametrize(
    ("start", "goal", "corners"),
    [
        ((5.5, 15.5), (15.5, 5.5), [(10, 10)]),
        ((5.5, 12.5), (25.5, 12.5), [(10, 10), (20, 10)]),
        ((8.125, 17.5), (22.5, 18.5), [(10, 20), (20, 20)]),
        ((10.5, 9.5), (19.5, 9.5), []),
        ((5.5, 5.5), (14.5, 9.5), []),  # over no corner
        ((5.5, 14.5), (14.5, 5.5), [(10, 10)]),  # exactly through it
    ],
)
def test_the_way_round_one_box(start, goal, corners):
    blocked = boxes((10, 10, 20, 20))
    expected = along(start, *corners, goal)
    for transposed in (False, True):
        grid, a, b = (blocked.T, start[::-1], goal[::-1]) if transposed else (blocked, start, goal)
        assert peers.exact_geodesic(grid, a, b) == pytest.approx(expected, rel=1e-12)
        assert peers.exact_geodesic(grid, b, a) == pytest.approx(expected, rel=1e-12)
        assert peers.exact_geodesic(grid, a, b, expected) == pytest.approx(expected, rel=1e-12)


def test_the_way_between_two_boxes_bends_both_ways():
    # The first box hangs from above, the second stands below.
    blocked = boxes((8, 5, 12, 30), (18, 0, 22, 25))
    start, goal = (4.5, 20.5), (26.5, 10.5)
    expected = along(start, (8, 5), (12, 5), (18, 25), (22, 25), goal)
    assert peers.exact_geodesic(blocked, start, goal) == pytest.approx(expected, rel=1e-12)


def test_closed_walls_and_cells_that_meet_across_cannot_be_passed():
    blocked = boxes((10, 0, 11, 30))
    assert math.isinf(peers.exact_geodesic(blocked, (2.5, 2.5), (20.5, 2.5)))
    assert math.isinf(peers.exact_geodesic(np.eye(30, dtype=bool), (20.5, 2.5), (2.5, 20.5)))
    assert math.isinf(peers.exact_geodesic(np.eye(30, dtype=bool)[::-1], (2.5, 2.5), (28.5, 28.5)))


def sees_by_fractions(blocked, a, b):
    """Sight piece by piece: what lies beside the middle of each, and what joins it to the next."""

    def beside(value):
        whole = math.floor(value)
        return (whole - 1, whole) if value == whole else (whole,)

    def free_cells(t):
        x, y = (p + t * (q - p) for p, q in zip(a, b, strict=True))
        return {(i, j) for i in beside(y) for j in beside(x) if not blocked[i, j]}

    events = {Fraction(0), Fraction(1)}
    for p, q in zip(a, b, strict=True):
        lines = range(math.ceil(min(p, q)), math.floor(max(p, q)) + 1) if p != q else ()
        events |= {Fraction(line - p) / Fraction(q - p) for line in lines}
    events = sorted(events)
    pieces = [free_cells((s + t) / 2) for s, t in itertools.pairwise(events)]
    if not all(pieces):
        return False
    for t, before, after in zip(events[1:-1], pieces, pieces[1:], strict=False):
        around, joined = free_cells(t), set(before)
        for _ in range(3):
            joined |= {
                (i, j)
                for i, j in around
                if {(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)} & joined
            }
        if not joined & after:
            return False
    return True


def random_cells(rng, size=7, share=0.3):
    blocked = np.ones((size + 2, size + 2), bool)
    blocked[1:-1, 1:-1] = rng.random((size, size)) < share
    return blocked


@PROPERTY
@given(st.integers(0, 2**31))
def test_sight_is_that_of_exact_fractions(seed):
    rng = np.random.default_rng(seed)
    blocked = random_cells(rng)
    for _ in range(40):
        # Corners of cells, their sides and their insides.
        step = int(rng.choice((1, 4, 8)))
        a, b = (rng.integers(UNIT // step, 8 * UNIT // step + 1, (2, 2)) * step).tolist()
        if a == b:
            continue
        expected = sees_by_fractions(blocked, *([Fraction(v, UNIT) for v in p] for p in (a, b)))
        assert peers.sees(blocked, *a, *b) == expected, (a, b)
        assert peers.sees(blocked, *b, *a) == expected, (b, a)


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.integers(0, 2**31))
def test_the_shortest_way_is_that_over_all_corners(seed):
    rng = np.random.default_rng(seed)
    blocked = random_cells(rng, size=6)
    free = np.argwhere(~blocked)
    if len(free) < 2:
        return
    ends = [
        tuple(
            Fraction(int(8 * v + w), 8)
            for v, w in zip(cell[::-1], rng.integers(1, 8, 2), strict=True)
        )
        for cell in free[rng.choice(len(free), 2, replace=False)]
    ]
    places = ends + [
        (Fraction(x), Fraction(y))
        for x, y in itertools.product(range(1, 8), repeat=2)
        # Where two cells meet across, there are two places in one.
        if not (blocked[y - 1, x - 1] == blocked[y, x] != blocked[y, x - 1] == blocked[y - 1, x])
    ]
    graph = np.zeros((len(places), len(places)))
    for (m, a), (n, b) in itertools.combinations(enumerate(places), 2):
        if sees_by_fractions(blocked, a, b):
            graph[m, n] = math.dist(a, b)
    expected = dijkstra(graph, directed=False, indices=0)[1]
    start, goal = (tuple(map(float, end)) for end in ends)
    assert peers.exact_geodesic(blocked, start, goal) == pytest.approx(expected, rel=1e-12)


def entered(blocked, a, b):
    """Whether a segment meets the inside of a blocked cell, by separating axes; whole numbers."""
    rows, columns = np.nonzero(blocked)
    (x0, y0), (x1, y1) = (np.round(p * UNIT).astype(np.int64) for p in (a, b))
    left, low = columns * UNIT, rows * UNIT
    apart = (left >= max(x0, x1)) | (left + UNIT <= min(x0, x1))
    apart |= (low >= max(y0, y1)) | (low + UNIT <= min(y0, y1))
    sides = [
        (x1 - x0) * (low + dy - y0) - (y1 - y0) * (left + dx - x0)
        for dx, dy in itertools.product((0, UNIT), repeat=2)
    ]
    apart |= (np.min(sides, axis=0) >= 0) | (np.max(sides, axis=0) <= 0)
    return not apart.all()


def test_paths_are_nearly_shortest_and_enter_no_blocked_cell():
    excess = []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        taken = peers.floor_plan(seed, 240)
        occupancy = OccupancyMap(n=1, version=1, log_odds=np.where(taken, 20, -20).astype(np.int8))
        grid = make_navigation_grid(
            occupancy, position=(-0.9, -0.9), targets=(), radius=0.36, turning_radius=0.5
        )
        free = np.argwhere(~grid.blocked & (grid.log_odds < 0))
        cell = free[rng.integers(len(free))]
        for slowness in (np.ones(grid.blocked.shape, np.float32), grid.slowness):
            times = distance_field(grid.blocked, cell[None], slowness=slowness)
            reached = np.argwhere(np.isfinite(times) & (grid.log_odds < 0))
            row, column = reached[rng.integers(len(reached))] + rng.integers(1, UNIT, 2) / UNIT
            start, goal = (column, row), (cell[1] + 0.5, cell[0] + 0.5)
            points = extract_path(times, grid.blocked, slowness, start)
            assert not any(entered(grid.blocked, a, b) for a, b in itertools.pairwise(points))
            assert peers.blocked_hops(grid.blocked, points) == 0
            if slowness is not grid.slowness and math.dist(start, goal) > 20:
                exact = peers.exact_geodesic(grid.blocked, start, goal)
                excess.append(length(points) / exact - 1.0)
    assert len(excess) > 15
    assert min(excess) >= -1e-9
    assert max(excess) <= 0.03
    assert np.mean(excess) <= 0.01
