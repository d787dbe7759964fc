"""Kernels of the voxel map: what one depth image says about the voxels before the camera.

Every sampled pixel stands for a thin pyramid.  It is free up to the nearest of the readings
around it: a single ray would also cut through the surface between two of them where the camera
looks along a floor or a wall.  Within one image a voxel counts once, and a hit outweighs any
number of rays that pass (Hornung et al. 2013, OctoMap).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, inlined_kernel, kernel

FREE_STEP = -4
"""Change of log-odds of a voxel seen free, tenths."""
HIT_STEP = 9
"""Change of log-odds of a voxel seen occupied, tenths."""
LOWEST = -20
HIGHEST = 28
"""Log-odds stay within [LOWEST, HIGHEST]: a thing that moved away is forgotten after at most seven
looks, and one that came is known after three."""
HIT_DEPTH = 0.01
"""Hits are pushed this share of a voxel along their ray: a surface on the border of two voxels
belongs to the one behind it."""
FREE = np.uint8(1)
HIT = np.uint8(2)


@kernel
def sample(
    depth: NDArray[np.float32],
    stride: int,
    camera: NDArray[np.float64],
    limits: NDArray[np.float64],
    readings: NDArray[np.float64],
    sights: NDArray[np.float64],
) -> None:
    """Reads every ``stride``-th row and column.

    Args:
        depth: (H, W) float32, metres along the camera's z.
        stride: pixels between two samples.
        camera: fx, fy, cx, cy, pixels.
        limits: range up to which depth counts, reading from which on it is none, and 1.0 if
            inf says that nothing lies within the range; metres.
        readings: (h, w) depth of what was hit, 0 where nothing was; filled.
        sights: (h, w) depth up to which the pixel's pyramid is free; filled.
    """
    rows, columns = readings.shape
    for a in range(rows):
        y = (a * stride + stride // 2 - camera[3]) / camera[1]
        for b in range(columns):
            x = (b * stride + stride // 2 - camera[2]) / camera[0]
            d = np.float64(depth[a * stride + stride // 2, b * stride + stride // 2])
            far = limits[0] / math.sqrt(1.0 + x * x + y * y)
            valid = (0.0 < d < limits[1]) or (limits[2] > 0.0 and d == np.inf)
            readings[a, b] = (d if d <= far else np.inf) if valid else 0.0
            sights[a, b] = min(d, far) if valid else 0.0
    _nearest_around(sights)


@inlined_kernel
def _nearest_around(sights: NDArray[np.float64]) -> None:
    """Replaces each sight by the least of the 3 x 3 around it; 0 is none and stays 0."""
    rows, columns = sights.shape
    across = np.full((rows + 2, columns), np.inf)
    for a in range(rows):
        before = here = np.inf
        for b in range(columns):
            if sights[a, b] <= 0.0:
                sights[a, b] = np.inf
        for b in range(columns):
            before, here = here, sights[a, b]
            after = sights[a, b + 1] if b + 1 < columns else np.inf
            across[a + 1, b] = min(before, here, after)
    for a in range(rows):
        for b in range(columns):
            least = min(across[a, b], across[a + 1, b], across[a + 2, b])
            sights[a, b] = least if sights[a, b] < np.inf else 0.0


@inlined_kernel
def _ray(
    a: int, b: int, stride: int, camera: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Returns the step in voxels per metre of depth, and the push of a hit in metres of depth."""
    x = (b * stride + stride // 2 - camera[2]) / camera[0]
    y = (a * stride + stride // 2 - camera[3]) / camera[1]
    dx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2]
    dy = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2]
    dz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2]
    return dx, dy, dz, HIT_DEPTH / math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def extent(
    stride: int,
    camera: NDArray[np.float64],
    pose: NDArray[np.float64],
    readings: NDArray[np.float64],
    sights: NDArray[np.float64],
    box: NDArray[np.int64],
) -> None:
    """Fills ``box``, (2, 3), with the lowest and the highest voxel that a ray may touch.

    ``pose`` is (3, 4): the camera's rotation and position in units of a voxel.
    """
    low_x = high_x = pose[0, 3]
    low_y = high_y = pose[1, 3]
    low_z = high_z = pose[2, 3]
    for a in range(readings.shape[0]):
        for b in range(readings.shape[1]):
            d = sights[a, b]
            if d <= 0.0:
                continue
            dx, dy, dz, push = _ray(a, b, stride, camera, pose)
            if readings[a, b] < np.inf:
                d = readings[a, b] + push
            low_x, high_x = min(low_x, pose[0, 3] + d * dx), max(high_x, pose[0, 3] + d * dx)
            low_y, high_y = min(low_y, pose[1, 3] + d * dy), max(high_y, pose[1, 3] + d * dy)
            low_z, high_z = min(low_z, pose[2, 3] + d * dz), max(high_z, pose[2, 3] + d * dz)
    # One voxel more on every side, for what adding up steps may round away.
    box[0, 0], box[1, 0] = math.floor(low_x) - 1, math.floor(high_x) + 1
    box[0, 1], box[1, 1] = math.floor(low_y) - 1, math.floor(high_y) + 1
    box[0, 2], box[1, 2] = math.floor(low_z) - 1, math.floor(high_z) + 1


@kernel
def carve(
    stride: int,
    camera: NDArray[np.float64],
    pose: NDArray[np.float64],
    readings: NDArray[np.float64],
    sights: NDArray[np.float64],
    low: NDArray[np.int64],
    stamps: NDArray[np.uint8],
) -> None:
    """Stamps the voxels that this image shows free or hit; arguments as for :func:`extent`.

    ``low`` is the voxel of ``stamps[0, 0, 0]``.  A voxel is free when a ray leaves it before its
    pyramid ends (Amanatides and Woo 1987).
    """
    flat = stamps.ravel()
    across_y, across_x = stamps.shape[2], stamps.shape[1] * stamps.shape[2]
    px, py, pz = pose[0, 3], pose[1, 3], pose[2, 3]
    ix, iy, iz = math.floor(px), math.floor(py), math.floor(pz)
    start = (ix - low[0]) * across_x + (iy - low[1]) * across_y + (iz - low[2])
    for a in range(readings.shape[0]):
        for b in range(readings.shape[1]):
            end = sights[a, b]
            if end <= 0.0:
                continue
            dx, dy, dz, push = _ray(a, b, stride, camera, pose)
            ux = 1.0 / abs(dx) if dx != 0.0 else np.inf
            uy = 1.0 / abs(dy) if dy != 0.0 else np.inf
            uz = 1.0 / abs(dz) if dz != 0.0 else np.inf
            tx = (ix + 1 - px if dx > 0.0 else px - ix) * ux if dx != 0.0 else np.inf
            ty = (iy + 1 - py if dy > 0.0 else py - iy) * uy if dy != 0.0 else np.inf
            tz = (iz + 1 - pz if dz > 0.0 else pz - iz) * uz if dz != 0.0 else np.inf
            sx = across_x if dx > 0.0 else -across_x
            sy = across_y if dy > 0.0 else -across_y
            sz = 1 if dz > 0.0 else -1
            at = start
            while min(tx, ty, tz) <= end:
                if flat[at] == 0:
                    flat[at] = FREE
                if tx <= ty and tx <= tz:
                    at += sx
                    tx += ux
                elif ty <= tz:
                    at += sy
                    ty += uy
                else:
                    at += sz
                    tz += uz
            d = readings[a, b]
            if d < np.inf:
                d += push
                hx = math.floor(px + d * dx) - low[0]
                hy = math.floor(py + d * dy) - low[1]
                flat[hx * across_x + hy * across_y + math.floor(pz + d * dz) - low[2]] = HIT


@kernel
def apply(old: NDArray[np.int8], stamps: NDArray[np.uint8], new: NDArray[np.int8]) -> bool:
    """Fills ``new`` with the log-odds of a tile after the stamps; returns whether they differ."""
    changes = 0
    for i in range(old.shape[0]):
        for j in range(old.shape[1]):
            for k in range(old.shape[2]):
                stamp = stamps[i, j, k]
                step = HIT_STEP if stamp == HIT else FREE_STEP if stamp == FREE else 0
                was = np.int16(old[i, j, k])
                value: Any = min(max(was + np.int16(step), LOWEST), HIGHEST)
                if value == 0 and step != 0:
                    value = 1 if step > 0 else -1
                new[i, j, k] = value
                changes += value != was
    return changes > 0


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    depth = frozen_view(np.ones((1, 1)), np.float32)
    camera, limits = np.ones(4), np.array([1.0, 2.0, 0.0])
    readings, sights = np.zeros((1, 1)), np.zeros((1, 1))
    sample(depth, 1, camera, limits, readings, sights)
    pose, box = np.eye(3, 4), np.zeros((2, 3), np.int64)
    extent(1, camera, pose, readings, sights, box)
    stamps = np.zeros((8, 8, 8), np.uint8)
    carve(1, camera, pose, readings, sights, box[0], stamps)
    apply(frozen_view(stamps, np.int8), stamps[:, :, :], np.zeros((8, 8, 8), np.int8))
