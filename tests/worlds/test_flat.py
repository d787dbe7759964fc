"""The flat is a fair place: every way is wide, every task far and its start free."""

import heapq

import numpy as np
import pytest
import yaml

from unilavira_drake.resources import models_path
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.load import load_world

STEP = 0.1
RADIUS = 0.36
SHAPE = (100, 130)


def tasks():
    text = (models_path() / "scenarios" / "flat.yaml").read_text()
    return yaml.safe_load(text)["tasks"]


@pytest.fixture(scope="module")
def world():
    return load_world("flat")


@pytest.fixture(scope="module")
def distances(world):
    rows, columns = np.indices(SHAPE)
    points = (np.stack((columns, rows), -1).reshape(-1, 2) + 0.5) * STEP
    return clearance(world, points).reshape(SHAPE)


def reach(free, row, column):
    """Lengths of 8-connected shortest paths, metres (never shorter than the true ones / 1.09)."""
    lengths = np.full(free.shape, np.inf)
    lengths[row, column] = 0.0
    queue = [(0.0, row, column)]
    while queue:
        length, i, j = heapq.heappop(queue)
        if length > lengths[i, j]:
            continue
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                a, b = i + di, j + dj
                new = length + STEP * np.hypot(di, dj)
                # The grid's edge lies in the outer walls, so no index leaves it.
                if free[a, b] and new < lengths[a, b] - 1e-12:
                    lengths[a, b] = new
                    heapq.heappush(queue, (new, a, b))
    return lengths


@pytest.mark.parametrize("radius", [RADIUS, 0.45])
def test_all_rooms_are_joined_by_ways_of_twice_the_radius(world, distances, radius):
    lengths = reach(distances >= radius, 49, 60)
    for room in world.rooms:
        x_min, y_min, x_max, y_max = (round(value / STEP) for value in room.rectangle)
        part = np.isfinite(lengths[y_min:y_max, x_min:x_max])
        assert part.sum() * STEP**2 > 3.0, room.name


@pytest.mark.parametrize("name", sorted(tasks()))
def test_tasks_start_free_and_end_far_in_another_room(world, distances, name):
    task = tasks()[name]
    x, y, _ = (float(part) for part in task["start"].split(","))
    assert clearance(world, np.array([[x, y]]))[0] >= 0.5
    goal = world.object(task["goal"])
    assert world.room_at(x, y).name != goal.room
    lengths = reach(distances >= RADIUS, int(y / STEP), int(x / STEP))
    x_min, y_min, x_max, y_max = world.room(goal.room).rectangle
    corners = np.array([corner for box in goal.boxes for corner in box.corners()])
    low, high = corners.min(0), corners.max(0)
    rows, columns = np.nonzero(np.isfinite(lengths))
    points = (np.stack((columns, rows), -1) + 0.5) * STEP
    gap = np.hypot(*(np.maximum(0, np.maximum(low - points, points - high))).T)
    inside = np.all((points > (x_min, y_min)) & (points < (x_max, y_max)), axis=1)
    near = inside & (gap < 0.6)
    assert near.any()
    assert (lengths[rows, columns][near] / 1.09).min() >= 6.0
