"""Things whose pixels are known to move: kept out of the map, but for a few seconds."""

from __future__ import annotations

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.messages.cell_tiles import TILE, Key

LABELS = 32768
"""Render labels are below this."""


def wanted(labels: Sequence[int]) -> NDArray[np.bool_]:
    """Returns a (32768,) table that is true for these labels."""
    table = np.zeros(LABELS, np.bool_)
    table[list(labels)] = True
    return table


def without(view: DepthView, moves: NDArray[np.bool_]) -> DepthView:
    """Returns a view that says nothing where things move: no reading, neither free nor occupied.

    Args:
        view: what the camera measured.
        moves: (H, W) bool.
    """
    return dc.replace(view, depth=np.where(moves, np.float32(0.0), view.depth))


def with_moving(
    occupancy: OccupancyMap,
    views: Sequence[tuple[DepthView, NDArray[np.bool_]]],
    parameters: MappingParameters,
    floor_height: float,
) -> OccupancyMap:
    """Returns the map with the moving things of these views as newcomers.

    Args:
        occupancy: integrated from what these views say of the rest.
        views: each with (H, W) bool, where things move.
        parameters: of the map; ``newest`` above 0.
        floor_height: z of the floor in the world, metres.
    """
    cells = [_cells(view, moves, parameters, floor_height) for view, moves in views]
    places = np.unique(np.concatenate([*cells, np.zeros((0, 2), np.int64)]), axis=0)
    tiles: dict[Key, NDArray[np.int8]] = {}
    for row, column in places.tolist():
        key = row // TILE, column // TILE
        if key not in tiles:
            old = occupancy.cells.tiles.get(key)
            tiles[key] = np.zeros((TILE, TILE), np.int8) if old is None else old.copy()
        i, j = row % TILE, column % TILE
        if tiles[key][i, j] <= parameters.newest:
            tiles[key][i, j] = parameters.newest
    if not tiles:
        return occupancy
    for tile in tiles.values():
        tile.flags.writeable = False
    grid = occupancy.cells
    return dc.replace(occupancy, cells=grid.updated(tiles, first=grid.first, shape=grid.shape))


def _cells(
    view: DepthView, moves: NDArray[np.bool_], own: MappingParameters, floor_height: float
) -> NDArray[np.int64]:
    """Returns the (k, 2) cells (row, column) over which things that move are seen."""
    step = own.stride
    depth = view.depth[::step, ::step]
    v, u = np.nonzero(moves[::step, ::step] & np.isfinite(depth) & (depth > 0.0))
    z = depth[v, u].astype(np.float64)
    k = view.intrinsics
    rays = np.stack(((step * u - k.cx) / k.fx * z, (step * v - k.cy) / k.fy * z, z))
    offset = view.X_WC[:3, :3] @ rays
    height = offset[2] + view.X_WC[2, 3] - floor_height
    inside = (height >= own.min_height) & (height <= own.max_height)
    inside &= np.hypot(offset[0], offset[1]) <= own.max_range
    p_W = offset[:2, inside].T + view.X_WC[:2, 3]
    cells: NDArray[np.int64] = np.floor(p_W[:, ::-1] / own.resolution).astype(np.int64)
    return cells
