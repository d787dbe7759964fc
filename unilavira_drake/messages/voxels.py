"""The 3-D map: log-odds of occupancy in voxels, kept in tiles that maps share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages.frozen import Message, read_only

TILE = 32
"""Voxels along each side of a tile."""

Tiles = Mapping[tuple[int, int, int], NDArray[Any]]

_UNKNOWN = read_only(np.zeros((TILE, TILE, TILE), np.int8))


@dataclass(frozen=True, eq=False)
class VoxelMap(Message):
    """Log-odds of occupancy of voxels; it has no border.

    Voxel (i, j, k) covers x in [i r, (i + 1) r), y in [j r, (j + 1) r) and z in [k r, (k + 1) r)
    of the world, r being the resolution.  Tile (a, b, c) holds the voxels from
    (32 a, 32 b, 32 c) on.  0 is unknown, negative free, positive occupied.  What has no tile is
    unknown.  A map made from another shares all tiles that did not change.

    Raises:
        ValueError: if a tile has another shape or type, or resolution or altitudes make no sense.
    """

    n: int = 0
    """Number of the latest panorama that is part of this map."""
    version: int = 0
    time: float = 0.0
    resolution: float = 0.5
    """Side of a voxel, metres."""
    tiles: Tiles = field(default_factory=dict)
    """(32, 32, 32) int8 of each tile, indexed [x, y, z]."""
    rejected: tuple[str, ...] = ()
    """Why views of the latest integration were left out, one reason each."""
    altitudes: tuple[float, float] = (-math.inf, math.inf)
    """Lowest and highest z at which its aircraft flies, metres: between them things are in the way,
    below is ground, above are ceilings."""

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution < math.inf:
            raise ValueError(f"the resolution must be positive, not {self.resolution}")
        if not self.altitudes[0] < self.altitudes[1]:
            raise ValueError(f"the lowest altitude must be below the highest, not {self.altitudes}")
        for key, tile in self.tiles.items():
            if tile.shape != (TILE, TILE, TILE) or tile.dtype != np.int8:
                raise ValueError(f"tile {key} must be {TILE} x {TILE} x {TILE} of int8")
        frozen = {key: read_only(tile) for key, tile in self.tiles.items()}
        object.__setattr__(self, "tiles", MappingProxyType(frozen))

    def __reduce__(self) -> tuple[Any, ...]:
        fields = (self.n, self.version, self.time, self.resolution, dict(self.tiles), self.rejected)
        return VoxelMap, (*fields, self.altitudes)

    def voxel(self, p_WP: tuple[float, float, float]) -> tuple[int, int, int]:
        """Returns the voxel of a world point, metres."""
        x, y, z = (math.floor(value / self.resolution) for value in p_WP)
        return x, y, z

    def center(self, voxel: tuple[int, int, int]) -> tuple[float, float, float]:
        """Returns the world (x, y, z) of a voxel's centre, metres."""
        x, y, z = ((index + 0.5) * self.resolution for index in voxel)
        return x, y, z

    def tile(self, key: tuple[int, int, int]) -> NDArray[np.int8]:
        """Returns a tile, all unknown where the map has none; (32, 32, 32) int8."""
        return self.tiles.get(key, _UNKNOWN)

    def log_odds(self, voxel: tuple[int, int, int]) -> int:
        """Returns the log-odds of a voxel, tenths."""
        i, j, k = voxel
        key = (i // TILE, j // TILE, k // TILE)
        return int(self.tile(key)[i % TILE, j % TILE, k % TILE])

    def state(self, p_WP: tuple[float, float, float]) -> str:
        """Returns ``unknown``, ``free`` or ``occupied`` of a world point, metres."""
        value = self.log_odds(self.voxel(p_WP))
        return "unknown" if value == 0 else "free" if value < 0 else "occupied"

    def window(self, low: tuple[int, int, int], high: tuple[int, int, int]) -> NDArray[np.int8]:
        """Returns a copy of the log-odds of the voxels in [low, high), indexed [x, y, z]."""
        shape = tuple(max(b - a, 0) for a, b in zip(low, high, strict=True))
        dense = np.zeros(shape, np.int8)
        for key in tiles_between(low, high):
            tile = self.tiles.get(key)
            if tile is not None:
                here, there = overlap(key, low, high)
                dense[there] = tile[here]
        return dense


def tiles_between(
    low: tuple[int, int, int], high: tuple[int, int, int]
) -> list[tuple[int, int, int]]:
    """Returns the keys of the tiles that hold voxels of [low, high), in order."""
    x, y, z = (
        range(a // TILE, -(-b // TILE)) if b > a else range(0)
        for a, b in zip(low, high, strict=True)
    )
    return [(a, b, c) for a in x for b in y for c in z]


def overlap(
    key: tuple[int, int, int], low: tuple[int, int, int], high: tuple[int, int, int]
) -> tuple[tuple[slice, slice, slice], tuple[slice, slice, slice]]:
    """Returns where the voxels of [low, high) lie in a tile, and where in the window."""
    here, there = [], []
    for index, a, b in zip(key, low, high, strict=True):
        first, last = max(index * TILE, a), min((index + 1) * TILE, b)
        here.append(slice(first - index * TILE, last - index * TILE))
        there.append(slice(first - a, last - a))
    return (here[0], here[1], here[2]), (there[0], there[1], there[2])
