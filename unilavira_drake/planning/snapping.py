"""Snapping: from the point a model selected to floor on which the robot can stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import Message
from unilavira_drake.planning.navigation_grid import NavigationGrid

UNREACHABLE = "unreachable"

BESIDE = 0.25
"""A target no farther than the turning radius and this much is beside the robot: it may stay
where it is.  For any other target the snapped goal is at least this far from it, metres."""

TIGHT = 0.87
"""Where less than this share of the turning radius is free, the robot would not come out again."""

SURFACE = 0.5
"""The front of a thing is looked for up to this far before the selected point, metres."""


@dataclass(frozen=True)
class Snap(Message):
    """The snapped cell, or the reason why there is none."""

    cell: tuple[int, int] | None = None
    reason: str = ""


def snap(
    grid: NavigationGrid,
    reachable: NDArray[np.bool_],
    *,
    target: tuple[float, float],
    position: tuple[float, float],
    viewpoint: tuple[float, float],
    max_distance: float,
    turning_radius: float,
) -> Snap:
    """Returns the cell where the robot should stop for a target.

    Preferred, in this order, and then by distance to the target: known free cells in view of the
    target's front with room to turn; such cells with just enough; unknown cells in view on
    the robot's side (a target beyond the mapped range); known cells behind something.

    Args:
        grid: where the robot may drive.
        reachable: (rows, columns) bool, cells connected with the robot's.
        target: (x, y) of the selected point, metres.
        position: (x, y) of the robot, metres.
        viewpoint: (x, y) from which the target was seen, metres.
        max_distance: bound on the distance from the target to the cell's centre, metres.
        turning_radius: clearance with room to turn in place, metres.
    """
    away = math.dist(target, position) > turning_radius + BESIDE
    row, column, found_free = _search(
        frozen_view(grid.log_odds, np.int8),
        frozen_view(grid.clearance, np.float32),
        frozen_view(grid.blocked, np.bool_),
        frozen_view(reachable, np.bool_),
        np.array([*grid.point(*target), *grid.point(*position), *grid.point(*viewpoint)]),
        max_distance / grid.resolution,
        turning_radius,
        (BESIDE if away else 0.0) / grid.resolution,
        SURFACE / grid.resolution,
    )
    if row >= 0:
        return Snap(cell=(int(row), int(column)))
    if found_free:
        return Snap(reason=UNREACHABLE)
    return Snap(reason=f"no free space within {max_distance:g} m")


@kernel
def _search(
    log_odds: NDArray[np.int8],
    clearance: NDArray[np.float32],
    blocked: NDArray[np.bool_],
    reachable: NDArray[np.bool_],
    points: NDArray[np.float64],
    bound: float,
    turning_radius: float,
    apart: float,
    surface: float,
) -> tuple[int, int, bool]:
    """Returns the best cell (-1 if there is none), and whether any known free cell was near.

    Lengths in cells except clearances; ``points`` are target, robot and viewpoint.
    """
    rows, columns = log_odds.shape
    x, y, x_robot, y_robot = points[0], points[1], points[2], points[3]
    x_front, y_front = _front(log_odds, x, y, points[4], points[5], surface)
    to_robot = math.hypot(x_robot - x, y_robot - y)
    best_rank, best_key, best_row, best_column = 9, np.inf, -1, -1
    found_free = False
    for i in range(max(int(y - bound), 0), min(int(y + bound) + 1, rows)):
        for j in range(max(int(x - bound), 0), min(int(x + bound) + 1, columns)):
            cx, cy = j + 0.5, i + 0.5
            distance = math.hypot(cx - x, cy - y)
            if blocked[i, j] or distance > bound:
                continue
            known = log_odds[i, j] < 0
            found_free = found_free or known
            from_robot = math.hypot(cx - x_robot, cy - y_robot)
            if not reachable[i, j] or from_robot < apart:
                continue
            if not known and from_robot >= to_robot:
                continue
            if known and clearance[i, j] < TIGHT * turning_radius:
                continue
            # Of two cells as near to the target, the one nearer to where it was seen from.
            key = distance + 1e-3 * math.hypot(cx - points[4], cy - points[5])
            hopeful = 2
            if known:
                hopeful = 0 if clearance[i, j] >= turning_radius else 1
            rank = _rank(log_odds, x_front, y_front, cx, cy, hopeful)
            if rank < best_rank or (rank == best_rank and key < best_key):
                best_rank, best_key, best_row, best_column = rank, key, i, j
    return best_row, best_column, found_free


@kernel
def _rank(
    log_odds: NDArray[np.int8], x: float, y: float, cx: float, cy: float, in_view: int
) -> int:
    """Returns the rank of a cell: ``in_view`` if (x, y) sees it; unknown and hidden is none."""
    if _sees(log_odds, x, y, cx, cy):
        return in_view
    return 9 if in_view == 2 else in_view + 3


@kernel
def _front(
    log_odds: NDArray[np.int8], x: float, y: float, x_view: float, y_view: float, surface: float
) -> tuple[float, float]:
    """Returns the first point towards the viewpoint that is not inside an obstacle."""
    distance = math.hypot(x_view - x, y_view - y)
    steps = int(2.0 * min(surface, distance))
    for s in range(steps + 1):
        px = x + (x_view - x) * 0.5 * s / max(distance, 1e-9)
        py = y + (y_view - y) * 0.5 * s / max(distance, 1e-9)
        i, j = math.floor(py), math.floor(px)
        if 0 <= i < log_odds.shape[0] and 0 <= j < log_odds.shape[1] and log_odds[i, j] <= 0:
            return px, py
    return x, y


@kernel
def _sees(log_odds: NDArray[np.int8], x0: float, y0: float, x1: float, y1: float) -> bool:
    """Returns whether no occupied cell lies between two points, sampled twice a cell."""
    steps = int(2.0 * math.hypot(x1 - x0, y1 - y0)) + 1
    for s in range(steps + 1):
        i = math.floor(y0 + (y1 - y0) * s / steps)
        j = math.floor(x0 + (x1 - x0) * s / steps)
        if 0 <= i < log_odds.shape[0] and 0 <= j < log_odds.shape[1] and log_odds[i, j] > 0:
            return False
    return True


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    grid = NavigationGrid(
        resolution=1.0,
        origin=(0.0, 0.0),
        log_odds=np.zeros((1, 1), np.int8),
        clearance=np.zeros((1, 1), np.float32),
        blocked=np.zeros((1, 1), np.bool_),
        slowness=np.ones((1, 1), np.float32),
    )
    here = (0.5, 0.5)
    snap(
        grid, grid.blocked, target=here, position=here, viewpoint=here,
        max_distance=1.0, turning_radius=0.1,
    )  # fmt: skip
