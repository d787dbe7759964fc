"""Random floors, and exact shortest ways between their cells."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

UNIT = 8
"""Places are whole numbers of eighths of a cell: a test of sight is exact."""

WALL, DOOR = 2, 18
"""Cells: walls of 0.1 m and doors of 0.9 m at 5 cm."""

compiled: Any = numba.njit(cache=True, error_model="numpy")


def floor_plan(seed: int, size: int) -> NDArray[np.bool_]:
    """Returns a random (size, size) floor: True are walls of rooms with doors, and furniture."""
    rng = np.random.default_rng(seed)
    taken = np.zeros((size, size), np.bool_)
    _divide(taken, 0, 0, size, size, rng)
    taken[:WALL], taken[-WALL:], taken[:, :WALL], taken[:, -WALL:] = (True,) * 4
    return taken


def _divide(
    taken: NDArray[np.bool_], i: int, j: int, rows: int, columns: int, rng: np.random.Generator
) -> None:
    """Parts a rectangle of the floor into two by a wall with a door, or furnishes it."""
    if max(rows, columns) < rng.integers(90, 180):
        for _ in range(round(rows * columns / 2200)):
            h, w = (int(value) for value in rng.integers(5, 30, 2))
            m, n = i + int(rng.integers(0, rows)), j + int(rng.integers(0, columns))
            taken[m : min(m + h, i + rows), n : min(n + w, j + columns)] = True
        return
    if rows < columns:
        # The same of the transposed floor.
        _divide(taken.T, j, i, columns, rows, rng)
        return
    at = i + int(rows * rng.uniform(0.35, 0.65))
    _divide(taken, i, j, at - i, columns, rng)
    _divide(taken, at + WALL, j, i + rows - at - WALL, columns, rng)
    taken[at : at + WALL, j : j + columns] = True
    door = j + int(rng.integers(WALL, columns - DOOR - WALL + 1))
    taken[at - DOOR : at + WALL + DOOR, door : door + DOOR] = False


@compiled
def _piece_is_free(blocked, i, j, along_row, last_i, last_j, first):
    """Returns whether a piece of a grid line is free on a side, and the same as that before it."""
    di, dj = (1, 0) if along_row else (0, 1)
    high, low = not blocked[i, j], not blocked[i - di, j - dj]
    if first:
        return high or low
    before_high, before_low = not blocked[last_i, last_j], not blocked[last_i - di, last_j - dj]
    return (high and before_high) or (low and before_low)


@compiled
def _sees_on_line(blocked, x0, y0, x1, y1):
    """Returns whether two places on a line of the grid see each other."""
    along_row = y0 == y1
    begin, end = (min(x0, x1), max(x0, x1)) if along_row else (min(y0, y1), max(y0, y1))
    line = (y0 if along_row else x0) // UNIT
    last_i, last_j = 0, 0
    for k in range(begin // UNIT, -(-end // UNIT)):
        i, j = (line, k) if along_row else (k, line)
        if not _piece_is_free(blocked, i, j, along_row, last_i, last_j, k == begin // UNIT):
            return False
        last_i, last_j = i, j
    return True


@compiled
def _sees_in_column(blocked, x, y0, y1):
    """Returns whether two places in one column of cells see each other."""
    for i in range(min(y0, y1) // UNIT, -(-max(y0, y1) // UNIT)):
        if blocked[i, x // UNIT]:
            return False
    return True


@compiled
def sees(blocked, x0, y0, x1, y1):
    """Returns whether the straight way between two places is free; all in whole numbers.

    It may touch blocked cells, but enters none, and passes between no two: neither along the edge
    of two that lie side by side, nor through the corner of two that lie across.

    Args:
        blocked: (rows, columns) bool; no place lies on or beyond the border of the grid.
        x0, y0, x1, y1: eighths of a cell.
    """
    if (y0 == y1 and y0 % UNIT == 0) or (x0 == x1 and x0 % UNIT == 0):
        return _sees_on_line(blocked, x0, y0, x1, y1)
    if x0 == x1:
        return _sees_in_column(blocked, x0, y0, y1)
    if x0 > x1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    dx, dy = x1 - x0, y1 - y0
    side, last = UNIT * dx, -1
    for j in range(x0 // UNIT, -(-x1 // UNIT)):
        # Where the way enters and leaves the column, times dx.
        enters = y0 * dx + (max(j * UNIT, x0) - x0) * dy
        leaves = y0 * dx + (min((j + 1) * UNIT, x1) - x0) * dy
        low, high = min(enters, leaves), max(enters, leaves)
        first, after = low // side, max(-(-high // side), low // side + 1)
        for i in range(first, after):
            if blocked[i, j]:
                return False
        here = first if dy >= 0 else after - 1
        # Through a corner, from the cell before to the one across.
        if last >= 0 and here != last and blocked[here, j - 1] and blocked[last, j]:
            return False
        last = after - 1 if dy >= 0 else first
    return True


def corners_of(blocked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Returns (k, 3): x and y of each convex corner, cells, and the sense of ways around it.

    A corner where two blocked cells meet across cannot be passed, and one of three blocked cells
    never lies on a shortest way.
    """
    around = [blocked[:-1, :-1], blocked[:-1, 1:], blocked[1:, :-1], blocked[1:, 1:]]
    convex = np.sum(around, axis=0) == 1
    rows, columns = np.nonzero(convex)
    falling = around[0][convex] | around[3][convex]
    return np.stack((columns + 1, rows + 1, np.where(falling, -1, 1)), axis=1)


@compiled
def _edges(blocked, places, senses, bound, edges, lengths):
    """Fills in the pairs that see each other, and returns how many they are, filled in or not.

    A way around a corner leaves the obstacle on one side: its direction lies in two of the four
    quadrants, which the sense tells.  A place is of use only where the way from the first place
    over it to the second is not longer than the bound.
    """
    count = 0
    n = len(places)
    to_ends = np.empty((n, 2))
    for a in range(n):
        for b in range(2):
            dx, dy = places[a, 0] - places[b, 0], places[a, 1] - places[b, 1]
            to_ends[a, b] = math.sqrt(dx * dx + dy * dy)
    for a in range(n):
        if to_ends[a, 0] + to_ends[a, 1] > bound:
            continue
        for b in range(a + 1, n):
            dx, dy = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1]
            turn = dx * dy
            if turn * senses[a] < 0 or turn * senses[b] < 0:
                continue
            length = math.sqrt(dx * dx + dy * dy)
            over = min(to_ends[a, 0] + to_ends[b, 1], to_ends[b, 0] + to_ends[a, 1])
            if over + length > bound:
                continue
            if sees(blocked, places[a, 0], places[a, 1], places[b, 0], places[b, 1]):
                if count < len(edges):
                    edges[count, 0], edges[count, 1], lengths[count] = a, b, length
                count += 1
    return count


def exact_geodesic(
    blocked: NDArray[np.bool_],
    start: tuple[float, float],
    goal: tuple[float, float],
    bound: float = math.inf,
) -> float:
    """Returns the length of the shortest way over free cells, in cells; inf without one.

    The blocked cells are polygons, and the shortest way turns only at their convex corners: an
    exact visibility graph, searched by scipy's Dijkstra.

    Args:
        blocked: (rows, columns) bool; what lies outside is blocked too.
        start: (x, y) in cell coordinates, in a free cell, in whole eighths.
        goal: likewise.
        bound: a length that the shortest way is known not to exceed; spares time.
    """
    padded = np.pad(blocked, 1, constant_values=True)
    corners = corners_of(padded)
    ends = np.round((np.array([start, goal]) + 1.0) * UNIT).astype(np.int64)
    places = np.concatenate((ends, corners[:, :2] * UNIT))
    senses = np.concatenate((np.zeros(2, np.int64), corners[:, 2]))
    limit = bound * UNIT * (1.0 + 1e-9)
    size = 1 << 16
    while True:
        edges, lengths = np.empty((size, 2), np.int64), np.empty(size)
        count = int(_edges(padded, places, senses, limit, edges, lengths))
        if count <= size:
            break
        size = count
    shape = (len(places), len(places))
    graph = csr_array((lengths[:count], (edges[:count, 0], edges[:count, 1])), shape=shape)
    return float(dijkstra(graph, directed=False, indices=0)[1]) / UNIT


def blocked_hops(blocked: NDArray[np.bool_], points: NDArray[np.float64]) -> int:
    """Returns how many pieces of a path enter a blocked cell; its points in whole eighths."""
    padded = np.pad(blocked, 1, constant_values=True)
    places = np.round((points + 1.0) * UNIT).astype(np.int64)
    assert np.array_equal(places, (points + 1.0) * UNIT), "points must be in whole eighths"
    return sum(not sees(padded, *a, *b) for a, b in itertools.pairwise(places))
