"""Where the robot may drive: the occupancy map, inflated, with a preference for open space."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning.fast_marching import MAX_SLOWNESS
from unilavira_drake.planning.near_obstacles import near_distance

MARGIN = 1.0
"""Unknown floor around the known cells that may be driven through, metres."""

COMFORT = 0.25
"""Clearance beyond the turning radius at which open space costs nothing extra, metres."""

NEAR_SLOWNESS = 2.0
"""Extra slowness at the least clearance; falls with the square of the distance to comfort."""

UNKNOWN_SLOWNESS = 0.5
"""Extra slowness of cells never seen: the known way is preferred, an unknown one is tried."""


@dataclass(frozen=True, eq=False)
class NavigationGrid:
    """A window of the map around the known cells, for one robot; all arrays (rows, columns)."""

    resolution: float
    """Side of a cell, metres."""
    origin: tuple[float, float]
    """World (x0, y0) of the corner of cell (0, 0), metres."""
    log_odds: NDArray[np.int8]
    """int8; 0 unknown, negative free, positive occupied."""
    clearance: NDArray[np.float32]
    """float32, metres from a cell's centre to the nearest occupied cell; inf where none is near
    enough to matter to this robot."""
    blocked: NDArray[np.bool_]
    """bool: the robot's centre may not be here."""
    slowness: NDArray[np.float32]
    """float32 in [1, 7]."""

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Returns a world point in cell coordinates."""
        return ((x - self.origin[0]) / self.resolution, (y - self.origin[1]) / self.resolution)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Returns (row, column) of a world point; it may lie outside the window."""
        column, row = self.point(x, y)
        return (math.floor(row), math.floor(column))

    def contains(self, cell: tuple[int, int]) -> bool:
        """Whether a cell lies in the window."""
        rows, columns = self.blocked.shape
        return bool(0 <= cell[0] < rows and 0 <= cell[1] < columns)

    def center(self, cell: tuple[int, int]) -> tuple[float, float]:
        """Returns the world (x, y) of a cell's centre, metres."""
        return (
            self.origin[0] + (cell[1] + 0.5) * self.resolution,
            self.origin[1] + (cell[0] + 0.5) * self.resolution,
        )

    def reachable(self, cell: tuple[int, int]) -> NDArray[np.bool_]:
        """Returns the cells that can be reached from a cell over four neighbours."""
        found = np.zeros(self.blocked.shape, np.bool_)
        if not self.blocked[cell]:
            _flood(frozen_view(self.blocked, np.bool_), int(cell[0]), int(cell[1]), found)
        return found


def make_navigation_grid(
    occupancy: OccupancyMap,
    *,
    position: tuple[float, float],
    targets: Sequence[tuple[float, float]],
    radius: float,
    turning_radius: float,
) -> NavigationGrid:
    """Returns the window of a map in which a robot plans.

    A cell is blocked when an occupied cell is nearer than ``radius``.  Unknown cells are free
    with a little more slowness.  A robot that stands in a blocked cell may leave it: around it,
    cells no nearer to an obstacle than it is now are free at the greatest slowness.

    Args:
        occupancy: the map.
        position: (x, y) of the robot, metres; in the window, whatever is known.
        targets: (x, y) of further points to keep in the window, metres.
        radius: radius that must be free around the robot's centre, metres.
        turning_radius: radius it sweeps when it turns in place, metres.
    """
    log_odds, origin = _window(occupancy, [position, *targets])
    comfort = max(turning_radius, radius) + COMFORT
    resolution = occupancy.resolution
    # First the distance in cells between centres; large arrays are filled in place, for every page
    # of fresh memory costs.
    clearance = near_distance(log_odds, math.ceil(comfort / resolution + 0.5))
    blocked = np.empty(log_odds.shape, np.bool_)
    slowness = np.empty(log_odds.shape, np.float32)
    _fill(frozen_view(log_odds, np.int8), resolution, radius, comfort, clearance, blocked, slowness)
    grid = NavigationGrid(resolution, origin, log_odds, clearance, blocked, slowness)
    cell = grid.cell(*position)
    if blocked[cell]:
        _open_way_out(grid, cell, 2.0 * radius)
    return grid


def path_is_blocked(
    occupancy: OccupancyMap,
    p_WP: NDArray[np.float64],
    *,
    position: tuple[float, float],
    radius: float,
) -> bool:
    """Returns whether an occupied cell is nearer than ``radius`` to the rest of a path.

    Obstacles to which the robot already stands that near are no news, and do not count.
    """
    points = (p_WP - np.array(occupancy.origin)) / occupancy.resolution
    return bool(
        _touches(
            frozen_view(occupancy.log_odds, np.int8),
            frozen_view(points, np.float64),
            (position[0] - occupancy.origin[0]) / occupancy.resolution,
            (position[1] - occupancy.origin[1]) / occupancy.resolution,
            radius / occupancy.resolution,
        )
    )


def _window(
    occupancy: OccupancyMap, points: Sequence[tuple[float, float]]
) -> tuple[NDArray[np.int8], tuple[float, float]]:
    """Returns the known cells and the given points with a margin, and the window's corner."""
    cells = [occupancy.cell(x, y) for x, y in points]
    top, bottom, left, right = _known(frozen_view(occupancy.log_odds, np.int8))
    if bottom >= top:
        cells += [(top, left), (bottom, right)]
    margin = math.ceil(MARGIN / occupancy.resolution)
    i0, i1 = min(c[0] for c in cells) - margin, max(c[0] for c in cells) + margin + 1
    j0, j1 = min(c[1] for c in cells) - margin, max(c[1] for c in cells) + margin + 1
    log_odds = np.zeros((i1 - i0, j1 - j0), np.int8)
    inner = occupancy.log_odds[max(i0, 0) : max(i1, 0), max(j0, 0) : max(j1, 0)]
    i, j = max(-i0, 0), max(-j0, 0)
    log_odds[i : i + inner.shape[0], j : j + inner.shape[1]] = inner
    x0, y0 = occupancy.origin
    return log_odds, (x0 + j0 * occupancy.resolution, y0 + i0 * occupancy.resolution)


def _open_way_out(grid: NavigationGrid, cell: tuple[int, int], reach: float) -> None:
    """Frees the cells around a robot in a blocked cell that lead away from the obstacle."""
    cells = math.ceil(reach / grid.resolution)
    i0, j0 = max(cell[0] - cells, 0), max(cell[1] - cells, 0)
    around = np.s_[i0 : cell[0] + cells + 1, j0 : cell[1] + cells + 1]
    rows, columns = np.ogrid[around]
    near = (rows - cell[0]) ** 2 + (columns - cell[1]) ** 2 <= cells**2
    # Half a cell of tolerance: neighbours of equal clearance differ by rounding.
    least = grid.clearance[cell] - 0.5 * grid.resolution
    way_out = near & grid.blocked[around] & (grid.clearance[around] >= least)
    grid.blocked[around][way_out] = False
    grid.slowness[around][way_out] = MAX_SLOWNESS


@kernel
def _known(log_odds: NDArray[np.int8]) -> tuple[int, int, int, int]:
    """Returns the first and last row and column with a known cell; none is (.., -1, .., -1)."""
    rows, columns = log_odds.shape
    top, bottom, left, right = rows, -1, columns, -1
    for i in range(rows):
        any_known = np.int8(0)
        for j in range(columns):
            any_known |= log_odds[i, j]
        if any_known == 0:
            continue
        top, bottom = min(top, i), i
        j = 0
        while j < left and log_odds[i, j] == 0:
            j += 1
        left = min(left, j)
        j = columns - 1
        while j > right and log_odds[i, j] == 0:
            j -= 1
        right = max(right, j)
    return top, bottom, left, right


@kernel
def _flood(blocked: NDArray[np.bool_], row: int, column: int, found: NDArray[np.bool_]) -> None:
    """Sets the cells that are connected with a free one: runs of rows, joined where they touch."""
    rows, columns = blocked.shape
    runs = np.empty((4 * rows + columns, 3), np.int32)
    first_of_row = np.zeros(rows + 1, np.int64)
    n, above, seed = 0, 0, -1
    for i in range(rows):
        if n + columns // 2 + 1 > len(runs):
            longer = np.empty((2 * len(runs) + columns, 3), np.int32)
            longer[:n] = runs[:n]
            runs = longer
        begin = n
        n = _add_runs(blocked[i], runs, n)
        for k in range(begin, n):
            # Runs of the row before that end left of this one touch none that follow, either.
            while above < begin and runs[above, 1] <= runs[k, 0]:
                above += 1
            other = above
            while other < begin and runs[other, 0] < runs[k, 1]:
                _join(runs, other, k)
                other += 1
            if i == row and runs[k, 0] <= column < runs[k, 1]:
                seed = k
        above = begin
        first_of_row[i + 1] = n
    root = _root(runs, seed)
    for i in range(rows):
        for k in range(first_of_row[i], first_of_row[i + 1]):
            if _root(runs, k) == root:
                found[i, runs[k, 0] : runs[k, 1]] = True


@kernel
def _add_runs(blocked: NDArray[np.bool_], runs: NDArray[np.int32], n: int) -> int:
    """Adds (first, after, itself) of each run of free cells of a row; returns their number."""
    was_blocked = True
    for j in range(len(blocked)):
        if blocked[j] != was_blocked:
            was_blocked = not was_blocked
            if was_blocked:
                runs[n, 1] = j
                n += 1
            else:
                runs[n, 0], runs[n, 2] = j, n
    if not was_blocked:
        runs[n, 1] = len(blocked)
        n += 1
    return n


@kernel
def _root(runs: NDArray[np.int32], k: int) -> int:
    """Returns the run that stands for all that are joined with one."""
    while runs[k, 2] != k:
        runs[k, 2] = runs[runs[k, 2], 2]
        k = runs[k, 2]
    return k


@kernel
def _join(runs: NDArray[np.int32], a: int, b: int) -> None:
    a, b = _root(runs, a), _root(runs, b)
    runs[max(a, b), 2] = min(a, b)


@kernel
def _fill(
    log_odds: NDArray[np.int8],
    resolution: float,
    radius: float,
    comfort: float,
    clearance: NDArray[np.float32],
    blocked: NDArray[np.bool_],
    slowness: NDArray[np.float32],
) -> None:
    """Turns distances in cells into clearance in place, and fills the other two."""
    for i in range(log_odds.shape[0]):
        for j in range(log_odds.shape[1]):
            # From the cell's centre to the border, not the centre, of the obstacle's cell.
            free = (clearance[i, j] - 0.5) * resolution
            clearance[i, j] = free
            blocked[i, j] = free < radius
            share = min(max((comfort - free) / (comfort - radius), 0.0), 1.0)
            slow = 1.0 + NEAR_SLOWNESS * share * share
            if log_odds[i, j] == 0:
                slow += UNKNOWN_SLOWNESS
            slowness[i, j] = slow


@kernel
def _touches(
    log_odds: NDArray[np.int8], points: NDArray[np.float64], x: float, y: float, radius: float
) -> bool:
    rows, columns = log_odds.shape
    for k in range(len(points) - 1):
        x0, y0 = points[k, 0], points[k, 1]
        dx, dy = points[k + 1, 0] - x0, points[k + 1, 1] - y0
        samples = math.ceil(math.hypot(dx, dy)) + 1
        for s in range(samples + 1):
            px, py = x0 + dx * s / samples, y0 + dy * s / samples
            for i in range(max(math.floor(py - radius), 0), min(int(py + radius) + 1, rows)):
                for j in range(max(math.floor(px - radius), 0), min(int(px + radius) + 1, columns)):
                    if log_odds[i, j] <= 0:
                        continue
                    if math.hypot(j + 0.5 - px, i + 0.5 - py) >= radius:
                        continue
                    if math.hypot(j + 0.5 - x, i + 0.5 - y) >= radius + 1.0:
                        return True
    return False


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    occupancy = OccupancyMap()
    grid = make_navigation_grid(
        occupancy, position=(0.0, 0.0), targets=(), radius=0.1, turning_radius=0.1
    )
    grid.reachable((0, 0))
    path_is_blocked(occupancy, np.zeros((2, 2)), position=(0.0, 0.0), radius=0.1)
