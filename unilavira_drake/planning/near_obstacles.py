"""How near the next obstacle is, for the cells of a grid that are near one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, inlined_kernel, kernel


def near_distance(log_odds: NDArray[np.int8], reach: int) -> NDArray[np.float32]:
    """Returns the distance from each cell's centre to that of the nearest occupied cell.

    The exact Euclidean distance transform as far as a planner asks: along the columns first, then
    along the rows (Saito and Toriwaki, 1994), over no more than ``reach`` cells.  Beyond that,
    OpenCV's transform of the whole image costs nearly three times as much.

    Args:
        log_odds: (rows, columns) int8; positive is occupied.
        reach: cells; at least 1.

    Returns:
        (rows, columns) float32, cells; inf where nothing is within ``reach``.
    """
    distance = np.empty(log_odds.shape, np.float32)
    _near(frozen_view(log_odds, np.int8), reach, distance)
    return distance


@kernel
def _near(log_odds: NDArray[np.int8], reach: int, distance: NDArray[np.float32]) -> None:
    """Fills ``distance``; loops along rows with comparisons that the compiler vectorizes."""
    rows, columns = log_odds.shape
    beyond = np.float32(reach + 1)
    _along_columns(log_odds, beyond, distance)
    squared = np.full(columns + 2 * reach, beyond * beyond, np.float32)
    limit = np.float32(reach * reach)
    for i in range(rows):
        row = distance[i]
        least = beyond
        for j in range(columns):
            least = least if least < row[j] else row[j]
            row[j] = row[j] * row[j]
            squared[reach + j] = row[j]
        if least < beyond:
            _along_row(squared, reach, row)
        for j in range(columns):
            row[j] = math.sqrt(row[j]) if row[j] <= limit else np.inf


@inlined_kernel
def _along_columns(
    log_odds: NDArray[np.int8], beyond: np.float32, distance: NDArray[np.float32]
) -> None:
    """Enters the distance to the nearest occupied cell of the column, ``beyond`` at most."""
    rows, columns = log_odds.shape
    one = np.float32(1.0)
    for i in range(rows):
        for j in range(columns):
            above = distance[i - 1, j] + one if i > 0 else beyond
            above = above if above < beyond else beyond
            distance[i, j] = np.float32(0.0) if log_odds[i, j] > 0 else above
    for i in range(rows - 2, -1, -1):
        for j in range(columns):
            here, below = distance[i, j], distance[i + 1, j] + one
            distance[i, j] = here if here < below else below


@inlined_kernel
def _along_row(squared: NDArray[np.float32], reach: int, row: NDArray[np.float32]) -> None:
    """Lowers the squares of a row to those that come from its neighbours, which have a margin."""
    columns = len(row)
    for k in range(1, reach + 1):
        along = np.float32(k * k)
        left = squared[reach - k : reach - k + columns]
        right = squared[reach + k : reach + k + columns]
        for j in range(columns):
            beside = (left[j] if left[j] < right[j] else right[j]) + along
            row[j] = beside if beside < row[j] else row[j]


def warm_up() -> None:
    """Compiles the kernel, or loads it from numba's cache."""
    near_distance(np.zeros((1, 1), np.int8), 1)
