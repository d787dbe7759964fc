"""The kernels of flight planning: lines, costs and searches on small grids of bits."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.planning.visibility import route
from unilavira_drake.planning.visibility_any_angle import (
    FOUND,
    TOO_LARGE,
    UNREACHABLE,
    any_angle_path,
)
from unilavira_drake.planning.visibility_graph import corner_path
from unilavira_drake.planning.visibility_lines import (
    STRAIGHT,
    edge,
    edge_cost,
    path_cost,
    sees,
    slopes_of,
    unfold,
)
from unilavira_drake.planning.visibility_path import shorten
from unilavira_drake.planning.visibility_window import FlightWindow, reachable

ANY = slopes_of(math.pi / 2, math.pi / 2)
GENTLE = slopes_of(math.radians(30), math.radians(20))


def window_of(blocked):
    """The window of a bool array, within a blocked border; voxel (0, 0, 0) becomes (1, 1, 1)."""
    nx, ny, nz = blocked.shape
    dense = np.ones((nx + 2, ny + 2, -(-(nz + 2) // 32) * 32), bool)
    dense[1:-1, 1:-1, 1 : nz + 1] = blocked
    bits = dense.reshape(nx + 2, ny + 2, -1, 32).astype(np.uint64)
    words = (bits << np.arange(32, dtype=np.uint64)).sum(-1).astype(np.uint32)
    return FlightWindow((-1, -1, -1), 1.0, words), dense


def random_window(rng, share=0.15, shape=(14, 12, 40)):
    blocked = rng.random(shape) < share
    for _ in range(3):
        x, y, z = (int(rng.integers(0, n - 3)) for n in shape)
        blocked[x : x + 3, y : y + 4, z : z + 8] = True
    window, dense = window_of(blocked)
    return window, dense, np.argwhere(~dense)


def free_path(dense, nodes):
    """Whether no piece of a polyline passes through the inside of a blocked voxel."""
    low = np.argwhere(dense)
    for a, b in itertools.pairwise(nodes):
        step = np.where(np.abs(b - a) < 1e-12, 1e-12, b - a)
        one, other = (low + 1e-6 - a) / step, (low + 1 - 1e-6 - a) / step
        enter, leave = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
        if ((enter < leave) & (leave > 0) & (enter < 1)).any():
            return False
    return True


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_lines_are_free_when_no_box_is_in_the_way(seed):
    rng = np.random.default_rng(seed)
    window, dense, free = random_window(rng, 0.02)
    for _ in range(20):
        a, b = free[rng.integers(len(free), size=2)] + rng.random((2, 3))
        assert sees(window.words, *a, *b) == free_path(dense, np.stack((a, b)))
        a, b = np.floor(a) + 0.5, np.floor(b) + 0.5
        # Between centres lines pass through edges and corners: those are taken for blocked.
        assert sees(window.words, *a, *b) == sees(window.words, *b, *a)
        if sees(window.words, *a, *b):
            assert free_path(dense, np.stack((a, b)))


def test_lines_do_not_cut_corners():
    blocked = np.zeros((4, 4, 4), bool)
    blocked[1, 0, 0] = True
    window, _ = window_of(blocked)
    assert not sees(window.words, 1.5, 1.5, 1.5, 2.5, 2.5, 1.5)
    assert not sees(window.words, 1.5, 1.5, 1.5, 2.5, 2.5, 2.5)
    assert sees(window.words, 1.5, 1.5, 2.5, 2.5, 2.5, 2.5)


def test_costs_are_lengths_of_switchbacks():
    a, up, down = np.zeros(3), np.array([0.0, 0.0, 6.0]), np.array([3.0, 4.0, -6.0])
    assert edge_cost(a, up, ANY) == pytest.approx(6.0)
    assert edge_cost(a, up, GENTLE) == pytest.approx(12.0)
    assert edge_cost(a, down, GENTLE) == pytest.approx(6.0 / math.sin(math.radians(20)))
    assert edge_cost(down, a, GENTLE) == pytest.approx(12.0)
    flat = np.array([3.0, 4.0, 0.1])
    assert edge_cost(a, flat, GENTLE) == pytest.approx(math.sqrt(25.01))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(st.floats(-50, 50), min_size=9, max_size=9))
def test_costs_obey_the_triangle_inequality(numbers):
    a, b, c = np.array(numbers).reshape(3, 3)
    direct = edge_cost(a, c, GENTLE)
    assert direct <= edge_cost(a, b, GENTLE) + edge_cost(b, c, GENTLE) + 1e-9


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 2**32),
    share=st.sampled_from([0.1, 0.3, 0.6]),
    slopes=st.sampled_from([ANY, GENTLE]),
)
def test_there_is_a_route_exactly_within_a_component(seed, share, slopes):
    rng = np.random.default_rng(seed)
    window, dense, free = random_window(rng, share)
    for _ in range(5):
        a, b = free[rng.integers(len(free), size=2)] + rng.random((2, 3))
        nodes = route(window, a, b, slopes)
        assert (len(nodes) > 0) == (not reachable(window, a).is_blocked(b))
        if len(nodes):
            nodes = unfold(window.words, nodes, slopes)
            np.testing.assert_array_equal(nodes[[0, -1]], (a, b))
            assert free_path(dense, nodes)


def all_pairs(window, points):
    """Shortest lengths over the complete visibility graph."""
    n = len(points)
    lengths = np.full((n, n), np.inf)
    for i in range(n):
        for j in range(i):
            if sees(window.words, *points[i], *points[j]):
                lengths[i, j] = lengths[j, i] = np.linalg.norm(points[i] - points[j])
    for k in range(n):
        lengths = np.minimum(lengths, lengths[:, k : k + 1] + lengths[k])
    return lengths


def test_routes_are_hardly_longer_than_the_shortest_ones():
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(6):
        blocked = np.zeros((8, 8, 6), bool)
        for _ in range(5):
            x, y, z = (int(rng.integers(0, n - 2)) for n in blocked.shape)
            blocked[x : x + 2, y : y + 3, z : z + 4] = True
        window, dense = window_of(blocked)
        points = np.argwhere(~dense) + 0.5
        # The whole visibility graph over all centres: the any-angle optimum.
        lengths = all_pairs(window, points)
        for i, j in rng.integers(len(points), size=(40, 2)):
            if np.isfinite(lengths[i, j]) and i != j:
                nodes = route(window, points[i], points[j], ANY)
                ratios.append(path_cost(nodes, ANY) / lengths[i, j])
    assert len(ratios) > 200
    assert min(ratios) >= 1.0 - 1e-9
    assert np.mean(ratios) < 1.005
    assert np.quantile(ratios, 0.95) < 1.03
    assert max(ratios) < 1.15


def test_a_wall_is_passed_at_its_nearest_edge():
    blocked = np.zeros((40, 40, 20), bool)
    blocked[20, :30, :] = True
    window, _ = window_of(blocked)
    start, goal = np.array([11.5, 25.5, 5.5]), np.array([31.5, 25.5, 5.5])
    nodes = route(window, start, goal, ANY)
    # Over the centre of the voxel beyond the wall's edge; it covers x from 21 to 22 here.
    length = 2 * math.dist((11.5, 25.5), (21.5, 31.5))
    assert path_cost(nodes, ANY) == pytest.approx(length)


def test_far_routes_use_corners_and_are_never_longer():
    rng = np.random.default_rng(3)
    better = 0
    for _ in range(10):
        blocked = np.zeros((120, 60, 30), bool)
        for _ in range(40):
            x, y = int(rng.integers(5, 110)), int(rng.integers(0, 55))
            blocked[x : x + 6, y : y + 9, : int(rng.integers(5, 30))] = True
        window, dense = window_of(blocked)
        start, goal = np.array([2.5, 30.5, 5.5]), np.array([118.5, 30.5, 5.5])
        outcome, nodes = any_angle_path(window.words, start, goal, ANY, 2**16)
        assert outcome == FOUND
        nodes = shorten(window.words, nodes, ANY, 10)
        corners = corner_path(window.words, nodes, ANY)
        assert free_path(dense, corners)
        assert path_cost(corners, ANY) <= path_cost(nodes, ANY) + 1e-9
        better += path_cost(corners, ANY) < path_cost(nodes, ANY) - 1e-6
        far = route(window, start, goal, ANY)
        assert path_cost(far, ANY) <= path_cost(corners, ANY) + 1e-9
    assert better >= 5


def test_shortening_never_lengthens_or_blocks():
    rng = np.random.default_rng(8)
    for _ in range(30):
        window, dense, free = random_window(rng, 0.25)
        a, b = free[rng.integers(len(free), size=2)] + 0.5
        outcome, nodes = any_angle_path(window.words, a, b, ANY, 2**13)
        if outcome == FOUND:
            shorter = shorten(window.words, nodes, ANY, 10)
            assert path_cost(shorter, ANY) <= path_cost(nodes, ANY) + 1e-9
            assert free_path(dense, shorter)


def test_the_search_says_when_it_ran_out_of_nodes_or_of_ways():
    window, _ = window_of(np.zeros((30, 30, 30), bool))
    closed = np.zeros((30, 30, 30), bool)
    closed[15, :, :] = True
    a, b = np.array([3.5, 3.5, 3.5]), np.array([28.5, 28.5, 28.5])
    assert any_angle_path(window.words, a, b, ANY, 256)[0] == FOUND
    window, _ = window_of(closed)
    assert any_angle_path(window.words, a, b, ANY, 256)[0] == TOO_LARGE
    assert any_angle_path(window.words, a, b, ANY, 2**16)[0] == UNREACHABLE


@settings(derandomize=True, deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32))
def test_climbs_and_descents_keep_their_limits(seed):
    rng = np.random.default_rng(seed)
    window, dense, free = random_window(rng, 0.02, (24, 22, 40))
    found = 0
    for _ in range(5):
        a, b = free[rng.integers(len(free), size=2)] + rng.random((2, 3))
        nodes = route(window, a, b, GENTLE)
        if not len(nodes):
            continue
        found += 1
        points = unfold(window.words, nodes, GENTLE)
        assert free_path(dense, points)
        np.testing.assert_array_equal(points[[0, -1]], (a, b))
        d = np.diff(points, axis=0)
        angles = np.degrees(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])))
        assert angles.max() <= 30.0 + 1e-6
        assert angles.min() >= -20.0 - 1e-6
        length = np.linalg.norm(d, axis=1).sum()
        assert length == pytest.approx(path_cost(nodes, GENTLE))
    assert found


@pytest.mark.parametrize(("width", "angle"), [(3, 30.0), (1, 45.0), (1, 5.0)])
def test_however_narrow_a_shaft_is_switchbacks_fit(width, angle):
    blocked = np.ones((9, 9, 30), bool)
    blocked[4 : 4 + width, 4 : 4 + width, :] = False
    window, dense = window_of(blocked)
    slopes = slopes_of(math.radians(angle), math.radians(angle))
    a, b = np.array([5.5, 5.5, 2.5]), np.array([5.5, 5.5, 28.5])
    points = unfold(window.words, route(window, a, b, slopes), slopes)
    assert free_path(dense, points)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(26.0 / math.sin(math.radians(angle)))
    assert edge(window.words, a, b, ANY) == STRAIGHT
