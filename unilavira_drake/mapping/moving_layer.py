"""The things that move as a layer over the map: what planner and governor keep clear of."""

from __future__ import annotations

import dataclasses as dc
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.moving_things import BODY, MovingThing, cells_around
from unilavira_drake.mapping.occupancy import MappingParameters
from unilavira_drake.mapping.storeys import SAME_STOREY
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.messages.cell_tiles import TILE, Key

BERTH = 0.12
"""What a way keeps beyond its own clearance to them, metres: the planner's radius is that of a base
that drives along, and the corners of one that turns round somebody reach farther."""


def with_moving(
    occupancy: OccupancyMap,
    things: Iterable[MovingThing],
    parameters: MappingParameters,
    floor_height: float,
) -> OccupancyMap:
    """Returns the map with the things that move on this storey.

    Their bodies have log-odds ``newest``, and their berth around them 1 less; what is occupied for
    certain stays so.

    Args:
        occupancy: of the rest.
        things: as they are remembered.
        parameters: of the map; ``newest`` above 0.
        floor_height: z of the storey's floor in the world, metres.
    """
    here = [thing for thing in things if abs(thing.floor_height - floor_height) <= SAME_STOREY]
    if not here:
        return occupancy
    resolution, newest = occupancy.resolution, parameters.newest
    bodies = [cells_around(*thing.position, BODY, resolution) for thing in here]
    bodies += [thing.cells for thing in here]
    berths = [cells_around(*thing.position, BODY + BERTH, resolution) for thing in here]
    tiles: dict[Key, NDArray[np.int8]] = {}
    for value, groups in ((max(newest - 1, 1), berths), (newest, bodies)):
        _raise(occupancy, tiles, np.concatenate(groups), value)
    for tile in tiles.values():
        tile.flags.writeable = False
    grid = occupancy.cells
    return dc.replace(occupancy, cells=grid.updated(tiles, first=grid.first, shape=grid.shape))


def _raise(
    occupancy: OccupancyMap,
    tiles: dict[Key, NDArray[np.int8]],
    cells: NDArray[np.int64],
    value: int,
) -> None:
    """Raises the log-odds of cells to a value; ``tiles`` are the changed ones."""
    keys = cells // TILE
    for a, b in np.unique(keys, axis=0).tolist():
        if (a, b) not in tiles:
            old = occupancy.cells.tiles.get((a, b))
            tiles[a, b] = np.zeros((TILE, TILE), np.int8) if old is None else old.copy()
        i, j = (cells[(keys == (a, b)).all(axis=1)] % TILE).T
        tiles[a, b][i, j] = np.maximum(tiles[a, b][i, j], value)
