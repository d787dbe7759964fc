import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning.fast_marching import MAX_SLOWNESS
from unilavira_drake.planning.navigation_grid import (
    MARGIN,
    make_navigation_grid,
    path_is_blocked,
)

PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)


def grid_of(occupancy, position=(0.5, 0.5), targets=(), radius=0.3, turning_radius=0.4):
    return make_navigation_grid(
        occupancy,
        position=position,
        targets=targets,
        radius=radius,
        turning_radius=turning_radius,
    )


def random_map(seed, shape=(40, 50)):
    rng = np.random.default_rng(seed)
    log_odds = rng.choice(np.array([-20, 0, 20], np.int8), p=[0.6, 0.38, 0.02], size=shape)
    return OccupancyMap(n=1, version=1, origin=(-1.0, 0.5), log_odds=log_odds)


@PROPERTY
@given(st.integers(0, 2**31))
def test_blocked_is_nearer_than_the_radius_to_an_occupied_cell(seed):
    occupancy = random_map(seed)
    grid = grid_of(occupancy, position=(-3.0, -2.0))
    obstacles = np.argwhere(grid.log_odds > 0)
    cells = np.argwhere(np.ones(grid.blocked.shape, bool))
    nearest = np.full(len(cells), np.inf)
    for obstacle in obstacles:
        nearest = np.minimum(nearest, np.hypot(*(cells - obstacle).T))
    nearest = nearest.reshape(grid.blocked.shape)
    np.testing.assert_array_equal(grid.blocked, (nearest - 0.5) * 0.05 < 0.3)
    assert grid.slowness.min() >= 1.0
    assert grid.slowness.max() <= MAX_SLOWNESS


def test_the_window_holds_the_known_cells_the_robot_and_the_targets(drawn):
    occupancy = drawn("??????????\n???....???\n??????????", origin=(2.0, 3.0))
    grid = grid_of(occupancy, position=(2.3, 3.07), targets=((2.9, 2.0),))
    margin = MARGIN
    assert grid.origin == pytest.approx((2.15 - margin, 2.0 - margin))
    rows, columns = grid.blocked.shape
    assert grid.origin[0] + columns * 0.05 == pytest.approx(2.9 + 0.05 + margin, abs=0.051)
    assert grid.origin[1] + rows * 0.05 == pytest.approx(3.1 + margin, abs=0.051)
    assert np.sum(grid.log_odds < 0) == 4
    cell = grid.cell(2.16, 3.06)
    assert grid.log_odds[cell] < 0
    assert grid.center(cell) == pytest.approx((2.175, 3.075))
    assert grid.contains(cell)
    assert not grid.contains((rows, 0))


def test_an_empty_map_is_a_window_around_the_points():
    grid = grid_of(OccupancyMap(), position=(5.0, 5.0), targets=((6.0, 5.0),))
    assert not grid.blocked.any()
    assert grid.contains(grid.cell(5.0, 5.0))


def test_unknown_costs_more_than_free_and_open_space_nothing(drawn):
    text = "\n".join(["." * 60 + "?" * 60] * 60 + ["#" * 120])
    grid = grid_of(drawn(text), position=(1.0, 2.0))
    free, unknown = grid.cell(0.5, 2.0), grid.cell(4.5, 2.0)
    near = grid.cell(0.5, 0.4)
    assert grid.slowness[free] == 1.0
    assert 1.0 < grid.slowness[unknown] < 2.0
    assert grid.slowness[near] > 2.0


def test_a_robot_too_near_to_a_wall_gets_out(drawn):
    occupancy = drawn("\n".join(["." * 40] * 40 + ["#" * 40] * 2))
    position = (1.0, 0.2)
    grid = grid_of(occupancy, position=position)
    cell = grid.cell(*position)
    assert not grid.blocked[cell]
    assert grid.blocked[cell[0] - 1, cell[1]]  # not nearer to the wall
    assert grid.reachable(cell)[grid.cell(1.0, 1.5)]
    far_cell = grid.cell(1.9, 0.2)
    assert grid.blocked[far_cell]  # only around the robot


def test_reachable_cells_are_connected_over_four_neighbours(drawn):
    occupancy = drawn("\n".join([".#."] * 3), scale=30)
    grid = grid_of(occupancy, position=(0.5, 2.0), radius=0.1)
    reach = grid.reachable(grid.cell(0.5, 2.0))
    assert reach[grid.cell(0.5, 4.0)]
    assert reach[grid.cell(4.0, 2.0)]  # around, through the unknown margin
    assert not reach[grid.blocked].any()


@PROPERTY
@given(st.integers(0, 2**31))
def test_a_blocked_path_is_found_as_by_brute_force(seed):
    rng = np.random.default_rng(seed)
    log_odds = np.where(rng.uniform(size=(60, 60)) < 0.004, 20, -20).astype(np.int8)
    occupancy = OccupancyMap(n=1, version=1, origin=(-1.0, 0.5), log_odds=log_odds)
    p_WP = rng.uniform((-0.8, 0.7), (1.8, 3.3), (3, 2))
    obstacles = np.argwhere(log_odds > 0)[:, ::-1] * 0.05 + np.array([-0.975, 0.525])
    t = np.linspace(0, 1, 400)[:, None]
    samples = np.concatenate([p_WP[0] + t * (p_WP[1] - p_WP[0]), p_WP[1] + t * (p_WP[2] - p_WP[1])])
    new = [p for p in obstacles if math.dist(p, p_WP[0]) >= 0.35]
    distances = [np.hypot(*(samples - p).T).min() for p in new]
    nearest = min(distances, default=np.inf)
    found = path_is_blocked(occupancy, p_WP, position=tuple(p_WP[0]), radius=0.3)
    if abs(nearest - 0.3) > 0.01:
        assert found == (nearest < 0.3)


def test_obstacles_at_hand_are_no_news(drawn):
    occupancy = drawn("\n".join(["." * 40] * 40 + ["#" * 40] * 2))
    along = np.array([(0.2, 0.25), (0.4, 0.25)])
    away = np.array([(0.2, 0.25), (0.2, 1.5)])
    assert not path_is_blocked(occupancy, away, position=(0.2, 0.25), radius=0.3)
    assert path_is_blocked(occupancy, along, position=(0.2, 1.0), radius=0.3)
