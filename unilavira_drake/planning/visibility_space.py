"""Where an aircraft may fly: the voxel map, inflated, as bits.

A voxel is blocked when some point of an occupied voxel may be nearer than the radius to some
point of it; so whatever stays within voxels that are not blocked keeps the radius.  Below and
above, margins may ask for more.  Unknown voxels are free until something is seen in them.  Each
tile is kept as one bit a voxel; a new map only costs the columns near to voxels that became
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

Area = tuple[int, int, int, int]
"""Columns of a tile: lowest x and y, and one beyond the highest."""

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

        Those that are to be free equally far follow one another.

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
        return np.array(sorted(rows, key=lambda row: row[2:]), np.int64)


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
    stale: dict[Key, list[Area]] = {}
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
        for touched, area in _touched(key, changes, reach):
            stale.setdefault(touched, []).append(area)
    if not stale:
        return FlightSpace(voxels, space.clearance, space.occupied, space.blocked)
    solid = BitTiles.of(occupied)
    blocked = dict(space.blocked.tiles)
    for key, areas in stale.items():
        low_x, low_y, high_x, high_y = zip(*areas, strict=True)
        area = (min(low_x), min(low_y), max(high_x), max(high_y))
        bits = np.array(blocked.get(key, _NO_BITS))
        _inflate(solid.pool, solid.directory, solid.first, key, columns, area, bits)
        bits.flags.writeable = False
        blocked[key] = bits
    return FlightSpace(voxels, space.clearance, solid, BitTiles.of(blocked))


def _touched(key: Key, changes: Bits, reach: int) -> list[tuple[Key, Area]]:
    """Returns the tiles with voxels within ``reach`` of the changed ones, and their columns."""
    depth = int(np.bitwise_or.reduce(changes, axis=None))
    lowest, highest = (depth & -depth).bit_length() - 1, depth.bit_length() - 1
    heights = [0]
    if lowest < reach:
        heights.append(-1)
    if highest + reach >= TILE:
        heights.append(1)
    x, y = (_spread(np.flatnonzero(changes.any(axis=axis)), reach) for axis in (1, 0))
    a, b, c = key
    return [
        ((a + i, b + j, c + k), (x0, y0, x1, y1))
        for i, x0, x1 in x
        for j, y0, y1 in y
        for k in heights
    ]


def _spread(changed: NDArray[np.intp], reach: int) -> list[tuple[int, int, int]]:
    """Returns the tiles on one axis that changed lines reach, each with its lines [low, high)."""
    low, high = int(changed[0]) - reach, int(changed[-1]) + reach + 1
    return [
        (i, max(low - TILE * i, 0), min(high - TILE * i, TILE))
        for i in range(low // TILE, (high - 1) // TILE + 1)
    ]


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
def _inflate(
    pool: NDArray[np.uint32],
    directory: NDArray[np.int32],
    first: Key,
    key: Key,
    columns: NDArray[np.int64],
    area: Area,
    blocked: Bits,
) -> None:
    """Fills the blocked bits of some columns of a tile from the words of it and its neighbours."""
    around = _around(pool, directory, first, key)
    half = np.uint64(32)
    for x in range(area[0], area[2]):
        for y in range(area[1], area[3]):
            word = np.uint64(0)
            under, here, over = np.uint64(0), np.uint64(0), np.uint64(0)
            for row in range(len(columns)):
                words = around[x + TILE + columns[row, 0], y + TILE + columns[row, 1]]
                under |= np.uint64(words[0])
                here |= np.uint64(words[1])
                over |= np.uint64(words[2])
                down, up = columns[row, 2], columns[row, 3]
                if row + 1 < len(columns) and columns[row + 1, 2] == down:
                    if columns[row + 1, 3] == up:
                        continue
                # What is to be free equally far is smeared at once.
                if under | here:
                    word |= _smeared((here << half) | under, down, True) >> half
                if here | over:
                    word |= _smeared((over << half) | here, up, False)
                under, here, over = np.uint64(0), np.uint64(0), np.uint64(0)
            blocked[x, y] = np.uint32(word & np.uint64(0xFFFFFFFF))


@kernel
def _around(
    pool: NDArray[np.uint32], directory: NDArray[np.int32], first: Key, key: Key
) -> NDArray[np.uint32]:
    """Returns the words of a tile and its neighbours; (96, 96, 3)."""
    around = np.zeros((3 * TILE, 3 * TILE, 3), np.uint32)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                a, b, c = key[0] + i - 1, key[1] + j - 1, key[2] + k - 1
                a, b, c = a - first[0], b - first[1], c - first[2]
                known = 0 <= a < directory.shape[0] and 0 <= b < directory.shape[1]
                if not known or c < 0 or c >= directory.shape[2] or directory[a, b, c] == 0:
                    continue
                tile = pool[directory[a, b, c]]
                for x in range(TILE):
                    for y in range(TILE):
                        around[TILE * i + x, TILE * j + y, k] = tile[x, y]
    return around


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
