"""The furnished worlds are fair and light enough: every way is open, every task far enough."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import cv2
import numpy as np
import pytest

from unilavira_drake import load_scenario
from unilavira_drake.evaluation.scoring import make_goal_field, shortest_path
from unilavira_drake.scenario import Scenario
from unilavira_drake.worlds.furniture_library import furniture_models
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import scenery_triangles
from unilavira_drake.worlds.start import parse_start
from unilavira_drake.worlds.world import Box, Placement, World, WorldObject

HOMES = {"apartment": (12, 10, 60), "office": (6, 10, 60)}
"""World -> named tasks, rooms beside the corridor, pieces of furniture at least."""


@pytest.fixture(scope="module", params=HOMES)
def home(request: pytest.FixtureRequest) -> tuple[Scenario, World]:
    scenario = load_scenario(request.param)
    return scenario, load_world(scenario.world.name)


def pieces(world: World) -> list[WorldObject]:
    return [thing for thing in world.objects if isinstance(thing.visual, Placement)]


def test_it_is_furnished_and_not_too_heavy(home: tuple[Scenario, World]) -> None:
    scenario, world = home
    tasks, rooms, furniture = HOMES[world.name]
    assert len(scenario.tasks) == tasks
    assert len(world.rooms) > rooms
    assert len(pieces(world)) >= furniture
    assert scenery_triangles(world) <= 100_000
    for thing in world.objects:
        assert all((thing.name, thing.category, thing.color, thing.room))


def test_nothing_stands_in_anything_else(home: tuple[Scenario, World]) -> None:
    _, world = home
    solid = [thing for thing in world.objects if thing.solid]
    for a, b in combinations(solid, 2):
        overlap = max(common(x, y) for x in a.boxes for y in b.boxes)
        assert overlap < 0.02, f"{a.name} and {b.name} share {overlap:.3f} square metres"


def common(a: Box, b: Box) -> float:
    """Returns the area that two boxes share seen from above, if they share a height."""
    low = max(x.center[2] - x.size[2] / 2 for x in (a, b))
    high = min(x.center[2] + x.size[2] / 2 for x in (a, b))
    if high - low < 0.02:
        return 0.0
    corners: list[Any] = [np.array(x.corners(), np.float32) for x in (a, b)]
    area, _ = cv2.intersectConvexConvex(*corners)
    return float(area)


def test_every_task_is_a_way_of_eight_metres(home: tuple[Scenario, World]) -> None:
    scenario, world = home
    for name, task in scenario.tasks.items():
        x, y, _ = parse_start(task.start, world, radius=scenario.robot.turning_radius)
        goal = make_goal_field(task.goal, world, radius=scenario.robot.radius)
        assert shortest_path(goal, x, y) >= 8.0, name
        start = world.room_at(x, y)
        assert start is not None
        assert all(start.name not in target.rooms for target in goal.targets), name
        assert len(task.text.split()) <= 130


def test_every_room_can_be_reached(home: tuple[Scenario, World]) -> None:
    scenario, world = home
    x, y, _ = parse_start(scenario.start, world, radius=scenario.robot.turning_radius)
    for room in world.rooms:
        goal = make_goal_field(room.name, world, radius=0.45)
        assert np.isfinite(shortest_path(goal, x, y)), room.name


def test_models_stand_where_their_boxes_are(home: tuple[Scenario, World]) -> None:
    _, world = home
    for thing in pieces(world):
        visual = thing.visual
        assert isinstance(visual, Placement)
        size = furniture_models()[visual.model].size
        corners = np.array([corner for box in thing.boxes for corner in box.corners()])
        c, s = np.cos(visual.yaw), np.sin(visual.yaw)
        own = (corners - np.array(visual.position[:2])) @ np.array([[c, -s], [s, c]])
        assert np.all(np.abs(own) <= np.array(size[:2]) / 2 + 0.03), thing.name
