"""Gaps that an aircraft passes only straight: the best line through one, and how wide it is there.

An aircraft that turns needs a circle; one that does not needs no more than its own width.  So a
gap is passed on a level straight line from where it can turn to where it can turn again, through
the middle of what is free beside that line, in the direction in which most is free.  All lines
through some points of the gap are looked at, in steps of two degrees.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.planning.visibility_lines import bit, inside
from unilavira_drake.planning.visibility_space import FlightSpace
from unilavira_drake.planning.visibility_window import FlightWindow, make_window

Point = tuple[float, float, float]
Columns = NDArray[np.int64]
"""(m, 2) x and y of the columns in which something is between two heights, voxels of a window."""

DIRECTIONS = 180
"""So many directions are tried."""

REACH = 2.0
"""Room to turn is looked for up to this far from a point in a gap, metres."""

RUN_IN, RUN_OUT = 0.35, 0.2
"""Where there is room a line begins so long before a gap and ends so far behind it, metres: there
it is met straight, and who comes from the side is not yet too near to what is beside the gap."""


def best_line(
    space: FlightSpace,
    places: NDArray[np.float64],
    before: FlightWindow,
    beyond: FlightWindow,
) -> tuple[NDArray[np.float64], float]:
    """Returns the line through a gap with most free beside it: (2, 3) ends, and metres free.

    The ends are voxels of the window.  No line: nothing is free beside it.

    Args:
        space: where things are, and how far below and above the aircraft nothing may be.
        places: (k, 3) points in the gap, voxels of the window.
        before: the window, all blocked where the aircraft cannot come from.
        beyond: the same one, all blocked but where it wants to go.
    """
    resolution = space.voxels.resolution
    reach, runs = REACH / resolution, (RUN_IN / resolution, RUN_OUT / resolution)
    line, best = np.zeros((2, 3)), np.zeros(2)
    for place in places:
        low, high = np.floor(place - reach), np.floor(place + reach) + 1.0
        columns = _columns_between(space, before.low, low, high, (place[2], place[2]))
        _improve(place, columns, before.words, beyond.words, reach, runs, line, best)
    return line, float(best[0]) * resolution


def free_beside(space: FlightSpace, p_WA: NDArray[np.float64], p_WB: NDArray[np.float64]) -> float:
    """Returns how far from a line nothing is, to either side, metres; at most 1 m.

    Args:
        space: where things are, and how far below and above the line they count.
        p_WA: (3,) its begin, metres in the world.
        p_WB: (3,) its end.
    """
    resolution = space.voxels.resolution
    a, b = p_WA / resolution, p_WB / resolution
    most = 1.0 / resolution
    low = np.floor(np.minimum(a, b) - most)
    high = np.floor(np.maximum(a, b) + most) + 1.0
    heights = (min(a[2], b[2]), max(a[2], b[2]))
    columns = _columns_between(space, (0, 0, 0), low, high, heights)
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    if length < 1e-9:
        return 0.0
    direction = (b[:2] - a[:2]) / length
    right, left = _interval(a, direction, columns, 0.0, length, most)
    return float(max(min(left, -right), 0.0)) * resolution


def _columns_between(
    space: FlightSpace,
    origin: tuple[int, int, int],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    heights: tuple[float, float],
) -> Columns:
    """Returns the columns of a box in which something is near to these heights.

    All are voxels that count from ``origin``, a voxel of the world.
    """
    keep, resolution = space.clearance, space.voxels.resolution
    bottom = math.floor(heights[0] - keep.ground_margin / resolution + 1e-6) + origin[2]
    top = math.ceil(heights[1] + keep.ceiling_margin / resolution - 1e-6) + origin[2]
    x0, y0 = int(low[0]) + origin[0], int(low[1]) + origin[1]
    x1, y1 = int(high[0]) + origin[0], int(high[1]) + origin[1]
    solid = make_window(
        space.occupied, low=(x0, y0, bottom), high=(x1, y1, top), resolution=resolution
    )
    heights_below = (bottom - solid.low[2], top - solid.low[2])
    found = _columns(solid.words, *heights_below)
    found += np.array(solid.low[:2]) - np.array(origin[:2])
    return found


@kernel
def _columns(words: NDArray[np.uint32], bottom: int, top: int) -> Columns:
    nx, ny, _ = words.shape
    found = np.empty((nx * ny, 2), np.int64)
    n = 0
    # The border of a window is no thing.
    for x in range(1, nx - 1):
        for y in range(1, ny - 1):
            for z in range(bottom, top):
                if bit(words, x, y, z):
                    found[n, 0], found[n, 1] = x, y
                    n += 1
                    break
    return found[:n].copy()


@kernel
def _interval(
    p: NDArray[np.float64],
    direction: NDArray[np.float64],
    columns: Columns,
    behind: float,
    ahead: float,
    most: float,
) -> tuple[float, float]:
    """Returns what is free to the right (negative) and to the left of a line through p, voxels.

    The line reaches from ``-behind`` to ``ahead``; more than ``most`` is not looked for.  What p
    is in counts to the side of its centre.
    """
    c, s = direction[0], direction[1]
    # As a disc: of a wall that is at an angle the corners of its voxels stick out.
    half = 0.5
    right, left = -most, most
    for k in range(len(columns)):
        x, y = columns[k, 0] + 0.5 - p[0], columns[k, 1] + 0.5 - p[1]
        along = c * x + s * y
        if along + half <= -behind or along - half >= ahead:
            continue
        across = c * y - s * x
        if across >= 0.0:
            left = min(left, across - half)
        else:
            right = max(right, across + half)
    return right, left


@kernel
def _room(
    words: NDArray[np.uint32],
    p: NDArray[np.float64],
    c: float,
    s: float,
    reach: float,
    run: float,
) -> float:
    """Returns how far it is from p to a free voxel, and on through them by ``run``; -1: too far."""
    first = -1.0
    for step in range(int(2.0 * (reach + run)) + 1):
        t = 0.5 * step
        x, y = p[0] + t * c, p[1] + t * s
        free = inside(words, x, y, p[2])
        free = free and not bit(words, math.floor(x), math.floor(y), math.floor(p[2]))
        if first >= 0.0:
            if not free:
                return t - 0.5
            if t >= first + run:
                return t
        elif t > reach:
            return -1.0
        elif free:
            # The whole voxel is free; half a step more is well within.
            first = t
    return first


@kernel
def _centred(
    p: NDArray[np.float64],
    direction: NDArray[np.float64],
    columns: Columns,
    before: NDArray[np.uint32],
    beyond: NDArray[np.uint32],
    reach: float,
    runs: tuple[float, float],
) -> tuple[float, float, float]:
    """Moves p across a direction to the middle of what is free.

    Returns how far from it room to turn is behind and ahead (-1: there is none), and what is free
    beside the line between.
    """
    c, s = direction[0], direction[1]
    free = 0.0
    # It begins and ends elsewhere once it is in the middle.
    for shifts in range(4):
        behind = _room(before, p, -c, -s, reach, runs[0])
        ahead = _room(beyond, p, c, s, reach, runs[1]) if behind >= 0.0 else -1.0
        if ahead < 0.0:
            return 0.0, -1.0, 0.0
        right, left = _interval(p, direction, columns, behind, ahead, reach)
        shift, free = 0.5 * (left + right), min(left, -right)
        if shifts == 3 or left <= right or abs(shift) < 1e-9:
            break
        p[0] -= shift * s
        p[1] += shift * c
    return behind, ahead, free


@kernel
def _improve(
    place: NDArray[np.float64],
    columns: Columns,
    before: NDArray[np.uint32],
    beyond: NDArray[np.uint32],
    reach: float,
    runs: tuple[float, float],
    line: NDArray[np.float64],
    best: NDArray[np.float64],
) -> None:
    """Replaces a line by one near to a point if that is better.

    ``best`` are the voxels free beside the line, and minus its length.
    """
    for k in range(DIRECTIONS):
        angle = 2.0 * math.pi * k / DIRECTIONS
        direction = np.array([math.cos(angle), math.sin(angle)])
        c, s = direction[0], direction[1]
        p = place.copy()
        behind, ahead, free = _centred(p, direction, columns, before, beyond, reach, runs)
        length = behind + ahead
        as_wide = free < best[0] + 1e-6
        if ahead < 0.0 or free < best[0] - 1e-6 or (as_wide and -length <= best[1] + 1e-6):
            continue
        best[0], best[1] = free, -length
        line[0, 0], line[0, 1], line[0, 2] = p[0] - behind * c, p[1] - behind * s, p[2]
        line[1, 0], line[1, 1], line[1, 2] = p[0] + ahead * c, p[1] + ahead * s, p[2]


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    words = np.zeros((4, 4, 1), np.uint32)
    place = np.array([1.5, 1.5, 1.5])
    columns = _columns(words, 0, 1)
    _improve(place, columns, words, words, 1.0, (0.5, 0.5), np.zeros((2, 3)), np.zeros(2))
