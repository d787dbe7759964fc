"""The map of furnished rooms beside their true geometry, by a camera that is carried through."""

import dataclasses as dc
import math

import cv2
import numpy as np
import pytest
from rendered_rooms import LENS, Camera, geometry, load_rooms, without

from unilavira_drake.mapping.depth_scan import LIMIT
from unilavira_drake.mapping.occupancy import MappingParameters, integrate
from unilavira_drake.messages import OccupancyMap

PARAMETERS = MappingParameters(stride=3)
ROOMS = {
    # Furniture of boxes, and models with thin legs.
    "flat": (("study", "dining_room"), ((6.5, 7.2), (10.2, 7.0), (8.2, 6.6), (10.0, 9.5))),
    "apartment": (("dining_room",), ((11.3, 3.9), (13.9, 4.2), (11.2, 1.6))),
}


def mapped(views, start=None, parameters=PARAMETERS):
    occupancy = start or OccupancyMap()
    for view in views:
        x, y = view.X_WC[:2, 3].tolist()
        occupancy = integrate(
            occupancy, [view], parameters=parameters, position=(x, y), floor_height=0.0,
            n=1, time=0.0,
        )  # fmt: skip
    return occupancy


def cells_of(occupancy, points):
    """Marks the cells that hold points (k, 2 or 3), metres."""
    column, row = np.floor((points[:, :2] - occupancy.origin) / occupancy.resolution).astype(int).T
    rows, columns = occupancy.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    marks = np.zeros(occupancy.shape, np.bool_)
    marks[row[inside], column[inside]] = True
    return marks


def obstacles(occupancy, world):
    """Marks the cells with anything solid at the robot's height, and those beside them."""
    points = geometry(world)
    low, high = PARAMETERS.min_height, PARAMETERS.max_height
    solid = cells_of(occupancy, points[(points[:, 2] >= low) & (points[:, 2] <= high)])
    beside = cv2.dilate(solid.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return solid, beside


def floor_in_view(occupancy, world, looks):
    """Marks the cells of which the pictures show floor."""
    floors = [label for label, entry in world.labels.items() if entry.room_kind]
    marks = np.zeros(occupancy.shape, np.bool_)
    for view, labels in looks:
        v, u = np.nonzero(np.isin(labels, floors) & (view.depth > 0) & np.isfinite(view.depth))
        d = view.depth[v, u].astype(float)
        p_C = np.stack(((u - LENS.cx) / LENS.fx * d, (v - LENS.cy) / LENS.fy * d, d), 1)
        p_W = p_C @ view.X_WC[:3, :3].T + view.X_WC[:3, 3]
        away = np.hypot(*(p_W[:, :2] - view.X_WC[:2, 3]).T)
        marks |= cells_of(occupancy, p_W[away < PARAMETERS.max_range - 0.05])
    return marks


def in_sight(occupancy, solid, position, cells):
    """Which of some cells no obstacle hides from a place on the plan."""
    j, i = (np.array(position) - occupancy.origin) / occupancy.resolution
    share = np.linspace(0.0, 1.0, 400)[:, None]
    rows = np.floor(i + share * (cells[:, 0] + 0.5 - i)).astype(int)
    columns = np.floor(j + share * (cells[:, 1] + 0.5 - j)).astype(int)
    return ~solid[rows, columns].any(axis=0)


@pytest.mark.parametrize("name", ROOMS)
def test_the_map_is_the_rooms_true_geometry(name):
    rooms, places = ROOMS[name]
    world = load_rooms(name, rooms)
    camera = Camera(world)
    looks = [look for place in places for look in camera.look_around(*place)]
    occupancy = mapped([view for view, _ in looks])
    solid, beside = obstacles(occupancy, world)
    occupied = occupancy.log_odds > 0
    assert occupied.sum() > 1000
    assert np.mean(beside[occupied]) >= 0.99
    # Floor in sight, neither behind furniture over which the camera looks nor half under it.
    cells = np.argwhere(floor_in_view(occupancy, world, looks) & ~solid)
    seen = np.any([in_sight(occupancy, solid, place, cells) for place in places], axis=0)
    free = occupancy.log_odds[tuple(cells.T)] < 0
    assert seen.sum() > 3000
    assert np.mean(free[seen]) >= 0.97
    apart = seen & ~beside[tuple(cells.T)]
    assert apart.sum() > 0.8 * seen.sum()
    assert np.mean(free[apart]) >= 0.98


@pytest.mark.parametrize(("free_step", "before", "looks"), [(4, 1, 3), (4, 12, 10), (LIMIT, 12, 1)])
def test_a_removed_chair_is_gone(free_step, before, looks):
    world = load_rooms("flat", ("dining_room",))
    chair = world.object("chair_2")
    points = geometry(dc.replace(world, walls=(), objects=(chair,)))
    place = (10.2, 6.8)
    yaw = math.atan2(*(points[:, :2].mean(axis=0) - place)[::-1])
    full, empty = (
        Camera(rooms).look(*place, yaw)[0] for rooms in (world, without(world, "chair_2"))
    )
    parameters = dc.replace(PARAMETERS, free_step=free_step)
    occupancy = mapped([full] * before, parameters=parameters)
    marks = cells_of(occupancy, points)
    for count in range(looks + 1):
        there = np.sum(occupancy.log_odds[marks] > 0)
        assert there == 0 if count == looks else there > 40
        occupancy = mapped([empty], occupancy, parameters)
