"""Paths in the air: made shorter, checked against a newer map, and what remains of them."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.planning.visibility_lines import Slopes, bit, edge, edge_cost, inside, sees
from unilavira_drake.planning.visibility_space import FlightSpace
from unilavira_drake.planning.visibility_window import FlightWindow, make_window

Point = tuple[float, float, float]

PIECE = 200
"""A path is checked in pieces of so many voxels."""


@kernel
def shorten(
    words: NDArray[np.uint32], nodes: NDArray[np.float64], slopes: Slopes, rounds: int
) -> NDArray[np.float64]:
    """Returns a path no longer than the given one: nodes are left out, and moved to their best.

    A node is tried at the voxels 1, 2, 4 and 8 steps away in every direction of the grid.
    """
    points = nodes.copy()
    n = len(points)
    trial = np.empty(3)
    for _ in range(rounds):
        before = n
        k = 1
        changed = False
        while k < n - 1:
            a, b, c = points[k - 1], points[k], points[k + 1]
            now = edge_cost(a, b, slopes) + edge_cost(b, c, slopes)
            if edge_cost(a, c, slopes) <= now and edge(words, a, c, slopes) >= 0:
                points[k : n - 1] = points[k + 1 : n].copy()
                n -= 1
                continue
            changed = _moved(words, a, b, c, slopes, now, trial) or changed
            k += 1
        if n == before and not changed:
            break
    return points[:n]


@kernel
def _moved(
    words: NDArray[np.uint32],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    slopes: Slopes,
    now: float,
    trial: NDArray[np.float64],
) -> bool:
    """Moves b to the first better place found; returns whether there was one."""
    reach = 8
    while reach > 0:
        for direction in range(27):
            trial[0] = b[0] + reach * (direction // 9 - 1)
            trial[1] = b[1] + reach * (direction // 3 % 3 - 1)
            trial[2] = b[2] + reach * (direction % 3 - 1)
            if not inside(words, trial[0], trial[1], trial[2]):
                continue
            if edge_cost(a, trial, slopes) + edge_cost(trial, c, slopes) >= now - 1e-6:
                continue
            if bit(words, math.floor(trial[0]), math.floor(trial[1]), math.floor(trial[2])):
                continue
            if edge(words, a, trial, slopes) >= 0 and edge(words, trial, c, slopes) >= 0:
                b[:] = trial
                return True
        reach //= 2
    return False


def path_is_blocked(space: FlightSpace, p_WP: NDArray[np.float64], *, position: Point) -> bool:
    """Returns whether the rest of a path leads through blocked voxels; (k, 3) metres.

    That an aircraft itself is nearer to something than it should be is no news: the way is
    checked from where it is free again.
    """
    _, ahead = remaining_way(p_WP, position)
    rest = np.concatenate((np.array([position]), p_WP[ahead:])) / space.voxels.resolution
    rest[0] = _after_the_way_out(space, rest[0], rest[1])
    for a, b in itertools.pairwise(rest):
        pieces = math.ceil(float(np.linalg.norm(b - a)) / PIECE) or 1
        points = a + (b - a) * (np.arange(pieces + 1) / pieces)[:, None]
        for c, d in itertools.pairwise(points):
            window = _window_around(space, c, d)
            c, d = c - window.low, d - window.low
            if window.is_blocked(c) or not sees(window.words, *c, *d):
                return True
    return False


def _after_the_way_out(
    space: FlightSpace, a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the first free point from a towards b, not far from a; voxels of the world."""
    keep, length = space.clearance, float(np.linalg.norm(b - a))
    reach = max(keep.radius, keep.ground_margin, keep.ceiling_margin) / space.voxels.resolution
    reach = min(reach + 2.0, length)
    for step in range(int(2.0 * reach) + 1):
        point = a + (b - a) * (0.5 * step / max(length, 0.5))
        window = _window_around(space, point, point)
        if not window.is_blocked(point - window.low):
            return point
    return b if reach == length else a


def _window_around(
    space: FlightSpace, a: NDArray[np.float64], b: NDArray[np.float64]
) -> FlightWindow:
    """Returns the window around two points, voxels of the world."""
    x0, y0, z0 = (math.floor(value) - 1 for value in np.minimum(a, b))
    x1, y1, z1 = (math.floor(value) + 2 for value in np.maximum(a, b))
    return make_window(
        space.blocked, low=(x0, y0, z0), high=(x1, y1, z1), resolution=space.voxels.resolution
    )


def remaining_way(p_WP: NDArray[np.float64], position: Point) -> tuple[float, int]:
    """Returns the way to the end of a (k, 3) polyline, entered at its nearest point, metres.

    Also the index of the first point that still lies ahead.
    """
    if len(p_WP) < 2:
        return (math.dist(p_WP[-1], position), 0) if len(p_WP) else (0.0, 0)
    remaining, ahead = _remaining(frozen_view(p_WP, np.float64), np.array(position))
    return float(remaining), int(ahead)


@kernel
def _remaining(points: NDArray[np.float64], p: NDArray[np.float64]) -> tuple[float, int]:
    best, remaining, beyond, index = np.inf, 0.0, 0.0, len(points) - 1
    for k in range(len(points) - 2, -1, -1):
        step = points[k + 1] - points[k]
        squared = np.sum(step * step)
        t = min(max(np.sum((p - points[k]) * step) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        off = math.sqrt(np.sum((points[k] + t * step - p) ** 2))
        if off < best:
            best, index = off, k + 1
            remaining = off + (1.0 - t) * math.sqrt(squared) + beyond
        beyond += math.sqrt(squared)
    return remaining, index


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    points = np.array([[1.5, 1.5, 1.5], [2.5, 1.5, 1.5], [2.5, 2.5, 2.5]])
    shorten(np.zeros((4, 4, 1), np.uint32), points, np.array([2.0, 1.7, 2.0, 1.7]), 1)
    remaining_way(points, (1.0, 1.0, 1.0))
