"""Geodesic distances in a true world, for scoring: free space from boxes, distance to a goal."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message, read_only
from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.planning.polyline import extract_path, length

Polygon = Sequence[tuple[float, float]]
"""Corners of a convex polygon in order, metres."""


@dc.dataclass(frozen=True, eq=False)
class FreeSpace(Message):
    """Where a disc fits: cell (row i, column j) covers x in [x0 + j r, x0 + (j + 1) r)."""

    free: NDArray[np.bool_]
    """(rows, columns) bool."""
    origin: tuple[float, float]
    """World (x0, y0) of the corner of cell (0, 0), metres."""
    resolution: float
    """Side of a cell, metres."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "free", read_only(self.free))

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Returns a world point in cell coordinates."""
        return ((x - self.origin[0]) / self.resolution, (y - self.origin[1]) / self.resolution)

    def is_free(self, x: float, y: float) -> bool:
        """Whether a world point lies in a free cell of the grid."""
        column, row = self.point(x, y)
        i, j = math.floor(row), math.floor(column)
        rows, columns = self.free.shape
        return 0 <= i < rows and 0 <= j < columns and bool(self.free[i, j])

    def cells_near(self, polygons: Sequence[Polygon], distance: float) -> NDArray[np.int64]:
        """Returns the (k, 2) free cells whose centres lie within a distance of any polygon."""
        near = np.zeros(self.free.shape, np.bool_)
        _mark(near, polygons, self.origin, self.resolution, distance)
        return np.argwhere(near & self.free)


def rasterize(
    polygons: Sequence[Polygon],
    *,
    bounds: tuple[float, float, float, float],
    resolution: float,
    inflation: float,
) -> FreeSpace:
    """Returns the cells whose centres are farther than ``inflation`` from every polygon.

    Distances to the polygons are exact, so corners are inflated round.

    Args:
        polygons: footprints of walls and things.
        bounds: (x_min, y_min, x_max, y_max) of the grid, metres; cells stick to multiples of the
            resolution.
        resolution: side of a cell, metres.
        inflation: radius of the disc that must fit, metres.
    """
    j0, i0 = math.floor(bounds[0] / resolution), math.floor(bounds[1] / resolution)
    j1, i1 = math.ceil(bounds[2] / resolution), math.ceil(bounds[3] / resolution)
    origin = (j0 * resolution, i0 * resolution)
    taken = np.zeros((i1 - i0, j1 - j0), np.bool_)
    _mark(taken, polygons, origin, resolution, inflation)
    return FreeSpace(np.logical_not(taken), origin, resolution)


@dc.dataclass(frozen=True, eq=False)
class GeodesicField(Message):
    """Shortest way over free space from any point to the nearest of the goal cells."""

    space: FreeSpace
    times: NDArray[np.float64]
    """(rows, columns) float64, distance in cells; inf where unreachable."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", read_only(self.times))

    @staticmethod
    def to_cells(space: FreeSpace, goal_cells: NDArray[np.int64]) -> GeodesicField:
        """Returns the field of (k, 2) goal cells; cells that are not free do not count."""
        return GeodesicField(space, distance_field(np.logical_not(space.free), goal_cells))

    def path(self, x: float, y: float) -> NDArray[np.float64]:
        """Returns the (k, 2) shortest path from a world point to the goal, metres.

        It has no points when the goal is unreachable from there.
        """
        cells = extract_path(
            self.times,
            np.logical_not(self.space.free),
            np.ones(self.times.shape, np.float32),
            self.space.point(x, y),
        )
        points: NDArray[np.float64] = cells * self.space.resolution + self.space.origin
        return points

    def distance(self, x: float, y: float) -> float:
        """Returns the length of the shortest path from a world point, metres; inf without one.

        It is an upper bound: a path of straight pieces, about 0.5 % longer than the shortest.
        """
        points = self.path(x, y)
        return length(points) if len(points) else math.inf


def _mark(
    marked: NDArray[np.bool_],
    polygons: Sequence[Polygon],
    origin: tuple[float, float],
    resolution: float,
    distance: float,
) -> None:
    """Sets the cells whose centres lie within a distance of a polygon, or inside it."""
    for polygon in polygons:
        corners = np.asarray(polygon, np.float64)
        low = np.floor((corners.min(axis=0) - distance - origin) / resolution).astype(int)
        high = np.ceil((corners.max(axis=0) + distance - origin) / resolution).astype(int)
        j0, i0 = np.maximum(low, 0)
        window = marked[i0 : max(high[1], 0), j0 : max(high[0], 0)]
        x = origin[0] + (np.arange(window.shape[1]) + j0 + 0.5) * resolution
        y = origin[1] + (np.arange(window.shape[0]) + i0 + 0.5) * resolution
        window |= _distance_to(corners, x[None, :], y[:, None]) <= distance


def _distance_to(
    corners: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the distance from points to a convex polygon; 0 inside, whatever its sense."""
    squared = np.full(np.broadcast_shapes(x.shape, y.shape), np.inf)
    left = np.ones(squared.shape, np.bool_)
    right = np.ones(squared.shape, np.bool_)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        dx, dy = x1 - x0, y1 - y0
        t = ((x - x0) * dx + (y - y0) * dy) / max(dx * dx + dy * dy, 1e-12)
        t = np.clip(t, 0.0, 1.0)
        squared = np.minimum(squared, (x0 + t * dx - x) ** 2 + (y0 + t * dy - y) ** 2)
        side = dx * (y - y0) - dy * (x - x0)
        left &= side >= 0.0
        right &= side <= 0.0
    found: NDArray[np.float64] = np.where(left | right, 0.0, np.sqrt(squared))
    return found
