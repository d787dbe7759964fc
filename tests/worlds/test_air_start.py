import re

import numpy as np
import pytest

from unilavira_drake.errors import TaskError
from unilavira_drake.worlds.air_clearance import box_distances, nearest_on, nearest_solid
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start, parse_start_pose
from unilavira_drake.worlds.world import Box

RADIUS = 0.6


@pytest.fixture(scope="module")
def town():
    return load_world("town")


def test_distances_are_those_of_a_cloud_of_points():
    box = Box((1.0, 2.0, 3.0), (2.0, 4.0, 1.0), 0.6)
    generator = np.random.default_rng(1)
    cloud = generator.uniform(-0.5, 0.5, (200_000, 3)) * np.array(box.size)
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    cloud = cloud @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + np.array(box.center)
    points = generator.uniform(-4.0, 8.0, (20, 3))
    for point, distance in zip(points, box_distances(points, (box,)), strict=True):
        closest = np.linalg.norm(cloud - point, axis=1).min()
        assert distance <= closest + 1e-9
        assert distance == pytest.approx(closest, abs=0.12)
        on = nearest_on(box, tuple(point))
        assert np.linalg.norm(np.array(on) - point) == pytest.approx(distance)


def test_inside_is_zero_and_nothing_is_infinite():
    box = Box((0.0, 0.0, 1.0), (2.0, 2.0, 2.0))
    assert box_distances(np.array([[0.5, 0.5, 1.0]]), (box,))[0] == 0.0
    assert np.isinf(box_distances(np.zeros((1, 3)), ()))[0]


def test_four_numbers_are_a_start_in_the_air(town):
    assert parse_start_pose("210,40,12,-1.5", town, radius=RADIUS) == (210.0, 40.0, 12.0, -1.5)
    assert parse_start("210,40,12,-1.5", town, radius=RADIUS) == (210.0, 40.0, -1.5)
    assert parse_start_pose("210,40,0.5", town, radius=RADIUS) == (210.0, 40.0, 0.0, 0.5)


def test_a_start_over_a_roof_is_free_and_one_in_a_house_is_not(town):
    church = town.object("church").boxes[0]
    x, y, _ = church.center
    top = max(box.center[2] + box.size[2] / 2 for box in town.object("church").boxes[:4])
    parse_start_pose(f"{x},{y},{top + 1.0},0", town, radius=RADIUS)
    with pytest.raises(TaskError, match="inside church") as error:
        parse_start_pose(f"{x},{y},5,0", town, radius=RADIUS)
    free = float(re.search(r"it, (\S+) m is free", str(error.value)).group(1))
    assert nearest_solid(town, (x, y, free))[1] >= RADIUS
    parse_start_pose(f"{x},{y},{free},0", town, radius=RADIUS)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("210,40,x,0", "is not X,Y,Z,YAW"),
        ("210,40,nan,0", "is not X,Y,Z,YAW"),
        ("2100,40,10,0", "outside the world 'town'"),
        ("210,40,900,0", "outside the world 'town'"),
        ("210,40,0.2,0", r"only 0\.20 m from the ground"),
        ("210,40,-3,0", "inside the ground"),
        ("1,2,3,4,5", "is not X,Y,YAW"),
    ],
)
def test_bad_starts_name_value_and_remedy(town, text, message):
    with pytest.raises(TaskError, match=message):
        parse_start_pose(text, town, radius=RADIUS)


def test_who_does_not_fly_starts_on_the_ground(town):
    with pytest.raises(TaskError, match="choose X,Y,YAW, or an aircraft"):
        parse_start_pose("210,40,12,0", town, radius=RADIUS, climbs=False)
    assert parse_start_pose("210,40,0.5", town, radius=RADIUS, climbs=False)[2] == 0.0


def test_rooms_have_no_starts_in_the_air():
    with pytest.raises(TaskError, match="no floor lies at height 1"):
        parse_start_pose("2.9,7.4,1.0,0.0", load_world("flat"), radius=0.36)
