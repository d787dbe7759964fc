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

from unilavira_drake.kernels import inlined_kernel, kernel

MAX_SLOWNESS = 7.0
"""Slowness lies in [1, MAX_SLOWNESS]: one step must stay within the ring of buckets."""

STOP_MARGIN = 4.0
"""An early stop still settles this much beyond the stop cell, in units of the field."""

_BUCKETS = 16
_PER_CELL = np.float32(2.0)
"""Buckets per unit of the field."""


def distance_field(
    blocked: NDArray[np.bool_],
    source_cells: NDArray[np.int64],
    *,
    slowness: NDArray[np.float32] | None = None,
    stop: tuple[int, int] | None = None,
) -> NDArray[np.float32]:
    """Returns the travel time from the nearest source cell to every cell, in cells.

    Args:
        blocked: (rows, columns) bool.
        source_cells: (k, 2) rows and columns; blocked ones are skipped.
        slowness: (rows, columns) float32 in [1, 7]; 1 everywhere when None.
        stop: (row, column) at which the march may end; cells farther from the sources than this
            one, with a small margin, are then left at inf.

    Returns:
        (rows, columns) float32; inf where blocked or unreachable.

    Raises:
        ValueError: if a source lies outside the grid, or the slowness is out of its range.
    """
    rows, columns = blocked.shape
    sources = np.asarray(source_cells, np.int64).reshape(-1, 2)
    if np.any(sources < 0) or np.any(sources >= np.array([rows, columns])):
        raise ValueError(f"source cells must lie in a grid of {rows} x {columns} cells")
    width = columns + 2
    padded = np.ones((rows + 2, width), np.bool_)
    padded[1:-1, 1:-1] = blocked
    cost = np.ones((rows + 2, width), np.float32)
    if slowness is not None:
        if not (slowness.min() >= 1.0 and slowness.max() <= MAX_SLOWNESS):
            raise ValueError(f"slowness must lie in [1, {MAX_SLOWNESS:g}]")
        cost[1:-1, 1:-1] = slowness
    times = np.full((rows + 2, width), np.inf, np.float32)
    starts = (sources[:, 0] + 1) * width + sources[:, 1] + 1
    end = -1 if stop is None else (stop[0] + 1) * width + stop[1] + 1
    _march(padded.ravel(), cost.ravel(), width, starts, times.ravel(), end)
    return np.ascontiguousarray(times[1:-1, 1:-1])


@inlined_kernel
def _update(times: NDArray[np.float32], i: int, width: int, cost: np.float32) -> Any:
    """Returns the upwind solution at one cell from its four neighbours."""
    a = min(times[i - 1], times[i + 1])
    b = min(times[i - width], times[i + width])
    if a > b:
        a, b = b, a
    difference = b - a
    if difference >= cost:
        return a + cost
    two_sided = np.float32(2.0) * cost * cost - difference * difference
    return np.float32(0.5) * (a + b + np.float32(math.sqrt(two_sided)))


@kernel
def _march(
    blocked: NDArray[np.bool_],
    cost: NDArray[np.float32],
    width: int,
    starts: NDArray[np.int64],
    times: NDArray[np.float32],
    end: int,
) -> None:
    """Fills ``times`` of flat grids that are padded with a blocked ring."""
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
        if end >= 0 and current > (times[end] + STOP_MARGIN) * _PER_CELL:
            break
        while count[slot] > 0:
            if fullest + 4 > queue.shape[1]:
                queue = _larger(queue)
            count[slot] -= 1
            i = np.int64(queue[slot, count[slot]])
            # Otherwise its value fell since, and it was taken up under the new one.
            if np.int64(times[i] * _PER_CELL) == current:
                fullest = max(
                    fullest, _relax(blocked, cost, width, times, i, current, queue, count)
                )
    if end >= 0:
        _forget_beyond(times, np.float32(current / _PER_CELL))


@inlined_kernel
def _relax(
    blocked: NDArray[np.bool_],
    cost: NDArray[np.float32],
    width: int,
    times: NDArray[np.float32],
    i: Any,
    current: int,
    queue: NDArray[np.int32],
    count: NDArray[np.int64],
) -> int:
    """Updates the four neighbours of a cell, and returns the largest bucket filled."""
    fullest = 0
    for step in (-1, 1, -width, width):
        j = i + step
        old = times[j]
        if blocked[j] or old <= times[i]:
            continue
        new = _update(times, j, width, cost[j])
        if new >= old:
            continue
        times[j] = new
        bucket: Any = max(np.int64(new * _PER_CELL), np.int64(current))
        # Queued under the same bucket already, which is still to come.
        if bucket != current and old < np.inf and np.int64(old * _PER_CELL) == bucket:
            continue
        slot = bucket & (_BUCKETS - 1)
        queue[slot, count[slot]] = j
        count[slot] += 1
        fullest = max(fullest, count[slot])
    return fullest


@kernel
def _larger(queue: NDArray[np.int32]) -> NDArray[np.int32]:
    """Returns a copy of the queue with twice the capacity."""
    larger = np.empty((queue.shape[0], 2 * queue.shape[1]), np.int32)
    larger[:, : queue.shape[1]] = queue
    return larger


@kernel
def _forget_beyond(times: NDArray[np.float32], settled: np.float32) -> None:
    for i in range(times.size):
        if times[i] > settled:
            times[i] = np.inf


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    distance_field(np.zeros((2, 2), np.bool_), np.zeros((1, 2), np.int64))
