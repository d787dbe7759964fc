import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from unilavira_drake.messages import VoxelMap
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space
from unilavira_drake.planning.visibility_window import make_window, reachable


def voxel_map(occupied, version=1, resolution=0.5, origin=(0, 0, 0)):
    """A map from a dense bool array whose voxel (0, 0, 0) is the tile ``origin``'s first."""
    tiles = {}
    for a in range(0, occupied.shape[0], 32):
        for b in range(0, occupied.shape[1], 32):
            for c in range(0, occupied.shape[2], 32):
                part = occupied[a : a + 32, b : b + 32, c : c + 32]
                tile = np.zeros((32, 32, 32), np.int8)
                tile[: part.shape[0], : part.shape[1], : part.shape[2]] = np.where(part, 20, -20)
                key = (a // 32 + origin[0], b // 32 + origin[1], c // 32 + origin[2])
                tiles[key] = tile
    return VoxelMap(version=version, resolution=resolution, tiles=tiles)


def bits(window, low, high):
    """The bool array of the voxels in [low, high) of the world."""
    nx, ny, nw = window.words.shape
    dense = (window.words[..., None] >> np.arange(32, dtype=np.uint32)) & 1 != 0
    a, b = np.array(low) - window.low, np.array(high) - window.low
    return dense.reshape(nx, ny, 32 * nw)[a[0] : b[0], a[1] : b[1], a[2] : b[2]]


def inflated(occupied, clearance, resolution):
    """Blocked by the definition: the least distance between points of two voxels."""
    found = np.zeros_like(occupied)
    cells = np.argwhere(occupied)
    index = np.stack(np.meshgrid(*map(np.arange, occupied.shape), indexing="ij"), -1)
    for cell in cells:
        steps = index - cell
        gap = np.maximum(np.abs(steps) - 1, 0) * resolution
        near = np.linalg.norm(gap, axis=-1) < clearance.radius - 1e-9
        beside = np.hypot(gap[..., 0], gap[..., 1]) < clearance.radius - 1e-9
        beside |= (steps[..., :2] == 0).all(-1)
        near |= beside & (steps[..., 2] > 0) & (gap[..., 2] < clearance.ground_margin - 1e-9)
        near |= beside & (steps[..., 2] < 0) & (gap[..., 2] < clearance.ceiling_margin - 1e-9)
        found |= near | (steps == 0).all(-1)
    return found


@settings(derandomize=True, deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 2**32),
    radius=st.sampled_from([0.0, 0.3, 0.5, 0.8, 1.7]),
    ground=st.sampled_from([0.0, 1.0, 2.6]),
    ceiling=st.sampled_from([0.0, 0.5, 1.5]),
)
def test_blocked_is_what_the_definition_says(seed, radius, ground, ceiling):
    rng = np.random.default_rng(seed)
    occupied = rng.random((40, 37, 44)) < 0.0005
    occupied[30:34, 30:33, 29:35] |= rng.random((4, 3, 6)) < 0.2
    clearance = Clearance(radius, ground, ceiling)
    voxels = voxel_map(occupied, origin=(-1, 0, -2))
    space = update_space(FlightSpace(clearance=clearance), voxels)
    low, high = (-32, 0, -64), (8, 37, -20)
    window = make_window(space.blocked, low=low, high=high, resolution=0.5)
    np.testing.assert_array_equal(bits(window, low, high), inflated(occupied, clearance, 0.5))


@settings(derandomize=True, deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32))
def test_a_newer_map_gives_the_same_as_a_fresh_start(seed):
    rng = np.random.default_rng(seed)
    occupied = rng.random((70, 40, 40)) < 0.001
    clearance = Clearance(0.8, 1.5, 0.5)
    first = voxel_map(occupied)
    space = update_space(FlightSpace(clearance=clearance), first)
    assert update_space(space, first) is space
    changed = occupied.copy()
    changed[rng.integers(70), rng.integers(40), rng.integers(40)] ^= True
    second = voxel_map(changed, version=2)
    tiles = {
        key: first.tiles[key] if (tile == first.tiles[key]).all() else tile
        for key, tile in second.tiles.items()
    }
    del tiles[2, 1, 1]
    second = VoxelMap(version=2, tiles=tiles)
    newer = update_space(space, second)
    fresh = update_space(FlightSpace(clearance=clearance), second)
    for one, other in ((newer.blocked, fresh.blocked), (newer.occupied, fresh.occupied)):
        windows = [
            make_window(tiles, low=(-9, -9, -9), high=(80, 50, 50), resolution=0.5).words
            for tiles in (one, other)
        ]
        np.testing.assert_array_equal(*windows)
    shared = sum(newer.blocked.tiles.get(k) is t for k, t in space.blocked.tiles.items())
    assert shared >= len(space.blocked.tiles) - 27


def test_a_map_of_another_resolution_starts_anew():
    occupied = np.zeros((32, 32, 32), bool)
    occupied[5, 5, 5] = True
    clearance = Clearance(0.4, 0.0, 0.0)
    space = update_space(FlightSpace(clearance=clearance), voxel_map(occupied))
    finer = voxel_map(occupied, resolution=0.25)
    space = update_space(space, finer)
    window = make_window(space.blocked, low=(0, 0, 0), high=(32, 32, 32), resolution=0.25)
    np.testing.assert_array_equal(
        bits(window, (0, 0, 0), (32, 32, 32)), inflated(occupied, clearance, 0.25)
    )


def test_altitudes_and_borders_are_blocked():
    window = make_window(
        FlightSpace().blocked,
        low=(-3, 4, -7),
        high=(5, 9, 40),
        resolution=0.5,
        floor=-2,
        ceiling=34,
    )
    free = ~bits(window, window.low, (window.low[0] + 10, window.low[1] + 7, 64))
    expected = np.zeros_like(free)
    z0 = window.low[2]
    expected[1:-1, 1:-1, -2 - z0 : 34 - z0] = True
    np.testing.assert_array_equal(free, expected)
    assert window.is_blocked(window.point((0.0, 3.0, -1.01)))
    assert not window.is_blocked(window.point((0.0, 3.0, -0.99)))
    assert window.is_blocked(np.array([-5.0, 2.0, 2.0]))


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32), share=st.sampled_from([0.3, 0.6, 0.7, 0.8]))
def test_what_is_reachable_is_a_component(seed, share):
    rng = np.random.default_rng(seed)
    occupied = rng.random((20, 17, 40)) < share
    space = update_space(FlightSpace(clearance=Clearance(0.0, 0.0, 0.0)), voxel_map(occupied))
    window = make_window(space.blocked, low=(0, 0, 0), high=(20, 17, 40), resolution=0.5)
    labels, _ = ndimage.label(~occupied)
    for _ in range(5):
        i, j, k = (int(rng.integers(n)) for n in occupied.shape)
        reach = reachable(window, window.point((0.5 * i + 0.25, 0.5 * j + 0.25, 0.5 * k + 0.25)))
        component = (labels == labels[i, j, k]) & ~occupied & ~occupied[i, j, k]
        np.testing.assert_array_equal(~bits(reach, (0, 0, 0), occupied.shape), component)


@pytest.mark.parametrize("radius", [-1.0, math.nan, math.inf])
def test_a_radius_that_makes_no_sense_is_refused(radius):
    with pytest.raises(ValueError, match="finite"):
        Clearance(radius)


def test_a_radius_of_too_many_voxels_is_refused():
    space = FlightSpace(clearance=Clearance(5.0))
    with pytest.raises(ValueError, match="32 voxels"):
        update_space(space, VoxelMap(version=1, resolution=0.1))
    with pytest.raises(ValueError, match="too large"):
        make_window(space.blocked, low=(0, 0, 0), high=(10**4,) * 3, resolution=0.1)
