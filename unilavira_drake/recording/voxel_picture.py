"""A voxel map as seen from above: the occupancy map that pictures and transcripts show of it."""

from __future__ import annotations

import numpy as np

from unilavira_drake.messages import OccupancyMap, VoxelMap
from unilavira_drake.messages.voxels import TILE

STANDING = 2.0
"""What rises so far above the lowest thing in its tile column counts as an obstacle, metres."""


def top_view(voxels: VoxelMap) -> OccupancyMap:
    """Returns what stands in the way and what is free, cell by cell, as seen from above.

    A column is occupied where something rises ``STANDING`` above the lowest occupied voxel of the
    32 x 32 columns around it, which is the ground as far as it was seen; it is free where something
    else is known.  Log-odds are -1, 0 and 1.
    """
    if not voxels.tiles:
        return OccupancyMap(voxels.n, voxels.version, voxels.time, voxels.resolution)
    keys = np.array(sorted({key[:2] for key in voxels.tiles}))
    low = keys.min(axis=0)
    columns, rows = (keys.max(axis=0) - low + 1) * TILE
    cells = np.zeros((rows, columns), np.int8)
    for a, b in keys.tolist():
        stack = sorted(key[2] for key in voxels.tiles if key[:2] == (a, b))
        i, j = (b - low[1]) * TILE, (a - low[0]) * TILE
        view = _column(voxels, a, b, stack)
        cells[i : i + TILE, j : j + TILE] = view.T
    x, y = (low * TILE * voxels.resolution).tolist()
    return OccupancyMap(
        voxels.n, voxels.version, voxels.time, voxels.resolution, (x, y), cells,
        rejected=voxels.rejected,
    )  # fmt: skip


def _column(voxels: VoxelMap, a: int, b: int, stack: list[int]) -> np.ndarray:
    """Returns (32, 32) int8 of one stack of tiles, indexed [x, y]."""
    tiles = [voxels.tiles[a, b, c] for c in stack]
    bottoms = np.concatenate([np.arange(c * TILE, (c + 1) * TILE) for c in stack])
    occupied = np.concatenate([tile > 0 for tile in tiles], axis=2)
    known = np.any([np.any(tile != 0, axis=2) for tile in tiles], axis=0)
    levels = np.flatnonzero(occupied.any(axis=(0, 1)))
    view = np.where(known, -1, 0).astype(np.int8)
    if len(levels):
        standing = bottoms >= bottoms[levels[0]] + STANDING / voxels.resolution
        view[np.any(occupied & standing, axis=2)] = 1
    return view
