"""The bounded distance transform against SciPy's whole one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from unilavira_drake.planning.near_obstacles import near_distance


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    reach=st.integers(1, 25),
    share=st.sampled_from([0.0, 0.002, 0.02, 0.3, 1.0]),
    seed=st.integers(0, 10_000),
)
def test_equals_the_whole_transform_within_its_reach(
    shape: tuple[int, int], reach: int, share: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random(shape) < share
    log_odds = np.where(occupied, rng.integers(1, 40, shape), rng.integers(-40, 1, shape))
    found = near_distance(log_odds.astype(np.int8), reach)
    expected = np.full(shape, np.inf)
    if occupied.any():
        expected = distance_transform_edt(~occupied)
    near = expected <= reach
    np.testing.assert_array_equal(found[near], expected[near].astype(np.float32))
    assert np.isinf(found[~near]).all()


@pytest.mark.parametrize("reach", [1, 3, 40])
def test_one_obstacle_reaches_no_farther(reach: int) -> None:
    log_odds = np.zeros((9, 90), np.int8)
    log_odds[4, 10] = 1
    found = near_distance(log_odds, reach)
    assert np.isfinite(found[4]).sum() == min(10, reach) + 1 + reach
    assert found[4, 10] == 0.0
