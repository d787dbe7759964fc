import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from unilavira_drake.mapping.frontiers import find_frontiers, reachable_cells
from unilavira_drake.messages import OccupancyMap

VALUES = {"#": 20, ".": -20, "?": 0}


def drawn(text, scale=1, origin=(0.0, 0.0)):
    """'#' occupied, '.' free, '?' unknown; the first line is the highest y."""
    cells = np.array([[VALUES[letter] for letter in line] for line in text.split()[::-1]], np.int8)
    return OccupancyMap(origin=origin, log_odds=np.kron(cells, np.ones((scale, scale), np.int8)))


def test_a_corridor_has_a_frontier_at_its_open_end():
    occupancy = drawn("##########\n#.....????\n##########", scale=20, origin=(-1.0, 2.0))
    (frontier,) = find_frontiers(occupancy, position=(0.5, 3.5), radius=0.3)
    assert frontier.size == pytest.approx(1.0)
    assert frontier.centroid == pytest.approx((4.975, 3.5))
    # The nearest to the middle of those with room around them; both middle ones are as near.
    assert frontier.goal == pytest.approx((4.975, 3.475)) or frontier.goal == pytest.approx(
        (4.975, 3.525)
    )
    assert frontier.p_WF.shape == (20, 2)
    assert not frontier.p_WF.flags.writeable


def test_a_frontier_behind_a_gap_too_narrow_has_no_goal():
    occupancy = drawn("?????\n#.#.#\n#.#.#\n#...#\n#####", scale=10)
    wide = find_frontiers(occupancy, position=(1.25, 0.75), radius=0.2)
    assert [f.goal is not None for f in wide] == [True, True]
    narrow = find_frontiers(occupancy, position=(1.25, 0.75), radius=0.26)
    assert [f.goal for f in narrow] == [None, None]
    assert {f.size for f in wide} == {0.5}


def test_the_edge_of_the_grid_is_unknown_and_small_ones_are_left_out():
    occupancy = drawn("...\n...\n..?", scale=10)
    (frontier,) = find_frontiers(occupancy, position=(0.5, 0.5), radius=0.1)
    # All around, each of the five outer corners once.
    assert len(frontier.p_WF) == 4 * 30 - 5
    assert find_frontiers(occupancy, position=(0.5, 0.5), radius=0.1, min_size=9.0) == ()
    for text in ("???", "###", "#.#\n###"):
        assert find_frontiers(drawn(text), position=(0.0, 0.0), radius=0.1) == ()


def test_a_robot_that_stands_too_near_starts_where_there_is_room():
    occupancy = drawn("????????\n........\n........\n########", scale=10)
    for y, reached in ((0.52, True), (0.3, True), (-0.4, False)):
        cells = reachable_cells(occupancy, position=(2.0, y), radius=0.3)
        assert cells.any() == reached
    assert not reachable_cells(occupancy, position=(1e6, -1e6), radius=0.3).any()
    assert find_frontiers(OccupancyMap(), position=(0.0, 0.0), radius=0.3) == ()


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10**6))
def test_frontiers_are_what_brute_force_finds(seed):
    rng = np.random.default_rng(seed)
    blobs = ndimage.gaussian_filter(rng.normal(size=(45, 60)), 3.0)
    log_odds = np.where(blobs > 0.04, 20, np.where(blobs < -0.03, 0, -20)).astype(np.int8)
    log_odds[rng.integers(45), rng.integers(60)] = 20
    occupancy = OccupancyMap(origin=(-1.0, 0.5), log_odds=log_odds)
    position = occupancy.center(int(rng.integers(45)), int(rng.integers(60)))
    found = find_frontiers(occupancy, position=position, radius=0.12, min_size=0.0)
    unknown = np.pad(log_odds == 0, 1, constant_values=True)
    cross = ndimage.generate_binary_structure(2, 1)
    border = (log_odds < 0) & ndimage.binary_dilation(unknown, cross)[1:-1, 1:-1]
    labels, count = ndimage.label(border, np.ones((3, 3)))
    assert len(found) == count
    # Where the robot gets: over free cells whose centre is far enough from any obstacle's.
    far = ndimage.distance_transform_edt(log_odds <= 0) * 0.05 - 0.025 >= 0.12 - 1e-6
    open_floor = (log_odds < 0) & far
    parts, _ = ndimage.label(open_floor, cross)
    row, column = occupancy.cell(*position)
    for frontier in found:
        cells = [occupancy.cell(x, y) for x, y in frontier.p_WF]
        (label,) = {int(labels[cell]) for cell in cells}
        assert len(cells) == np.sum(labels == label)
        assert frontier.size == pytest.approx(0.05 * len(cells))
        assert frontier.centroid == pytest.approx(tuple(frontier.p_WF.mean(axis=0)))
        if open_floor[row, column]:
            reached = [c for c in cells if parts[c] == parts[row, column]]
            assert (frontier.goal is not None) == bool(reached)
        if frontier.goal is not None:
            assert open_floor[occupancy.cell(*frontier.goal)]
            if open_floor[row, column]:
                assert occupancy.cell(*frontier.goal) in reached
                centers = np.array([occupancy.center(*c) for c in reached])
                least = np.hypot(*(centers - frontier.centroid).T).min()
                assert np.hypot(*np.subtract(frontier.goal, frontier.centroid)) <= least + 1e-9
    assert [f.size for f in found] == sorted((f.size for f in found), reverse=True)
