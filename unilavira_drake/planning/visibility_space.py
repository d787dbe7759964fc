"""Where an aircraft may fly: the voxel map, inflated, as bits.

A voxel is blocked when some point of an occupied voxel may be nearer than the radius to some
point of it; so whatever stays within voxels that are not blocked keeps the radius.  Below and
above, margins may ask for more.  Unknown voxels are free until something is seen in them.  Each
tile is kept as one bit a voxel; a new map only costs the tiles in which some voxel became
occupied or free.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import Message, VoxelMap
from unilavira_drake.messages.voxels import TILE

Key = tuple[int, int, int]
Bits = NDArray[np.uint32]
"""(32, 32) uint32 of a tile: bit z of word [x, y]."""

_NO_BITS: Bits = np.zeros((TILE, TILE), np.uint32)
_NO_BITS.flags.writeable = False


@dataclass(frozen=True)
class Clearance(Message):
    """What an aircraft keeps free around its centre, metres.

    Raises:
        ValueError: if a number is negative or not finite.
    """

    radius: float = 0.5
    ground_margin: float = 1.0
    """To whatever is below."""
    ceiling_margin: float = 0.5
    """To whatever is above."""

    def __post_init__(self) -> None:
        for value in (self.radius, self.ground_margin, self.ceiling_margin):
            if not 0.0 <= value < math.inf:
                raise ValueError("radius and margins must be finite and not negative")

    @functools.lru_cache(maxsize=8)  # noqa: B019 (frozen, and few)
    def columns(self, resolution: float) -> NDArray[np.int64]:
        """Returns (m, 4) offsets dx, dy of columns, and how far down and up each is to be free.

        Raises:
            ValueError: if that is more than 31 voxels.
        """
        radius = self.radius / resolution
        below = math.ceil(self.ground_margin / resolution - 1e-9)
        above = math.ceil(self.ceiling_margin / resolution - 1e-9)
        reach = max(math.ceil(radius - 1e-9), 0)
        if max(reach, below, above) >= TILE:
            raise ValueError(f"radius and margins must be less than {TILE} voxels")
        rows = []
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                gap = math.hypot(max(abs(dx) - 1, 0), max(abs(dy) - 1, 0))
                if gap < radius - 1e-9 or dx == dy == 0:
                    height = math.ceil(math.sqrt(max(radius**2 - gap**2, 0.0)) - 1e-9)
                    rows.append((dx, dy, max(height, below), max(height, above)))
        return np.array(rows, np.int64)


@dataclass(frozen=True, eq=False)
class BitTiles(Message):
    """Bits of the voxels of a world without border; what has no tile is all zero."""

    tiles: Mapping[Key, Bits] = field(default_factory=dict)
    pool: NDArray[np.uint32] = field(default_factory=lambda: np.zeros((1, TILE, TILE), np.uint32))
    """(n, 32, 32) uint32: all tiles, after an empty one."""
    directory: NDArray[np.int32] = field(default_factory=lambda: np.zeros((1, 1, 1), np.int32))
    """Place in the pool of tile ``first`` + (a, b, c)."""
    first: Key = (0, 0, 0)

    @staticmethod
    def of(tiles: Mapping[Key, Bits]) -> BitTiles:
        """Returns these tiles, laid out for the kernels."""
        if not tiles:
            return BitTiles()
        keys = np.array(list(tiles))
        first = keys.min(axis=0)
        directory = np.zeros(keys.max(axis=0) - first + 1, np.int32)
        directory[tuple((keys - first).T)] = np.arange(1, len(keys) + 1)
        pool = np.stack([_NO_BITS, *tiles.values()])
        directory.flags.writeable = pool.flags.writeable = False
        x, y, z = (int(value) for value in first)
        return BitTiles(MappingProxyType(dict(tiles)), pool, directory, (x, y, z))


@dataclass(frozen=True, eq=False)
class FlightSpace(Message):
    """The voxels of one map that are occupied, and those that are blocked."""

    voxels: VoxelMap = field(default_factory=VoxelMap)
    clearance: Clearance = Clearance()
    occupied: BitTiles = field(default_factory=BitTiles)
    blocked: BitTiles = field(default_factory=BitTiles)


def update_space(space: FlightSpace, voxels: VoxelMap) -> FlightSpace:
    """Returns the space of a newer map of the same world; the same one if nothing changed.

    Raises:
        ValueError: if radius or margins are 32 voxels or more.
    """
    if voxels is space.voxels:
        return space
    if voxels.resolution != space.voxels.resolution:
        space = FlightSpace(VoxelMap(resolution=voxels.resolution), space.clearance)
    columns = space.clearance.columns(voxels.resolution)
    occupied = dict(space.occupied.tiles)
    stale: dict[Key, None] = {}
    reach = int(columns[:, 1:].max(initial=0))
    for key in {**space.voxels.tiles, **voxels.tiles}:
        tile = voxels.tiles.get(key)
        if tile is space.voxels.tiles.get(key):
            continue
        old = occupied.get(key, _NO_BITS)
        new = np.zeros((TILE, TILE), np.uint32)
        if tile is not None:
            _pack(frozen_view(tile, np.int8), new)
        changes = old ^ new
        if not changes.any():
            continue
        new.flags.writeable = False
        occupied[key] = new
        stale.update(dict.fromkeys(_touched(key, changes, reach)))
    if not stale:
        return FlightSpace(voxels, space.clearance, space.occupied, space.blocked)
    blocked = dict(space.blocked.tiles)
    for key in stale:
        blocked[key] = _inflated(occupied, key, columns)
    return FlightSpace(voxels, space.clearance, BitTiles.of(occupied), BitTiles.of(blocked))


def _touched(key: Key, changes: Bits, reach: int) -> list[Key]:
    """Returns the tiles with voxels within ``reach`` of the changed ones."""
    depth = int(np.bitwise_or.reduce(changes, axis=None))
    heights = np.array([depth >> z & 1 for z in range(TILE)], np.bool_)
    sides: Any = (changes.any(axis=1), changes.any(axis=0), heights)
    steps = []
    for side in sides:
        first, last = int(np.argmax(side)), TILE - 1 - int(np.argmax(side[::-1]))
        steps.append(
            (*((-1,) if first < reach else ()), 0, *((1,) if last + reach >= TILE else ()))
        )
    a, b, c = key
    return [(a + x, b + y, c + z) for x in steps[0] for y in steps[1] for z in steps[2]]


def _inflated(occupied: Mapping[Key, Bits], key: Key, columns: NDArray[np.int64]) -> Bits:
    a, b, c = key
    around = np.empty((3, 3 * TILE, 3 * TILE), np.uint32)
    for z in range(3):
        for x in range(3):
            for y in range(3):
                block = occupied.get((a + x - 1, b + y - 1, c + z - 1), _NO_BITS)
                around[z, x * TILE : (x + 1) * TILE, y * TILE : (y + 1) * TILE] = block
    blocked = np.zeros((TILE, TILE), np.uint32)
    _inflate(around, columns, blocked)
    blocked.flags.writeable = False
    return blocked


@kernel
def _pack(tile: NDArray[np.int8], bits: Bits) -> None:
    for x in range(TILE):
        for y in range(TILE):
            word = np.uint32(0)
            for z in range(TILE):
                if tile[x, y, z] > 0:
                    word |= np.uint32(1) << np.uint32(z)
            bits[x, y] = word


@kernel
def _inflate(around: NDArray[np.uint32], columns: NDArray[np.int64], blocked: Bits) -> None:
    """Fills the blocked bits of a tile from the words of it and its neighbours."""
    half = np.uint64(32)
    for x in range(TILE):
        for y in range(TILE):
            word = np.uint64(0)
            for row in range(len(columns)):
                i, j = x + TILE + columns[row, 0], y + TILE + columns[row, 1]
                here = np.uint64(around[1, i, j])
                rising = (here << half) | np.uint64(around[0, i, j])
                falling = (np.uint64(around[2, i, j]) << half) | here
                if rising != 0:
                    word |= _smeared(rising, columns[row, 2], True) >> half
                if falling != 0:
                    word |= _smeared(falling, columns[row, 3], False)
            blocked[x, y] = np.uint32(word & np.uint64(0xFFFFFFFF))


@kernel
def _smeared(word: Any, reach: int, upward: bool) -> Any:
    """Returns the bits of a word and the ``reach`` bits above, or below, each of them."""
    left = reach
    width = 1
    while left > 0:
        step = np.uint64(min(width, left))
        word |= (word << step) if upward else (word >> step)
        left -= min(width, left)
        width *= 2
    return word


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    voxels = VoxelMap(version=1, tiles={(0, 0, 0): np.ones((TILE, TILE, TILE), np.int8)})
    update_space(FlightSpace(), voxels)
