"""The floor on which a robot can stand in a true world, and geodesic distances over it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from unilavira_drake.errors import TaskError
from unilavira_drake.planning.geodesic import FreeSpace, GeodesicField, rasterize
from unilavira_drake.worlds.clearance import obstacles
from unilavira_drake.worlds.world import World

SLACK = 0.4
"""A robot this near to free floor is on it: it may brush what its radius keeps clear, metres."""


def free_space(
    world: World, *, radius: float, resolution: float = 0.05, elevation: float = 0.0
) -> FreeSpace:
    """Returns the floor of a storey's rooms on which a robot of this radius can stand.

    Of several pieces that are not connected the largest is taken: a robot that stands in it
    never sees the others.  ``elevation`` is the height of the storey's floor, metres.

    Raises:
        TaskError: if there is no such floor.
    """
    x_min, y_min = (min(room.rectangle[i] for room in world.rooms) for i in (0, 1))
    x_max, y_max = (max(room.rectangle[i] for room in world.rooms) for i in (2, 3))
    space = rasterize(
        [box.corners() for _, box in obstacles(world, elevation)],
        bounds=(x_min, y_min, x_max, y_max),
        resolution=resolution,
        inflation=radius,
    )
    pieces, count = ndimage.label(space.free & in_rooms(space, world, None, elevation))
    if count == 0:
        raise TaskError(
            f"world {world.name!r}: no floor for a robot of radius {radius:.2f} m; "
            "widen the rooms or choose a smaller robot."
        )
    largest = 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    return FreeSpace(pieces == largest, space.origin, space.resolution)


def in_rooms(
    space: FreeSpace,
    world: World,
    names: tuple[str, ...] | None = None,
    elevation: float = 0.0,
) -> NDArray[np.bool_]:
    """Returns (rows, columns) bool: cells whose centres lie in the named rooms, or in any.

    Only the rooms of the storey whose floor is at ``elevation`` count, metres.
    """
    rows, columns = space.free.shape
    x = space.origin[0] + (np.arange(columns) + 0.5) * space.resolution
    y = space.origin[1] + (np.arange(rows) + 0.5) * space.resolution
    inside = np.zeros((rows, columns), np.bool_)
    for room in world.rooms:
        if room.elevation == elevation and (names is None or room.name in names):
            x_min, y_min, x_max, y_max = room.rectangle
            inside |= np.outer((y >= y_min) & (y < y_max), (x >= x_min) & (x < x_max))
    return inside


def centers(space: FreeSpace, cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns the (k, 2) world points of (k, 2) cells (row, column), metres."""
    points: NDArray[np.float64] = np.array(space.origin) + (cells[:, ::-1] + 0.5) * space.resolution
    return points


def path_distance(field: GeodesicField, x: float, y: float) -> float:
    """Returns the length of the shortest path from a floor point, metres; inf without one.

    It is 0 in every goal cell.  Beside free floor, the straight way to it is added; see ``SLACK``.
    """
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.inf
    if field.space.is_free(x, y):
        u, v = field.space.point(x, y)
        return 0.0 if field.times[math.floor(v), math.floor(u)] == 0.0 else field.distance(x, y)
    way, row, column = _onto_floor(field, x, y)
    if math.isinf(way):
        return math.inf
    (center,) = centers(field.space, np.array([[row, column]]))
    return way + field.distance(float(center[0]), float(center[1]))


def quick_distance(field: GeodesicField, x: float, y: float) -> float:
    """Returns :func:`path_distance`, a few percent longer and thirty times as fast, for every tick.

    It is interpolated in the first-order field between four free cells.
    """
    u, v = field.space.point(x, y)
    u, v = u - 0.5, v - 0.5
    if not (math.isfinite(u) and math.isfinite(v)):
        return math.inf
    row, column = math.floor(v), math.floor(u)
    rows, columns = field.times.shape
    if 0 <= row < rows - 1 and 0 <= column < columns - 1:
        (a, b), (c, d) = field.times[row : row + 2, column : column + 2].tolist()
        s, t = u - column, v - row
        value: float = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d)
        if math.isfinite(value):
            return value * field.space.resolution
    way, row, column = _onto_floor(field, x, y)
    return (
        way if math.isinf(way) else way + float(field.times[row, column]) * field.space.resolution
    )


def _onto_floor(field: GeodesicField, x: float, y: float) -> tuple[float, int, int]:
    """The cell over which the way to the goal is shortest, and the straight way to it, metres."""
    u, v = field.space.point(x, y)
    slack = SLACK / field.space.resolution
    reach = math.ceil(slack)
    row_0, column_0 = (max(math.floor(w) - reach, 0) for w in (v, u))
    row_1, column_1 = (max(math.floor(w) + reach + 1, 0) for w in (v, u))
    window = field.times[row_0:row_1, column_0:column_1]
    cells_v, cells_u = np.ogrid[: window.shape[0], : window.shape[1]]
    way = np.hypot(cells_v + (row_0 + 0.5 - v), cells_u + (column_0 + 0.5 - u))
    total = np.where(way <= slack, window + way, math.inf)
    if not np.isfinite(total).any():
        return math.inf, 0, 0
    i, j = np.unravel_index(int(np.argmin(total)), total.shape)
    return float(way[i, j]) * field.space.resolution, int(i) + row_0, int(j) + column_0
