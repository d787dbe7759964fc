"""Straight and steep flight through a grid of bits: what an edge costs, and whether it is free.

Coordinates are in voxels of a window: voxel (x, y, z) covers [x, x + 1) and so on, and bit
``z % 32`` of ``words[x, y, z // 32]`` says that it is blocked.  The outermost voxels of a window
always are.

An aircraft that may climb at no more than some angle reaches a steep goal by switchbacks.  The
length of such a way is ``max(|d|, |dz| / sin(angle))`` whatever its shape, which is a norm: all
searches use it as the cost of an edge.  Switchbacks may be so narrow that they fit wherever the
straight rise does, so the limits of climb and descent never cut off a goal.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import inlined_kernel, kernel

BLOCKED = -1
STRAIGHT = 0
"""An edge is blocked, flown straight, or as switchbacks (its code is then positive)."""

LEAST_SWITCH = 0.25
"""Switchbacks are no narrower than this, voxels."""

_TIE = 1e-9

Slopes = NDArray[np.float64]
"""1 / sin and 1 / tan of the steepest climb, then of the steepest descent."""


def slopes_of(climb_angle: float, descend_angle: float) -> Slopes:
    """Returns what the kernels need to know of the steepest climb and descent, radians."""
    angles = (climb_angle, descend_angle)
    numbers = [
        (1.0 / math.sin(a), 1.0 / math.tan(a)) if a < 0.5 * math.pi else (1.0, 0.0) for a in angles
    ]
    return np.array(numbers).ravel()


@inlined_kernel
def bit(words: NDArray[np.uint32], x: int, y: int, z: int) -> bool:
    """Returns whether a voxel of the window is blocked."""
    return bool((np.int64(words[x, y, z >> 5]) >> (z & 31)) & 1)


@inlined_kernel
def inside(words: NDArray[np.uint32], x: float, y: float, z: float) -> bool:
    """Returns whether a point lies in the window."""
    nx, ny, nz = words.shape[0], words.shape[1], 32 * words.shape[2]
    return bool(0.0 <= x < nx and 0.0 <= y < ny and 0.0 <= z < nz)


@kernel
def edge_cost(a: NDArray[np.float64], b: NDArray[np.float64], slopes: Slopes) -> float:
    """Returns the length of the way from a to b, voxels; (3,) each."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    straight = math.sqrt(dx * dx + dy * dy + dz * dz)
    return float(max(straight, dz * slopes[0] if dz > 0.0 else -dz * slopes[2]))


@kernel
def path_cost(nodes: NDArray[np.float64], slopes: Slopes) -> float:
    """Returns the length of the way along (k, 3) nodes, voxels."""
    total = 0.0
    for k in range(1, len(nodes)):
        total += edge_cost(nodes[k - 1], nodes[k], slopes)
    return total


@inlined_kernel
def _corner_is_blocked(
    words: NDArray[np.uint32], x: int, y: int, z: int, sx: int, sy: int, sz: int
) -> bool:
    """Returns whether a voxel beside a step over an edge or a corner is blocked; s is 0 or +-1."""
    found = False
    if sx != 0:
        found = found or bit(words, x + sx, y, z)
    if sy != 0:
        found = found or bit(words, x, y + sy, z)
    if sz != 0:
        found = found or bit(words, x, y, z + sz)
    if sx != 0 and sy != 0 and sz != 0:
        found = found or bit(words, x + sx, y + sy, z)
        found = found or bit(words, x + sx, y, z + sz) or bit(words, x, y + sy, z + sz)
    return found


@inlined_kernel
def _first_border(start: float, step: float, voxel: int) -> float:
    """Returns the share of a step after which it leaves its first voxel along one axis."""
    if step > 0.0:
        return (voxel + 1 - start) / step
    return (voxel - start) / step if step < 0.0 else np.inf


@kernel
def sees(
    words: NDArray[np.uint32], ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> bool:
    """Returns whether no blocked voxel touches the segment from a to b after its first voxel.

    Every voxel is visited (Amanatides and Woo 1987); where the segment passes through an edge or a
    corner, those beside it are, too.  Both ends must lie in the window.
    """
    x, y, z = math.floor(ax), math.floor(ay), math.floor(az)
    dx, dy, dz = bx - ax, by - ay, bz - az
    sx, sy, sz = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1), (1 if dz > 0.0 else -1)
    tx, ty, tz = _first_border(ax, dx, x), _first_border(ay, dy, y), _first_border(az, dz, z)
    ux = abs(1.0 / dx) if dx != 0.0 else np.inf
    uy = abs(1.0 / dy) if dy != 0.0 else np.inf
    uz = abs(1.0 / dz) if dz != 0.0 else np.inf
    while True:
        t = min(tx, ty, tz)
        if t >= 1.0 - _TIE:
            return True
        t += _TIE
        hx, hy, hz = (sx if tx <= t else 0), (sy if ty <= t else 0), (sz if tz <= t else 0)
        if abs(hx) + abs(hy) + abs(hz) > 1 and _corner_is_blocked(words, x, y, z, hx, hy, hz):
            return False
        if hx != 0:
            tx += ux
        if hy != 0:
            ty += uy
        if hz != 0:
            tz += uz
        x, y, z = x + hx, y + hy, z + hz
        if bit(words, x, y, z):
            return False


@kernel
def edge(
    words: NDArray[np.uint32], a: NDArray[np.float64], b: NDArray[np.float64], slopes: Slopes
) -> int:
    """Returns how the way from a to b is flown: ``BLOCKED``, ``STRAIGHT`` or switchbacks."""
    rise = b[2] - a[2]
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    needed = rise * slopes[1] if rise > 0.0 else -rise * slopes[3]
    if needed <= run * (1.0 + _TIE) + _TIE:
        return STRAIGHT if sees(words, a[0], a[1], a[2], b[0], b[1], b[2]) else BLOCKED
    sides = 2 if run > _TIE else 4
    legs = 2
    spread = math.sqrt(max(needed * needed - run * run, 0.0))
    while legs == 2 or spread / legs >= LEAST_SWITCH:
        for side in range(sides):
            if _switchbacks_are_free(words, a, b, spread / legs, legs, side):
                return 4 * legs + side
        legs *= 2
    return BLOCKED


@kernel
def turning_point(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    width: float,
    legs: int,
    side: int,
    i: int,
) -> tuple[float, float, float]:
    """Returns the end of leg i of switchbacks from a to b: every other one is off to a side."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    run = math.hypot(dx, dy)
    if run > _TIE:
        sign = 1.0 if side == 0 else -1.0
        across_x, across_y = -sign * dy / run, sign * dx / run
    else:
        across_x = 1.0 if side == 0 else -1.0 if side == 1 else 0.0
        across_y = 1.0 if side == 2 else -1.0 if side == 3 else 0.0
    off = width if i % 2 == 1 else 0.0
    share = i / legs
    return (
        a[0] + share * dx + off * across_x,
        a[1] + share * dy + off * across_y,
        a[2] + share * dz,
    )


@kernel
def _switchbacks_are_free(
    words: NDArray[np.uint32],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    width: float,
    legs: int,
    side: int,
) -> bool:
    x, y, z = a[0], a[1], a[2]
    for i in range(1, legs + 1):
        px, py, pz = turning_point(a, b, width, legs, side, i)
        # A point on a border counts to the voxel in which the next leg begins.
        if not inside(words, px, py, pz) or bit(words, int(px), int(py), int(pz)):
            return False
        if not sees(words, x, y, z, px, py, pz):
            return False
        x, y, z = px, py, pz
    return True


@kernel
def unfold(
    words: NDArray[np.uint32], nodes: NDArray[np.float64], slopes: Slopes
) -> NDArray[np.float64]:
    """Returns the (m, 3) polyline that is flown along the (k, 3) nodes of a path."""
    codes = np.zeros(len(nodes), np.int64)
    total = 1
    for k in range(1, len(nodes)):
        codes[k] = max(edge(words, nodes[k - 1], nodes[k], slopes), 0)
        total += max(codes[k] // 4, 1)
    points = np.empty((total, 3))
    points[0] = nodes[0]
    n = 1
    for k in range(1, len(nodes)):
        a, b = nodes[k - 1], nodes[k]
        legs = max(codes[k] // 4, 1)
        run = math.hypot(b[0] - a[0], b[1] - a[1])
        rise = b[2] - a[2]
        needed = rise * slopes[1] if rise > 0.0 else -rise * slopes[3]
        width = math.sqrt(max(needed * needed - run * run, 0.0)) / legs
        for i in range(1, legs + 1):
            x, y, z = turning_point(a, b, width, legs, codes[k] % 4, i)
            points[n, 0], points[n, 1], points[n, 2] = x, y, z
            n += 1
        points[n - 1] = b
    return points


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    words = np.zeros((4, 4, 1), np.uint32)
    nodes = np.array([[1.5, 1.5, 1.5], [2.5, 1.5, 1.5], [2.5, 2.5, 2.5]])
    slopes = slopes_of(math.radians(30.0), math.radians(30.0))
    unfold(words, nodes, slopes)
    edge(words, nodes[0], nodes[1], slopes)
    sees(words, 1.5, 1.5, 1.5, 2.5, 1.5, 1.5)
    path_cost(nodes, slopes)
    edge_cost(nodes[0], nodes[1], slopes)
