"""Questions to a voxel map: what is in sight, and how near the nearest obstacle is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import VoxelMap
from unilavira_drake.messages.voxels import TILE

Point = tuple[float, float, float]

_HIT, _LEFT, _DONE = 0, 1, 2


def sight_distance(
    voxels: VoxelMap, p_WA: Point, p_WB: Point, *, unknown_blocks: bool = False
) -> float:
    """Returns how far one sees from A towards B, metres; inf when B is in sight.

    Args:
        voxels: the map.
        p_WA: where the eye is, metres in the world.
        p_WB: where it looks.
        unknown_blocks: whether unknown voxels end the view, as occupied ones do.

    Raises:
        ValueError: if a point is not finite.
    """
    start, end = np.array(p_WA) / voxels.resolution, np.array(p_WB) / voxels.resolution
    if not (np.isfinite(start).all() and np.isfinite(end).all()):
        raise ValueError("points must be finite")
    walk = np.empty(7)
    walk[:3] = np.floor(start)
    step = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        to_border = np.where(step > 0.0, walk[:3] + 1.0 - start, walk[:3] - start)
        walk[3:6] = np.where(step != 0.0, to_border / step, np.inf)
    walk[6] = 0.0
    threshold = -1 if unknown_blocks else 0
    while True:
        x, y, z = (int(walk[axis]) // TILE for axis in range(3))
        corner = np.array([x * TILE, y * TILE, z * TILE])
        outcome = _walk(frozen_view(voxels.tile((x, y, z)), np.int8), corner, step, walk, threshold)
        if outcome == _DONE:
            return math.inf
        if outcome == _HIT:
            return float(walk[6]) * math.dist(p_WA, p_WB)


def line_of_sight(
    voxels: VoxelMap, p_WA: Point, p_WB: Point, *, unknown_blocks: bool = False
) -> bool:
    """Returns whether no occupied voxel lies on the segment from A to B; see above."""
    return math.isinf(sight_distance(voxels, p_WA, p_WB, unknown_blocks=unknown_blocks))


def nearest_obstacle(
    voxels: VoxelMap, p_WP: Point, *, max_distance: float
) -> tuple[float, Point | None]:
    """Returns the distance to the nearest occupied voxel and that voxel's point nearest to P.

    Exact, 0 inside an occupied voxel; (inf, None) when none is within ``max_distance``, metres.

    Raises:
        ValueError: if the point or the distance is not finite.
    """
    p = np.array(p_WP) / voxels.resolution
    if not (np.isfinite(p).all() and math.isfinite(max_distance)):
        raise ValueError("the point and max_distance must be finite")
    bound = max_distance / voxels.resolution
    low = np.floor((p - bound) / TILE).astype(int)
    high = np.floor((p + bound) / TILE).astype(int)
    keys = [key for key in _keys(voxels, low, high) if _gap(key, p) <= bound]
    best, found = np.array([bound, 0.0, 0.0, 0.0]), False
    for key in sorted(keys, key=lambda key: (_gap(key, p), key)):
        if _gap(key, p) > best[0]:
            break
        tile = frozen_view(voxels.tiles[key], np.int8)
        found = bool(_nearest(tile, np.array(key) * TILE, p, best)) or found
    if not found:
        return math.inf, None
    x, y, z = (float(value) * voxels.resolution for value in best[1:])
    return float(best[0]) * voxels.resolution, (x, y, z)


def _keys(
    voxels: VoxelMap, low: NDArray[np.int64], high: NDArray[np.int64]
) -> list[tuple[int, int, int]]:
    """Returns the keys of the map's tiles in [low, high], by the shorter of two ways."""
    if np.prod(high - low + 1.0) > len(voxels.tiles):
        return [
            key
            for key in voxels.tiles
            if all(a <= value <= b for a, value, b in zip(low, key, high, strict=True))
        ]
    x, y, z = (range(int(a), int(b) + 1) for a, b in zip(low, high, strict=True))
    return [(a, b, c) for a in x for b in y for c in z if (a, b, c) in voxels.tiles]


def _gap(key: tuple[int, int, int], p: NDArray[np.float64]) -> float:
    """Returns the distance from a point to a tile, in voxels."""
    x, y, z = (
        max(index * TILE - float(value), float(value) - (index + 1) * TILE, 0.0)
        for index, value in zip(key, p, strict=True)
    )
    return math.sqrt(x * x + y * y + z * z)


@kernel
def _walk(
    tile: NDArray[np.int8],
    corner: NDArray[np.int64],
    step: NDArray[np.float64],
    walk: NDArray[np.float64],
    threshold: int,
) -> int:
    """Walks a ray on to the end of a tile (Amanatides and Woo 1987).

    ``walk`` holds the voxel, where the ray leaves it along each axis, and where it came in.
    """
    while True:
        i, j, k = int(walk[0]) - corner[0], int(walk[1]) - corner[1], int(walk[2]) - corner[2]
        if not (0 <= i < TILE and 0 <= j < TILE and 0 <= k < TILE):
            return _LEFT
        if tile[i, j, k] > threshold:
            return _HIT
        axis = 0 if walk[3] <= walk[4] and walk[3] <= walk[5] else 1 if walk[4] <= walk[5] else 2
        walk[6] = walk[3 + axis]
        if not walk[6] < 1.0:
            return _DONE
        walk[axis] += 1.0 if step[axis] > 0.0 else -1.0
        walk[3 + axis] += abs(1.0 / step[axis])


@kernel
def _nearest(
    tile: NDArray[np.int8],
    corner: NDArray[np.int64],
    p: NDArray[np.float64],
    best: NDArray[np.float64],
) -> bool:
    """Improves ``best``, distance and point, by the occupied voxels of a tile; whether it did."""
    found = False
    for i in range(TILE):
        x = min(max(p[0], corner[0] + i), corner[0] + i + 1.0)
        for j in range(TILE):
            y = min(max(p[1], corner[1] + j), corner[1] + j + 1.0)
            flat = (x - p[0]) ** 2 + (y - p[1]) ** 2
            if flat > best[0] * best[0]:
                continue
            for k in range(TILE):
                if tile[i, j, k] <= 0:
                    continue
                z = min(max(p[2], corner[2] + k), corner[2] + k + 1.0)
                distance = math.sqrt(flat + (z - p[2]) ** 2)
                if distance < best[0] or (not found and distance == best[0]):
                    best[0], best[1], best[2], best[3] = distance, x, y, z
                    found = True
    return found


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    tile = VoxelMap().tile((0, 0, 0))
    _walk(tile, np.zeros(3, np.int64), np.ones(3), np.full(7, 40.0), 0)
    _nearest(tile, np.zeros(3, np.int64), np.zeros(3), np.ones(4))
