"""Triangles of polygons that need not be convex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Triple = tuple[int, int, int]


def triangulated(points: NDArray[np.float64]) -> list[Triple]:
    """Returns the triangles of a simple polygon with corners (n, 3), by cutting off ears.

    A polygon that is not simple gets a fan for what is left of it.
    """
    count = len(points)
    if count == 3:
        return [(0, 1, 2)]
    flat = _projected(points)
    left = list(range(count))
    triangles: list[Triple] = []
    while len(left) > 3:
        ear = _ear(flat, left)
        if ear is None:
            break
        a, b, c = left[ear - 1], left[ear], left[(ear + 1) % len(left)]
        triangles.append((a, b, c))
        del left[ear]
    triangles += [(left[0], left[i], left[i + 1]) for i in range(1, len(left) - 1)]
    return triangles


def _projected(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the corners in the polygon's plane, counter-clockwise."""
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    area = np.sum(flat[:, 0] * np.roll(flat[:, 1], -1) - flat[:, 1] * np.roll(flat[:, 0], -1))
    return flat if area >= 0 else flat * np.array([1.0, -1.0])


def _ear(flat: NDArray[np.float64], left: list[int]) -> int | None:
    corners = flat[left]
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    turns = _cross(corners - before, after - corners)
    for i in np.flatnonzero(turns > 0):
        a, b, c = before[i], corners[i], after[i]
        inside = (
            (_cross(b - a, corners - a) >= 0)
            & (_cross(c - b, corners - b) >= 0)
            & (_cross(a - c, corners - c) >= 0)
        )
        same = [(corners == corner).all(axis=1) for corner in (a, b, c)]
        if not (inside & ~same[0] & ~same[1] & ~same[2]).any():
            return int(i)
    straight = np.flatnonzero(turns == 0)
    return int(straight[0]) if len(straight) else None


def _cross(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return result
