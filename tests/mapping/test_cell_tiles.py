import copy
import dataclasses as dc
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.messages.cell_tiles import TILE, CellTiles
from unilavira_drake.robots.stopping import Footprint, free_distance

corners = st.tuples(st.integers(-150, 150), st.integers(-150, 150))


def random_cells(seed, shape):
    rng = np.random.default_rng(seed)
    return rng.choice(np.array([-40, 0, 0, 9], np.int8), shape)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 99), corners, corners, st.integers(0, 200), st.integers(0, 200))
def test_a_window_is_the_dense_array_with_nothing_around(seed, first, low, height, width):
    cells = random_cells(seed, (90, 130))
    grid = CellTiles.of(cells, first)
    plane = np.zeros((700, 700), np.int8)
    plane[first[0] + 200 : first[0] + 290, first[1] + 200 : first[1] + 330] = cells
    expected = plane[low[0] + 200 : low[0] + 200 + height, low[1] + 200 : low[1] + 200 + width]
    found = grid.window(low, (low[0] + height, low[1] + width))
    np.testing.assert_array_equal(found, expected)
    assert found.flags.writeable
    np.testing.assert_array_equal(grid.dense(), cells)


def test_what_did_not_change_is_shared_and_the_old_grid_stays():
    old = CellTiles.of(random_cells(0, (256, 256)))
    tile = np.full((TILE, TILE), 7, np.int8)
    new = old.updated({(1, 2): tile, (9, 9): tile}, first=(0, 0), shape=(640, 640))
    tile[:] = 1  # ours is a copy
    assert [key for key in old.tiles if new.tiles[key] is not old.tiles[key]] == [(1, 2)]
    assert (new.dense()[64:128, 128:192] == 7).all()
    assert (new.dense()[576:, 576:] == 7).all()
    assert old.shape == (256, 256)
    assert not (old.dense() == 7).any()
    for array in (new.dense(), *new.tiles.values()):
        assert not array.flags.writeable
    with pytest.raises(TypeError):
        new.tiles[0, 0] = tile


def test_an_empty_tile_is_no_tile():
    old = CellTiles.of(random_cells(0, (128, 128)))
    empty = np.zeros((TILE, TILE), np.int8)
    new = old.updated({(0, 1): empty, (5, 5): empty}, first=(0, 0), shape=(128, 128))
    assert set(new.tiles) == {(0, 0), (1, 0), (1, 1)}
    assert not new.dense()[:64, 64:].any()
    assert not CellTiles.of(np.zeros((500, 500), np.int8)).tiles


def test_a_grid_is_copied_by_reference_and_pickled_by_value():
    grid = CellTiles.of(random_cells(1, (100, 70)), (-30, 5))
    occupancy = OccupancyMap(n=2, version=3, time=1.5, origin=(0.25, -1.5), cells=grid)
    assert copy.deepcopy(occupancy) is occupancy
    again = pickle.loads(pickle.dumps(occupancy))
    assert (again.n, again.version, again.time, again.origin) == (2, 3, 1.5, (0.25, -1.5))
    np.testing.assert_array_equal(again.log_odds, occupancy.log_odds)
    renewed = dc.replace(occupancy, n=4)
    assert renewed.cells is grid
    assert renewed.log_odds is occupancy.log_odds


def test_what_is_no_grid_is_refused():
    for cells in (np.zeros(4, np.int8), np.zeros((4, 4))):
        with pytest.raises(ValueError, match="int8"):
            OccupancyMap(log_odds=cells)
    with pytest.raises(ValueError, match="64 x 64"):
        CellTiles(tiles={(0, 0): np.zeros((64, 63), np.int8)})
    with pytest.raises(ValueError, match="frame"):
        CellTiles(shape=(-1, 4))
    for resolution in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="resolution"):
            OccupancyMap(resolution=resolution)


def test_the_three_states_are_kept_apart_and_outside_is_unknown():
    occupancy = OccupancyMap(origin=(-1.0, 2.0), log_odds=np.array([[-4, 0], [9, -1]], np.int8))
    states = [
        occupancy.state_at(*occupancy.center(row, column))
        for row, column in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (-1, 0), (10**7, 10**7))
    ]
    expected = ["free", "unknown", "occupied", "free", "unknown", "unknown", "unknown"]
    assert states == expected


def test_a_map_far_away_costs_no_memory():
    tile = np.full((TILE, TILE), 9, np.int8)
    far = CellTiles(shape=(10**6, 10**6), tiles={(0, 0): tile, (15_000, 15_000): tile})
    assert far.window((0, 0), (64, 64)).all()
    assert not far.window((10**6 - 64, 10**6 - 64), (10**6 + 8, 10**6 + 8)).any()
    assert far.window((960_000, 960_000), (960_064, 960_064)).all()


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    st.integers(0, 99), st.floats(-6, 6), st.floats(-6, 6), st.floats(0, 3), st.floats(-2, 2),
    st.booleans(),
)  # fmt: skip
def test_the_cells_around_a_robot_are_as_good_as_all(seed, x, y, yaw, curvature, backwards):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((400, 380)) < 0.002, 9, -4).astype(np.int8)
    occupancy = OccupancyMap(origin=(-9.15, -10.3), log_odds=cells)
    rest = (occupancy.resolution, x, y, yaw, curvature, backwards, 1.2, Footprint())
    part, first = occupancy.around(x, y, 2.0)
    assert part.size <= 9 * TILE * TILE
    everything = free_distance(occupancy.log_odds, occupancy.origin, *rest, (0, 0))
    assert free_distance(part, occupancy.origin, *rest, first) == everything
    assert occupancy.around(x, y, 2.0)[0] is part


def test_around_a_robot_that_left_the_map_is_nothing():
    occupancy = OccupancyMap(log_odds=np.full((70, 70), 9, np.int8))
    for x, y in ((1e9, 0.0), (0.0, -1e300), (-50.0, 60.0)):
        assert occupancy.around(x, y, 1.0)[0].size == 0
