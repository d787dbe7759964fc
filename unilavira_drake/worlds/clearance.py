"""How far points of the floor are from whatever would stop a robot."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.stairwell import opening_boxes
from unilavira_drake.worlds.world import Box, Room, World

ROBOT_HEIGHTS = (0.03, 1.5)
"""Boxes wholly outside these heights (a lintel) stop no robot on the floor, metres."""


def obstacles(world: World, elevation: float = 0.0) -> tuple[tuple[str, Box], ...]:
    """Returns the boxes that stop a robot on the floor, each with the name of its thing.

    Args:
        world: its walls and things; openings in an upper floor stop a robot, too.
        elevation: height of the floor of one of its storeys, metres.
    """
    named = [("wall", box) for box in world.walls]
    named += [(thing.name, box) for thing in world.objects if thing.solid for box in thing.boxes]
    for stairs in world.stairs:
        if stairs.top == elevation:
            named += [(stairs.name, box) for box in opening_boxes(stairs)]
    low, high = (elevation + height for height in ROBOT_HEIGHTS)
    return tuple(
        (name, box)
        for name, box in named
        if box.center[2] + box.size[2] / 2 > low and box.center[2] - box.size[2] / 2 < high
    )


def clearance(
    world: World, p_WP: NDArray[np.float64], elevation: float = 0.0
) -> NDArray[np.float64]:
    """Returns the distance from floor points to the nearest obstacle; 0 inside one.

    Args:
        world: its walls and things.
        p_WP: (k, 2) float64, metres in the world.
        elevation: height of the floor, metres.

    Returns:
        (k,) float64, metres.
    """
    return _distances(p_WP, (box for _, box in obstacles(world, elevation)))


def nearest_obstacle(world: World, x: float, y: float, elevation: float = 0.0) -> tuple[str, float]:
    """Returns the name of the thing nearest to a floor point and its distance, metres."""
    point = np.array([[x, y]])
    return min(
        ((name, float(_distances(point, (box,))[0])) for name, box in obstacles(world, elevation)),
        key=lambda found: found[1],
        default=("nothing", math.inf),
    )


def room_grid(room: Room, step: float) -> NDArray[np.float64]:
    """Returns (k, 2) float64 points on a grid in a room, row by row from its lower corner."""
    x_min, y_min, x_max, y_max = room.rectangle
    x = np.arange(x_min + step / 2, x_max, step)
    y = np.arange(y_min + step / 2, y_max, step)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _distances(p_WP: NDArray[np.float64], boxes: Iterable[Box]) -> NDArray[np.float64]:
    nearest = np.full(len(p_WP), np.inf)
    for box in boxes:
        c, s = math.cos(box.yaw), math.sin(box.yaw)
        offset = p_WP - np.array(box.center[:2])
        along = np.abs(offset @ np.array([c, s])) - box.size[0] / 2
        across = np.abs(offset @ np.array([-s, c])) - box.size[1] / 2
        nearest = np.minimum(nearest, np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)))
    return nearest
