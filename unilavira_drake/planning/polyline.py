"""Paths from a distance field: descent, line of sight, and lengths of polylines.

Points are in cell coordinates: cell (row i, column j) covers x in [j, j + 1), y in [i, i + 1).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel

SHORTCUT_FACTOR = 1.03
"""A straight line replaces a piece of the descent when it costs at most this much of it."""

PATIENCE = 24
"""Cells of the descent that are tried beyond the last one a straight line reached."""


def extract_path(
    times: NDArray[np.float64],
    blocked: NDArray[np.bool_],
    slowness: NDArray[np.float32],
    start: tuple[float, float],
) -> NDArray[np.float64]:
    """Returns the path from a point down the field to its source.

    Steepest descent over eight neighbours without cutting blocked corners, then pulled straight
    wherever a line of sight costs no more than the piece it replaces.

    Args:
        times: (rows, columns) float64 field of :func:`distance_field`.
        blocked: (rows, columns) bool, as for the field.
        slowness: (rows, columns) float32, as for the field.
        start: (x, y) in cell coordinates.

    Returns:
        (k, 2) float64 points in cell coordinates, from ``start`` to the centre of the source
        cell; no segment touches a blocked cell.  Empty when the field is inf at the start.
    """
    row, column = math.floor(start[1]), math.floor(start[0])
    if not (0 <= row < times.shape[0] and 0 <= column < times.shape[1]):
        return np.zeros((0, 2))
    if not np.isfinite(times[row, column]):
        return np.zeros((0, 2))
    cells = _descend(frozen_view(times, np.float64), frozen_view(blocked, np.bool_), row, column)
    return _pull(
        cells,
        frozen_view(times, np.float64),
        frozen_view(blocked, np.bool_),
        frozen_view(slowness, np.float32),
        float(start[0]),
        float(start[1]),
    )


def length(points: NDArray[np.float64]) -> float:
    """Returns the length of a (k, 2) polyline, in its own unit; 0 for fewer than two points."""
    return float(np.sum(np.hypot(*np.diff(points, axis=0).T))) if len(points) > 1 else 0.0


@kernel
def remaining_length(points: NDArray[np.float64], x: float, y: float) -> float:
    """Returns the way to the end of a polyline, entered at its point nearest to (x, y)."""
    best, remaining, ahead = np.inf, 0.0, 0.0
    for k in range(len(points) - 2, -1, -1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        squared = dx * dx + dy * dy
        t = 0.0
        if squared > 0.0:
            t = ((x - points[k, 0]) * dx + (y - points[k, 1]) * dy) / squared
            t = min(max(t, 0.0), 1.0)
        off = math.hypot(points[k, 0] + t * dx - x, points[k, 1] + t * dy - y)
        if off < best:
            best = off
            remaining = off + (1.0 - t) * math.sqrt(squared) + ahead
        ahead += math.sqrt(squared)
    return remaining


@kernel
def segment_cost(
    blocked: NDArray[np.bool_],
    slowness: NDArray[np.float32],
    x0: float,
    y0: float,
    x1: float,
    y1: float,
) -> float:
    """Returns the slowness integrated along a segment; inf if it touches a blocked cell.

    Every cell the segment passes through is visited (Amanatides and Woo 1987); one that passes
    exactly through a corner touches the cells on both sides.
    """
    row, column = math.floor(y0), math.floor(x0)
    dx, dy = x1 - x0, y1 - y0
    total = math.sqrt(dx * dx + dy * dy)
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    t_x = ((column + (dx > 0.0)) - x0) / dx if dx != 0.0 else np.inf
    t_y = ((row + (dy > 0.0)) - y0) / dy if dy != 0.0 else np.inf
    cost: float = 0.0
    t = 0.0
    while True:
        if blocked[row, column]:
            return math.inf
        t_next = min(t_x, t_y, 1.0)
        cost += float(slowness[row, column]) * (t_next - t) * total
        t = t_next
        if t >= 1.0:
            return cost
        if abs(t_x - t_y) < 1e-9:
            if blocked[row + step_y, column] or blocked[row, column + step_x]:
                return math.inf
            row, column = row + step_y, column + step_x
            t_x, t_y = t_x + abs(1.0 / dx), t_y + abs(1.0 / dy)
        elif t_x < t_y:
            column, t_x = column + step_x, t_x + abs(1.0 / dx)
        else:
            row, t_y = row + step_y, t_y + abs(1.0 / dy)


@kernel
def _descend(
    times: NDArray[np.float64], blocked: NDArray[np.bool_], row: int, column: int
) -> NDArray[np.int64]:
    """Returns the (n, 2) cells of the steepest descent from a cell to a source."""
    rows, columns = times.shape
    cells = np.empty((rows + columns, 2), np.int64)
    n = 0
    while True:
        if n == len(cells):
            longer = np.empty((2 * n, 2), np.int64)
            longer[:n] = cells
            cells = longer
        cells[n, 0], cells[n, 1] = row, column
        n += 1
        here = np.float64(times[row, column])
        best, best_row, best_column = 0.0, row, column
        for i in range(max(row - 1, 0), min(row + 2, rows)):
            for j in range(max(column - 1, 0), min(column + 2, columns)):
                if blocked[i, j] or blocked[row, j] or blocked[i, column]:
                    continue
                drop = here - times[i, j]
                if i != row and j != column:
                    drop *= math.sqrt(0.5)
                if drop > best:
                    best, best_row, best_column = drop, i, j
        if best_row == row and best_column == column:
            return cells[:n]
        row, column = best_row, best_column


@kernel
def _pull(
    cells: NDArray[np.int64],
    times: NDArray[np.float64],
    blocked: NDArray[np.bool_],
    slowness: NDArray[np.float32],
    x: float,
    y: float,
) -> NDArray[np.float64]:
    """Returns the polyline from (x, y) along the cells, pulled straight where that is allowed."""
    n = len(cells)
    points = np.empty((n + 1, 2))
    points[0, 0], points[0, 1] = x, y
    count, at = 1, 0
    here = times[cells[0, 0], cells[0, 1]]
    while at < n - 1 or count == 1:
        reached = at if count == 1 else at + 1
        k = reached
        while k + 1 < n and k < reached + PATIENCE:
            k += 1
            end_x, end_y = cells[k, 1] + 0.5, cells[k, 0] + 0.5
            cost = segment_cost(blocked, slowness, x, y, end_x, end_y)
            # One cell of slack: the start lies anywhere in its cell.
            if cost <= SHORTCUT_FACTOR * (here - times[cells[k, 0], cells[k, 1]]) + 1.0:
                reached = k
        at = reached
        here = times[cells[at, 0], cells[at, 1]]
        x, y = cells[at, 1] + 0.5, cells[at, 0] + 0.5
        points[count, 0], points[count, 1] = x, y
        count += 1
    return points[:count]


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    free = np.zeros((1, 2), np.bool_)
    times = np.array([[0.0, 1.0]])
    points = extract_path(times, free, np.ones((1, 2), np.float32), (1.5, 0.5))
    remaining_length(frozen_view(points, np.float64), 0.0, 0.0)


def final_heading(points: NDArray[np.float64], stretch: float = 0.6) -> float:
    """Returns the world yaw of the last ``stretch`` metres of a (k, 2) polyline, radians."""
    end = points[-1]
    gaps = np.hypot(*(points - end).T)
    far = np.flatnonzero(gaps >= stretch)
    start = points[far[-1]] if len(far) else points[0]
    return math.atan2(end[1] - start[1], end[0] - start[0])
