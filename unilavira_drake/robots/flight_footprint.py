"""The rectangle that an aircraft is seen from above: how wide it is in flight, and where it turns.

Around the vertical axis it reaches as far as its corners; beside its way only as far as its true
shape does for the yaw that it has.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel

Size = tuple[float, float]
"""Length along the nose and width across it, metres."""


@kernel
def half_width(size: Size, yaw: float, direction: NDArray[np.float64]) -> float:
    """Returns how far the rectangle reaches beside a way, to either side, metres.

    Args:
        size: of the rectangle.
        yaw: of its nose, radians.
        direction: (3,) of the way; without a horizontal part the corners count.
    """
    level = math.hypot(direction[0], direction[1])
    if level < 1e-9:
        return 0.5 * math.hypot(size[0], size[1])
    c = (direction[0] * math.cos(yaw) + direction[1] * math.sin(yaw)) / level
    s = (direction[1] * math.cos(yaw) - direction[0] * math.sin(yaw)) / level
    width: float = size[0] * abs(s) + size[1] * abs(c)
    return 0.5 * width


@kernel
def overlaps(size: Size, yaw: float, x: float, y: float, half: float) -> bool:
    """Returns whether a turned rectangle overlaps an upright square, by their separating axes.

    Args:
        size: of the rectangle, metres.
        yaw: of it, radians.
        x: of the square's centre as seen from the rectangle's, metres.
        y: the same.
        half: half a side of the square, metres.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    a, b = 0.5 * size[0], 0.5 * size[1]
    spread = half * (abs(c) + abs(s))
    if abs(x) >= half + a * abs(c) + b * abs(s) or abs(y) >= half + a * abs(s) + b * abs(c):
        return False
    return abs(c * x + s * y) < a + spread and abs(c * y - s * x) < b + spread


@kernel
def turn_meets(
    log_odds: NDArray[np.int8],
    corner: tuple[int, int, int],
    bounds: NDArray[np.int64],
    resolution: float,
    p: NDArray[np.float64],
    yaw: float,
    turned: float,
    size: Size,
) -> bool:
    """Returns whether an aircraft that turns meets an occupied voxel that it does not meet yet.

    What is farther above or below than half the diagonal does not count.

    Args:
        log_odds: int8 of some voxels; positive is occupied.
        corner: the voxel of ``log_odds[0, 0, 0]``.
        bounds: (6,) lowest voxel that counts, and one beyond the highest.
        resolution: side of a voxel, metres.
        p: (3,) where the aircraft is, metres.
        yaw: that it has, radians.
        turned: that it would have.
        size: of the aircraft.
    """
    half, radius = 0.5 * resolution, 0.5 * math.hypot(size[0], size[1])
    nx, ny, nz = log_odds.shape
    for i in range(max(bounds[0] - corner[0], 0), min(bounds[3] - corner[0], nx)):
        for j in range(max(bounds[1] - corner[1], 0), min(bounds[4] - corner[1], ny)):
            x = (corner[0] + i + 0.5) * resolution - p[0]
            y = (corner[1] + j + 0.5) * resolution - p[1]
            if overlaps(size, yaw, x, y, half) or not overlaps(size, turned, x, y, half):
                continue
            for k in range(max(bounds[2] - corner[2], 0), min(bounds[5] - corner[2], nz)):
                if log_odds[i, j, k] <= 0:
                    continue
                z = (corner[2] + k + 0.5) * resolution - p[2]
                gaps = (max(abs(x) - half, 0.0), max(abs(y) - half, 0.0), max(abs(z) - half, 0.0))
                if gaps[0] ** 2 + gaps[1] ** 2 + gaps[2] ** 2 < radius**2:
                    return True
    return False


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    three, window = np.zeros(3), frozen_view(np.zeros((1, 1, 1)), np.int8)
    half_width((1.0, 1.0), 0.0, three)
    bounds = np.zeros(6, np.int64)
    turn_meets(window, (0, 0, 0), bounds, 1.0, three, 0.0, 0.1, (1.0, 1.0))
