import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from unilavira_drake.mapping.clearance import distance_field, nearest_obstacle, path_clearance
from unilavira_drake.messages import OccupancyMap

coordinate = st.floats(-3.0, 6.0)


def random_map(seed, share=0.01):
    rng = np.random.default_rng(seed)
    log_odds = np.where(rng.random((80, 110)) < share, 9, rng.choice([-4, 0], (80, 110)))
    return OccupancyMap(origin=(-1.0, 0.5), log_odds=log_odds.astype(np.int8))


def squares(occupancy):
    """Lower and upper corners of the occupied cells, metres."""
    rows, columns = np.nonzero(occupancy.log_odds > 0)
    low = np.array(occupancy.origin) + np.stack((columns, rows), 1) * occupancy.resolution
    return low, low + occupancy.resolution


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 999), st.sampled_from([0.0002, 0.01, 0.3]))
def test_the_field_is_scipys_exact_transform(seed, share):
    occupancy = random_map(seed, share)
    field = distance_field(occupancy)
    assert field.dtype == np.float32
    if not (occupancy.log_odds > 0).any():
        assert np.isinf(field).all()
        return
    expected = ndimage.distance_transform_edt(occupancy.log_odds <= 0, sampling=0.05)
    np.testing.assert_allclose(field, expected, rtol=2e-6, atol=1e-7)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 999), coordinate, coordinate, st.floats(0.0, 4.0))
def test_the_nearest_obstacle_is_the_nearest(seed, x, y, reach):
    occupancy = random_map(seed, 0.003)
    low, high = squares(occupancy)
    point = np.array([x, y])
    distances = np.hypot(*np.maximum(np.maximum(low - point, point - high), 0.0).T)
    found = nearest_obstacle(occupancy, x, y, reach)
    least = distances.min(initial=math.inf)
    if least > reach + 1e-9:
        assert found is None
    elif least < reach - 1e-9:
        assert found.distance == pytest.approx(least, abs=1e-9)
        assert math.dist(found.point, (x, y)) == pytest.approx(found.distance)
        assert occupancy.state_at(*(np.array(found.point) + 1e-9).tolist()) == "occupied" or any(
            np.all((lo - 1e-9 <= found.point) & (found.point <= hi + 1e-9))
            for lo, hi in zip(low, high, strict=True)
        )


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 999), st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5))
def test_room_beside_a_path_is_what_close_samples_find(seed, points):
    occupancy = random_map(seed, 0.001)
    low, high = squares(occupancy)
    p_WP = np.array(points)
    found = path_clearance(occupancy, p_WP, 20.0)
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    samples = [p_WP] + [a + share * (b - a) for a, b in itertools.pairwise(p_WP)]
    least, step = math.inf, 0.0
    for part in samples:
        for lo, hi in zip(low, high, strict=True):
            gap = np.hypot(*np.maximum(np.maximum(lo - part, part - hi), 0.0).T)
            least = min(least, gap.min())
    if len(p_WP) > 1:
        step = np.hypot(*np.diff(p_WP, axis=0).T).max() / 2000
    assert found <= least + 1e-9 if math.isfinite(least) else found == math.inf
    assert found >= least - step or found == 0.0
    assert path_clearance(occupancy, p_WP, 0.5 * found) in (0.0, math.inf)


def test_inside_an_obstacle_there_is_no_room():
    occupancy = OccupancyMap(log_odds=np.full((10, 10), 9, np.int8))
    assert nearest_obstacle(occupancy, 0.2, 0.2, 0.0).distance == 0.0
    assert path_clearance(occupancy, np.array([[-1.0, 0.25], [2.0, 0.25]]), 1.0) == 0.0
    assert nearest_obstacle(OccupancyMap(), 0.0, 0.0, 5.0) is None
    assert path_clearance(OccupancyMap(), np.array([[0.0, 0.0]]), 5.0) == math.inf
    assert np.isinf(distance_field(OccupancyMap())).all()
    assert not distance_field(occupancy).any()
