"""Fast marching (Sethian 1996): shortest distances on a grid, and paths that descend them.

First-order upwind solution of ``|grad T| = slowness`` on the free cells, T = 0 at the sources.
The narrow band is kept in rotating buckets half a cell wide instead of a heap (an untidy queue
in the sense of Yatziv, Bartesaghi and Sapiro 2006); a cell whose value falls later is taken up
again, so the result is the same discrete solution as with a heap.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, inlined_kernel, kernel

MAX_SLOWNESS = 7.0
"""Slowness lies in [1, MAX_SLOWNESS]: one step must stay within the ring of buckets."""

# Indices of kernels: unsigned, they need no test for counting from the end.
_U = np.uint64

_BUCKETS = 16
_PER_CELL = 2.0
"""Buckets per unit of the field."""


def distance_field(
    blocked: NDArray[np.bool_],
    source_cells: NDArray[np.int64],
    *,
    slowness: NDArray[np.float32] | None = None,
    stop: tuple[int, int] | None = None,
) -> NDArray[np.float64]:
    """Returns the travel time from the nearest source cell to every cell, in cells.

    Args:
        blocked: (rows, columns) bool.
        source_cells: (k, 2) rows and columns; blocked ones are skipped.
        slowness: (rows, columns) float32 in [1, 7]; 1 everywhere when None.
        stop: (row, column) at which the march may end; cells farther from the sources than this
            one are then left at inf, but for some hardly farther.

    Returns:
        (rows, columns) float64; inf where blocked or unreachable.

    Raises:
        ValueError: if a source lies outside the grid, or the slowness is out of its range.
    """
    rows, columns = blocked.shape
    sources = np.asarray(source_cells, np.int64).reshape(-1, 2)
    if np.any(sources < 0) or np.any(sources >= np.array([rows, columns])):
        raise ValueError(f"source cells must lie in a grid of {rows} x {columns} cells")
    cost = np.ones(1, np.float32)  # One number for all cells.
    if slowness is not None:
        if not (slowness.min() >= 1.0 and slowness.max() <= MAX_SLOWNESS):
            raise ValueError(f"slowness must lie in [1, {MAX_SLOWNESS:g}]")
        cost = np.broadcast_to(slowness, blocked.shape)
    times = np.full((rows, columns), np.inf)
    end = -1
    if stop is not None and 0 <= stop[0] < rows and 0 <= stop[1] < columns:
        end = int(stop[0]) * columns + int(stop[1])
    _march(
        frozen_view(blocked, np.bool_).ravel(),
        frozen_view(cost, np.float32).ravel(),
        columns,
        sources[:, 0] * columns + sources[:, 1],
        times.ravel(),
        end,
    )
    return times


@inlined_kernel
def _update(x: float, y: float, cost: float) -> Any:
    """Returns the upwind solution from the lesser neighbour along each of the two axes."""
    a, b = min(x, y), max(x, y)
    difference = b - a
    if difference >= cost:
        return a + cost
    two_sided = 2.0 * cost * cost - difference * difference
    return 0.5 * (a + b + math.sqrt(two_sided))


@kernel
def _march(
    blocked: NDArray[np.bool_],
    cost: NDArray[np.float32],
    columns: int,
    starts: NDArray[np.int64],
    times: NDArray[np.float64],
    end: int,
) -> None:
    """Fills ``times``; the grids are flat, and a cost of one element is that of all cells."""
    queue = np.empty((_BUCKETS, len(starts) + 1024), np.int32)
    count = np.zeros(_BUCKETS, np.int64)
    for start in starts:
        if not blocked[start]:
            times[start] = 0.0
            queue[0, count[0]] = start
            count[0] += 1
    current, empty, fullest = 0, 0, 0
    while empty < _BUCKETS:
        slot = current & (_BUCKETS - 1)
        if count[slot] == 0:
            current += 1
            empty += 1
            continue
        empty = 0
        # What is taken up from here on cannot lower the value at the stop cell.
        if end >= 0 and current > times[end] * _PER_CELL:
            break
        while count[slot] > 0:
            if fullest + 4 > queue.shape[1]:
                queue = _larger(queue)
            fullest = _settle(blocked, cost, columns, times, current, queue, count, fullest)
    if end >= 0:
        _forget_beyond(times, current / _PER_CELL, queue, count)


@kernel
def _settle(
    blocked: NDArray[np.bool_],
    cost: NDArray[np.float32],
    columns: int,
    times: NDArray[np.float64],
    current: int,
    queue: NDArray[np.int32],
    count: NDArray[np.int64],
    fullest: int,
) -> int:
    """Takes up the current bucket till it is empty or one is full; returns the largest size.

    A whole bucket a call: handing arrays to a function costs as much as a cell.
    """
    one, row, size, each = _U(1), _U(columns), _U(len(blocked)), _U(len(cost) > 1)
    slot = _U(current & (_BUCKETS - 1))
    while count[slot] > 0 and fullest + 4 <= queue.shape[1]:
        count[slot] -= 1
        i = _U(queue[slot, _U(count[slot])])
        time = times[i]
        # Otherwise its value fell since, and it was taken up under the new one.
        if np.int64(time * _PER_CELL) != current:
            continue
        inner = _is_inner(i, row, size)
        for j in (i - one, i + one, i - row, i + row):
            if not inner and _is_outside(i, j, row, size):
                continue
            old = times[j]
            if blocked[j] | (old <= time):
                continue
            if inner:
                across = min(times[j - one], times[j + one])
                along = min(times[j - row], times[j + row])
            else:
                across, along = _at_border(times, j, row, size)
            new = _update(across, along, np.float64(cost[j * each]))
            if new >= old:
                continue
            times[j] = new
            bucket: Any = max(np.int64(new * _PER_CELL), np.int64(current))
            # Queued under the same bucket already, which is still to come.
            if bucket != current and old < np.inf and np.int64(old * _PER_CELL) == bucket:
                continue
            into = _U(bucket & (_BUCKETS - 1))
            queue[into, _U(count[into])] = j
            count[into] += 1
            fullest = max(fullest, count[into])
    return fullest


@inlined_kernel
def _is_inner(i: Any, row: Any, size: Any) -> Any:
    """Returns whether the grid goes on for two cells on all sides of a cell."""
    two, column = _U(2), i % row
    rest = row - column
    return i >= two * row and i + two * row < size and column >= two and rest > two


@inlined_kernel
def _is_outside(i: Any, j: Any, row: Any, size: Any) -> Any:
    """Returns whether j, the cell beside i or a row away, is none or at a row's other end."""
    right = max(i, j)
    wraps = row > _U(1) and right - min(i, j) == _U(1) and right % row == _U(0)
    return j >= size or wraps


@kernel
def _at_border(times: NDArray[np.float64], j: Any, row: Any, size: Any) -> Any:
    """Returns the lesser neighbour along each axis; beyond the border it is inf."""
    one, none, column = _U(1), np.inf, j % row
    left = times[j - one] if column > _U(0) else none
    right = times[j + one] if column + one < row else none
    below = times[j - row] if j >= row else none
    above = times[j + row] if j + row < size else none
    return min(left, right), min(below, above)


@kernel
def _larger(queue: NDArray[np.int32]) -> NDArray[np.int32]:
    """Returns a copy of the queue with twice the capacity."""
    larger = np.empty((queue.shape[0], 2 * queue.shape[1]), np.int32)
    larger[:, : queue.shape[1]] = queue
    return larger


@kernel
def _forget_beyond(
    times: NDArray[np.float64],
    settled: float,
    queue: NDArray[np.int32],
    count: NDArray[np.int64],
) -> None:
    """Clears what lies beyond; all of it is still queued."""
    for slot in range(_BUCKETS):
        for k in range(count[slot]):
            if times[queue[slot, k]] > settled:
                times[queue[slot, k]] = np.inf


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    distance_field(np.zeros((2, 2), np.bool_), np.zeros((1, 2), np.int64))
