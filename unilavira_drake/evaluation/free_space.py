"""The floor on which a robot can stand, and geodesic distances over it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from unilavira_drake.errors import TaskError
from unilavira_drake.messages import Message, read_only
from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.world import World


@dataclass(frozen=True, eq=False)
class FreeSpace(Message):
    """Cells whose centre keeps the robot's radius clear of everything, in one connected piece."""

    resolution: float = 0.05
    """Side of a cell, metres."""
    origin: tuple[float, float] = (0.0, 0.0)
    """World (x0, y0) of the corner of cell (0, 0), metres."""
    free: NDArray[np.bool_] = field(default_factory=lambda: np.ones((1, 1), np.bool_))
    """(rows, columns) bool; row i covers y, column j covers x, as in ``OccupancyMap``."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "free", read_only(self.free))

    def centers(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Returns the (k, 2) world points of (k, 2) cells (row, column), metres."""
        points: NDArray[np.float64] = (cells[:, ::-1] + 0.5) * self.resolution
        return points + np.array(self.origin)


def free_space(world: World, *, radius: float, resolution: float = 0.05) -> FreeSpace:
    """Returns the floor of the rooms on which a robot of this radius can stand.

    Of several pieces that are not connected the largest is taken: a robot that stands in it
    never sees the others.

    Raises:
        TaskError: if there is no such floor.
    """
    x_min, y_min = (min(room.rectangle[i] for room in world.rooms) for i in (0, 1))
    x_max, y_max = (max(room.rectangle[i] for room in world.rooms) for i in (2, 3))
    shape = (
        math.ceil((y_max - y_min) / resolution - 1e-9),
        math.ceil((x_max - x_min) / resolution - 1e-9),
    )
    space = FreeSpace(resolution, (x_min, y_min), np.ones(shape, np.bool_))
    points = space.centers(np.argwhere(space.free))
    indoors = np.zeros(len(points), np.bool_)
    for room in world.rooms:
        low, high = np.array(room.rectangle[:2]), np.array(room.rectangle[2:])
        indoors |= ((points >= low) & (points < high)).all(axis=1)
    clear = (indoors & (clearance(world, points) >= radius)).reshape(shape)
    pieces, count = ndimage.label(clear)
    if count == 0:
        raise TaskError(
            f"world {world.name!r}: no floor for a robot of radius {radius:.2f} m; "
            "widen the rooms or choose a smaller robot."
        )
    largest = 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    return FreeSpace(resolution, space.origin, pieces == largest)


@dataclass(frozen=True, eq=False)
class GeodesicField(Message):
    """Shortest distance over free floor from every cell to a set of source cells."""

    space: FreeSpace = FreeSpace()
    metres: NDArray[np.float64] = field(default_factory=lambda: np.zeros((1, 1)))
    """(rows, columns) float64; inf where the robot cannot stand."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "metres", read_only(self.metres))

    def distance(self, x: float, y: float, *, slack: float = 0.4) -> float:
        """Returns the geodesic distance from a floor point, metres.

        Between four free cells it is interpolated.  Elsewhere, a point within ``slack`` of free
        floor gets the straight way to it added; a point farther away has no distance (inf).
        """
        resolution = self.space.resolution
        u = (x - self.space.origin[0]) / resolution - 0.5
        v = (y - self.space.origin[1]) / resolution - 0.5
        if not (math.isfinite(u) and math.isfinite(v)):
            return math.inf
        row, column = math.floor(v), math.floor(u)
        rows, columns = self.metres.shape
        if 0 <= row < rows - 1 and 0 <= column < columns - 1:
            (a, b), (c, d) = self.metres[row : row + 2, column : column + 2].tolist()
            s, t = u - column, v - row
            value = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d)
            if math.isfinite(value):
                return float(value)
        return self._beside(row, column, u, v, slack / resolution) * resolution

    def _beside(self, row: int, column: int, u: float, v: float, slack: float) -> float:
        """Least value of a cell plus the straight way to it, in cells."""
        reach = math.ceil(slack)
        row_0, column_0 = max(row - reach, 0), max(column - reach, 0)
        window = self.metres[row_0 : max(row + reach + 2, 0), column_0 : max(column + reach + 2, 0)]
        cells_v, cells_u = np.ogrid[: window.shape[0], : window.shape[1]]
        way = np.hypot(cells_v + row_0 - v, cells_u + column_0 - u)
        total = np.where(way <= slack, window / self.space.resolution + way, math.inf)
        return float(total.min(initial=math.inf))


def geodesic_field(space: FreeSpace, source_cells: NDArray[np.int64]) -> GeodesicField:
    """Returns the field of distances to (k, 2) source cells."""
    cells = distance_field(~space.free, source_cells)
    return GeodesicField(space, np.asarray(cells, np.float64) * space.resolution)
