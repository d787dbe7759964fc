import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mapping.voxels_queries import (
    line_of_sight,
    nearest_obstacle,
    sight_distance,
)
from unilavira_drake.messages import VoxelMap


def scattered(seed, share=0.003):
    """Four tiles of unknown, free and a few occupied voxels."""
    rng = np.random.default_rng(seed)
    tiles = {}
    for key in ((0, 0, 0), (-1, 0, 0), (0, -1, 1), (1, 0, 0)):
        tile = np.where(rng.random((32, 32, 32)) < 0.3, 0, -20).astype(np.int8)
        tile[rng.random(tile.shape) < share] = 20
        tiles[key] = tile
    return VoxelMap(version=1, resolution=0.25, tiles=tiles)


def corners(voxels):
    """(m, 3) lowest corners of the occupied voxels, metres."""
    found = [np.argwhere(tile > 0) + np.array(key) * 32 for key, tile in voxels.tiles.items()]
    return np.concatenate(found) * voxels.resolution


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_the_nearest_obstacle_is_that_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    voxels = scattered(seed, rng.choice([0.0, 1e-4, 0.003]))
    low = corners(voxels)
    for _ in range(10):
        p = rng.uniform(-12, 20, 3)
        bound = rng.uniform(0.5, 30.0)
        gaps = np.maximum(np.maximum(low - p, p - low - 0.25), 0.0)
        truth = np.linalg.norm(gaps, axis=1).min(initial=math.inf)
        distance, point = nearest_obstacle(voxels, tuple(p), max_distance=bound)
        if truth > bound:
            assert (distance, point) == (math.inf, None)
        else:
            assert distance == pytest.approx(truth)
            assert math.dist(p, point) == pytest.approx(truth)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_sight_ends_where_a_slab_test_says(seed):
    rng = np.random.default_rng(seed)
    voxels = scattered(seed)
    low = corners(voxels)
    for _ in range(10):
        a, b = rng.uniform(-9, 17, (2, 3))
        one, other = (low - a) / (b - a), (low + 0.25 - a) / (b - a)
        enter, leave = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
        hit = (enter < leave) & (leave > 0) & (enter < 1)
        truth = max(enter[hit].min(initial=math.inf), 0.0) * math.dist(a, b)
        assert sight_distance(voxels, tuple(a), tuple(b)) == pytest.approx(truth)
        assert line_of_sight(voxels, tuple(a), tuple(b)) == (truth == math.inf)


def test_unknown_may_block():
    voxels = VoxelMap(version=1, tiles={(0, 0, 0): np.full((32, 32, 32), -20, np.int8)})
    a = (1.0, 1.0, 1.0)
    assert line_of_sight(voxels, a, (15.0, 9.0, 3.0), unknown_blocks=True)
    assert line_of_sight(voxels, a, (17.0, 1.0, 1.0))
    assert sight_distance(voxels, a, (17.0, 1.0, 1.0), unknown_blocks=True) == pytest.approx(15.0)
    assert line_of_sight(voxels, a, a, unknown_blocks=True)


def test_points_that_are_none_are_refused():
    with pytest.raises(ValueError, match="finite"):
        line_of_sight(VoxelMap(), (math.nan, 0, 0), (1, 1, 1))
    with pytest.raises(ValueError, match="finite"):
        nearest_obstacle(VoxelMap(), (0, 0, 0), max_distance=math.inf)
