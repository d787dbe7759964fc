import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mapping.storeys import SAME_STOREY, Storeys
from unilavira_drake.messages import OccupancyMap


def drive(storeys, heights, step=0.1, start=0.0, direction=1.0):
    """The storeys after a way along x with these floor heights."""
    visited = []
    for k, height in enumerate(heights):
        storeys = storeys.at(float(height), (start + direction * step * k, 0.0))
        visited.append(storeys.current)
    return storeys, visited


def house(landing=False):
    """Floor heights on the way up one storey of 3 m: level, stairs, level."""
    up = np.linspace(0.0, 3.0, 60)
    if landing:
        up = np.concatenate((np.linspace(0.0, 1.5, 30), np.full(8, 1.5), np.linspace(1.5, 3.0, 30)))
    return np.concatenate((np.zeros(30), up, np.full(30, 3.0)))


def test_one_storey_stays_one():
    rng = np.random.default_rng(0)
    wavy = 0.4 * np.sin(np.linspace(0.0, 20.0, 500)) + rng.normal(0.0, 0.02, 500)
    storeys, visited = drive(Storeys(), wavy)
    assert set(visited) == {0}
    (storey,) = storeys.known
    assert (storey.height, storey.settled) == (pytest.approx(wavy[0]), True)


@pytest.mark.parametrize("landing", [False, True])
def test_up_and_down_again_there_are_two_floors_and_the_stairs(landing):
    way = house(landing)
    storeys, visited = drive(Storeys(), way)
    assert [s.height for s in storeys.known] == pytest.approx([0.0, 3.0], abs=0.06)
    assert all(s.settled for s in storeys.known)
    assert visited[0] == 0
    assert visited[-1] == 1
    storeys, visited = drive(storeys, way[::-1], start=100.0, direction=-1.0)
    assert visited[0] == 1
    assert visited[-1] == 0
    settled = [s.height for s in storeys.known if s.settled]
    assert settled == pytest.approx([0.0, 3.0], abs=0.06)
    # Up and down once more finds nothing new.
    count = len(storeys.known)
    for _ in range(3):
        storeys, visited = drive(storeys, way)
        assert visited[-1] == 1
        storeys, visited = drive(storeys, way[::-1])
        assert visited[-1] == 0
    assert len(storeys.known) == count <= 3


def test_three_storeys_each_keep_their_map():
    storeys, way = Storeys(), house()
    for floor in range(3):
        storeys, _ = drive(storeys, way[-30:] + 3.0 * (floor - 1))
        storeys = storeys.mapped(OccupancyMap(version=floor + 1))
        if floor < 2:
            storeys, _ = drive(storeys, way + 3.0 * floor)
    assert [s.occupancy.version for s in storeys.known] == [1, 2, 3]
    for floor in (1, 0, 2):
        assert storeys.at(3.0 * floor, (0.0, 0.0)).occupancy.version == floor + 1


def test_a_lift_brings_the_robot_to_a_new_storey_and_back():
    storeys = Storeys().at(0.0, (0.0, 0.0)).at(3.0, (0.0, 0.0))
    assert (storeys.current, len(storeys.known)) == (1, 2)
    storeys = storeys.at(0.0, (0.0, 0.0))
    assert storeys.current == 0
    storeys = storeys.at(3.0, (0.0, 0.0))
    assert (storeys.current, len(storeys.known)) == (1, 2)
    storeys, _ = drive(storeys, [3.0] * 12)
    assert storeys.known[1].settled


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(st.floats(-10, 10) | st.sampled_from([math.nan, math.inf]), max_size=40))
def test_the_robot_always_stands_on_the_storey_that_is_shown(heights):
    storeys = Storeys()
    for k, height in enumerate(heights):
        before, storeys = storeys, storeys.at(height, (0.5 * k, 0.0))
        if not math.isfinite(height):
            assert storeys is before
        else:
            assert abs(storeys.known[storeys.current].height - height) <= SAME_STOREY
    assert Storeys().occupancy.version == 0
