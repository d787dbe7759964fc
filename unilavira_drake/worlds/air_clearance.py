"""How far points in the air are from whatever is solid."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.world import Box, World


def solids(world: World) -> tuple[tuple[str, Box], ...]:
    """Returns every solid box of a world with the name of its thing; the ground is none of them."""
    named = [("wall", box) for box in world.walls]
    named += [(thing.name, box) for thing in world.objects if thing.solid for box in thing.boxes]
    return tuple(named)


def box_distances(p_WP: NDArray[np.float64], boxes: Iterable[Box]) -> NDArray[np.float64]:
    """Returns the distance from points to the nearest of some boxes; 0 inside one.

    Args:
        p_WP: (k, 3) float64, metres in the world.
        boxes: turned about the vertical.

    Returns:
        (k,) float64, metres; inf without boxes.
    """
    nearest = np.full(len(p_WP), np.inf)
    for box in boxes:
        gaps = np.maximum(np.abs(_in_box(p_WP, box)) - np.array(box.size) / 2, 0.0)
        nearest = np.minimum(nearest, np.sqrt((gaps**2).sum(axis=1)))
    return nearest


def nearest_on(box: Box, p_WP: tuple[float, float, float]) -> tuple[float, float, float]:
    """Returns the point of a box that is nearest to a point, metres in the world."""
    half = np.array(box.size) / 2
    inside = np.clip(_in_box(np.array([p_WP]), box)[0], -half, half)
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    a, b, height = (float(value) for value in inside)
    x, y, z = box.center
    return x + c * a - s * b, y + s * a + c * b, z + height


def nearest_solid(world: World, p_WP: tuple[float, float, float]) -> tuple[str, float]:
    """Returns the name of what is nearest to a point and its distance, metres."""
    point = np.array([p_WP])
    found = [(name, float(box_distances(point, (box,))[0])) for name, box in solids(world)]
    return min([*found, ("the ground", max(p_WP[2], 0.0))], key=lambda pair: pair[1])


def _in_box(p_WP: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """Returns points in the frame of a box."""
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    turned: NDArray[np.float64] = (p_WP - np.array(box.center)) @ np.array(
        [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    )
    return turned
