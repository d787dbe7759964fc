import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from unilavira_drake.planning.fast_marching import MAX_SLOWNESS, distance_field

PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)


def oracle(blocked, sources, slowness):
    """First-order upwind solution by sweeping until nothing changes; float64, no queue."""
    times = np.full(np.add(blocked.shape, 2), np.inf)
    for row, column in sources:
        if not blocked[row, column]:
            times[row + 1, column + 1] = 0.0
    changed = True
    while changed:
        changed = False
        for i, j in np.argwhere(~blocked):
            a = min(times[i, j + 1], times[i + 2, j + 1])
            b = min(times[i + 1, j], times[i + 1, j + 2])
            low, high, cost = min(a, b), max(a, b), float(slowness[i, j])
            if math.isinf(low):
                continue
            new = low + cost
            if high - low < cost:
                new = (low + high + math.sqrt(2 * cost * cost - (high - low) ** 2)) / 2
            if new < times[i + 1, j + 1] - 1e-9:
                times[i + 1, j + 1], changed = new, True
    return times[1:-1, 1:-1]


def random_world(seed, size=90):
    rng = np.random.default_rng(seed)
    blocked = np.zeros((size, size + 20), bool)
    for _ in range(25):
        i, j = rng.integers(0, size, 2)
        h, w = rng.integers(1, 20, 2)
        blocked[i : i + h, j : j + w] = True
    free = np.argwhere(~blocked)
    return blocked, free[rng.integers(len(free))]


@PROPERTY
@given(
    hnp.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.booleans()),
    st.integers(0, 2**31),
    st.integers(1, 3),
)
def test_the_field_is_the_upwind_solution(blocked, seed, count):
    rng = np.random.default_rng(seed)
    sources = np.stack([rng.integers(0, side, count) for side in blocked.shape], axis=1)
    slowness = rng.uniform(1, MAX_SLOWNESS, blocked.shape).astype(np.float32)
    for cost in (np.ones_like(slowness), slowness):
        times = distance_field(blocked, sources, slowness=cost)
        expected = oracle(blocked, sources, cost)
        assert times.dtype == np.float64
        np.testing.assert_allclose(times, expected, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_field_is_that_of_scikit_fmm(seed):
    skfmm = pytest.importorskip("skfmm")
    blocked, source = random_world(seed)
    phi = np.ma.MaskedArray(np.ones(blocked.shape), blocked)
    phi[tuple(source)] = 0
    expected = np.ma.filled(skfmm.distance(phi, dx=1, order=1), np.inf)
    times = distance_field(blocked, source[None])
    reached = np.isfinite(times)
    assert reached.sum() > 1000
    np.testing.assert_allclose(times[reached], expected[reached], atol=1e-9, rtol=1e-12)


def test_a_straight_line_is_exact_and_open_floor_nearly_so():
    times = distance_field(np.zeros((101, 101), bool), np.array([[50, 50]]))
    assert times[50, 100] == times[0, 50] == 50.0
    rows, columns = np.indices(times.shape)
    exact = np.hypot(rows - 50, columns - 50)
    far = exact > 10
    assert np.all(times >= exact - 1e-3)
    assert np.max(times[far] / exact[far]) < 1.11
    assert np.mean(times[far] / exact[far]) < 1.05


@pytest.mark.parametrize("seed", range(4))
def test_an_early_stop_changes_nothing_up_to_the_stop_cell(seed):
    blocked, source = random_world(seed)
    full = distance_field(blocked, source[None])
    free = np.argwhere(np.isfinite(full))
    for stop in free[:: len(free) // 5]:
        partial = distance_field(blocked, source[None], stop=tuple(stop))
        settled = full <= full[tuple(stop)]
        np.testing.assert_array_equal(partial[settled], full[settled])
        left = np.isfinite(partial)
        assert np.all(partial[left] >= full[left])
    near = tuple(source)
    assert np.isfinite(distance_field(blocked, source[None], stop=near)).sum() < left.size / 2


def test_a_mirrored_world_has_the_mirrored_field():
    blocked, source = random_world(7)
    times = distance_field(blocked, source[None])
    mirrored = np.array([[blocked.shape[0] - 1 - source[0], source[1]]])
    other = distance_field(blocked[::-1], mirrored)
    np.testing.assert_allclose(other[::-1], times, atol=1e-4)


def test_many_sources_fill_the_queue_and_are_all_zero():
    sources = np.argwhere(np.ones((120, 120), bool))
    assert not distance_field(np.zeros((120, 120), bool), sources).any()


def test_blocked_and_missing_sources_reach_nothing():
    blocked = np.array([[True, False]])
    assert np.all(np.isinf(distance_field(blocked, np.array([[0, 0]]))))
    assert np.all(np.isinf(distance_field(blocked, np.zeros((0, 2), np.int64))))


def test_wrong_arguments_are_refused():
    free = np.zeros((2, 3), bool)
    with pytest.raises(ValueError, match="2 x 3"):
        distance_field(free, np.array([[0, 3]]))
    for value in (0.5, 8.0, np.nan):
        with pytest.raises(ValueError, match="slowness"):
            distance_field(free, np.array([[0, 0]]), slowness=np.full((2, 3), value, np.float32))
