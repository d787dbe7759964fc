"""A voxel map as seen from above: the occupancy map that pictures and transcripts show of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import OccupancyMap, VoxelMap
from unilavira_drake.messages.voxels import TILE


def top_view(voxels: VoxelMap) -> OccupancyMap:
    """Returns what stands in the way and what is free, cell by cell, as seen from above.

    A column is occupied where a voxel that reaches between the lowest and the highest altitude of
    the aircraft is occupied.  Otherwise it is free where anything up to the highest is known: the
    ground is no obstacle, and a ceiling alone says nothing of the room below it.  Log-odds are
    -1, 0 and 1.
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


def _column(voxels: VoxelMap, a: int, b: int, stack: list[int]) -> NDArray[np.int8]:
    """Returns (32, 32) int8 of one stack of tiles, indexed [x, y]."""
    lowest, highest = (altitude / voxels.resolution for altitude in voxels.altitudes)
    view = np.zeros((TILE, TILE), np.int8)
    for c in stack:
        tile = voxels.tiles[a, b, c]
        bottoms = np.arange(c * TILE, (c + 1) * TILE)
        # A voxel that only touches a limit is beyond it, whatever the rounding.
        flown = bottoms < highest - 1e-6
        ground = bottoms + 1 < lowest + 1e-6
        known = np.any((tile != 0) & flown, axis=2)
        view[known & (view == 0)] = -1
        view[np.any((tile > 0) & flown & ~ground, axis=2)] = 1
    return view
