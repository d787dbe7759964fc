"""Fast marching (Sethian 1996): shortest distances on a grid, and paths that descend them.

First-order upwind solution of ``|grad T| = slowness`` on the free cells, T = 0 at the sources.
The narrow band is kept in rotating buckets half a cell wide instead of a heap (an untidy queue
in the sense of Yatziv, Bartesaghi and Sapiro 2006); a cell whose value falls later is taken up
again, so the result is the same discrete solution as with a heap.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel

MAX_SLOWNESS = 7.0
"""Slowness lies in [1, MAX_SLOWNESS]: one step must stay within the ring of buckets."""

STOP_MARGIN = 4.0
"""An early stop still settles this much beyond the stop cell, in units of the field."""

_BUCKETS = 16
_PER_CELL = 2.0
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


@kernel
def _update(
    times: NDArray[np.float32], i: int, width: int, cost: np.float32
) -> np.float32:
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
    queue = np.empty((_BUCKETS, 1024), np.int32)
    count = np.zeros(_BUCKETS, np.int64)
    for start in starts:
        if not blocked[start] and times[start] > 0.0:
            times[start] = 0.0
            queue, count = _push(queue, count, 0, start)
    steps = np.array([-1, 1, -width, width])
    current = 0
    empty = 0
    while empty < _BUCKETS:
        slot = current & (_BUCKETS - 1)
        if count[slot] == 0:
            current += 1
            empty += 1
            continue
        empty = 0
        if end >= 0 and current / _PER_CELL > times[end] + STOP_MARGIN:
            break
        while count[slot] > 0:
            count[slot] -= 1
            i = queue[slot, count[slot]]
            time = times[i]
            if int(time * _PER_CELL) != current:
                continue  # its value fell since, and it was taken up under the new one
            for step in steps:
                j = i + step
                if blocked[j] or times[j] <= time:
                    continue
                new = _update(times, j, width, cost[j])
                old = times[j]
                if new < old:
                    times[j] = new
                    bucket = max(int(new * _PER_CELL), current)
                    queued = old < np.inf and int(old * _PER_CELL) == bucket
                    if not queued or bucket == current:
                        queue, count = _push(queue, count, bucket & (_BUCKETS - 1), j)
    if end >= 0:
        settled = np.float32(current / _PER_CELL)
        for i in range(times.size):
            if times[i] > settled:
                times[i] = np.inf


@kernel
def _push(
    queue: NDArray[np.int32], count: NDArray[np.int64], slot: int, cell: int
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Appends a cell to a bucket, and returns the queue, which may have grown."""
    capacity = queue.shape[1]
    if count[slot] == capacity:
        larger = np.empty((queue.shape[0], 2 * capacity), np.int32)
        larger[:, :capacity] = queue
        queue = larger
    queue[slot, count[slot]] = cell
    count[slot] += 1
    return queue, count


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    distance_field(np.zeros((2, 2), np.bool_), np.zeros((1, 2), np.int64))
