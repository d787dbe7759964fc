"""A grid of cells without a border, kept in tiles that grids share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages.frozen import Message, read_only

TILE = 64
"""Cells along each side of a tile."""

Key = tuple[int, int]
Tiles = Mapping[Key, NDArray[Any]]
Spans = Mapping[int, tuple[slice, slice]]


@dataclass(frozen=True, eq=False)
class CellTiles(Message):
    """Cells of int8 on the plane, and the frame of them that is looked at.

    Rows and columns are counted from the world's origin and may be negative.  Tile (a, b) holds
    the cells from (64 a, 64 b) on.  What has no tile is 0, and tiles of nothing but 0 are dropped.
    A grid made from another by :meth:`updated` shares all tiles that did not change.

    Raises:
        ValueError: if a tile has another shape or type, or the frame has a negative side.
    """

    first: Key = (0, 0)
    """First row and column of the frame."""
    shape: tuple[int, int] = (1, 1)
    """Rows and columns of the frame."""
    tiles: Tiles = field(default_factory=dict)
    """(64, 64) int8 of each tile, read-only."""

    def __post_init__(self) -> None:
        if min(self.shape) < 0:
            raise ValueError(f"a frame cannot be of {self.shape} cells")
        for key, tile in self.tiles.items():
            if tile.shape != (TILE, TILE) or tile.dtype != np.int8:
                raise ValueError(f"tile {key} must be {TILE} x {TILE} of int8")
        frozen = {key: read_only(tile) for key, tile in self.tiles.items() if tile.any()}
        object.__setattr__(self, "tiles", MappingProxyType(frozen))
        # Memos of dense() and around().
        object.__setattr__(self, "_dense", None)
        object.__setattr__(self, "_around", None)

    def __reduce__(self) -> tuple[Any, ...]:
        return CellTiles, (self.first, self.shape, dict(self.tiles))

    @staticmethod
    def of(cells: NDArray[Any], first: Key = (0, 0)) -> CellTiles:
        """Returns the grid of a dense array, whose corner lies at a row and column.

        Raises:
            ValueError: if the array is not (rows, columns) of int8.
        """
        if cells.ndim != 2 or cells.dtype != np.int8:
            raise ValueError(f"cells are (rows, columns) of int8, not {cells.shape} {cells.dtype}")
        rows, columns = cells.shape
        tiles = {}
        for a, (here_i, there_i) in _spans(first[0], first[0] + rows).items():
            for b, (here_j, there_j) in _spans(first[1], first[1] + columns).items():
                if cells[there_i, there_j].any():
                    tile = np.zeros((TILE, TILE), np.int8)
                    tile[here_i, here_j] = cells[there_i, there_j]
                    tile.flags.writeable = False
                    tiles[a, b] = tile
        grid = CellTiles(first, (rows, columns), tiles)
        object.__setattr__(grid, "_dense", read_only(cells))
        return grid

    def updated(self, changed: Tiles, *, first: Key, shape: tuple[int, int]) -> CellTiles:
        """Returns a grid with some tiles replaced or new, and another frame.

        What did not change costs next to nothing.
        """
        grid = CellTiles(first, shape, changed)
        old: Any = self.tiles
        tiles = old | dict(grid.tiles)
        for key in changed.keys() - grid.tiles.keys():
            tiles.pop(key, None)
        object.__setattr__(grid, "tiles", MappingProxyType(tiles))
        return grid

    def dense(self) -> NDArray[np.int8]:
        """Returns the cells of the frame, (rows, columns) int8, read-only; made once."""
        memo: NDArray[np.int8] | None = getattr(self, "_dense", None)
        if memo is None:
            (row, column), (rows, columns) = self.first, self.shape
            memo = self.window((row, column), (row + rows, column + columns))
            memo.flags.writeable = False
            object.__setattr__(self, "_dense", memo)
        return memo

    def window(self, low: Key, high: Key) -> NDArray[np.int8]:
        """Returns a copy of the cells of rows and columns in [low, high), of the frame or not."""
        cells = np.zeros((max(high[0] - low[0], 0), max(high[1] - low[1], 0)), np.int8)
        rows, columns = (_spans(a, b) for a, b in zip(low, high, strict=True))
        if len(rows) * len(columns) > len(self.tiles):
            # A wide window on few tiles.
            keys = [key for key in self.tiles if key[0] in rows and key[1] in columns]
        else:
            keys = [(a, b) for a in rows for b in columns]
        for a, b in keys:
            tile = self.tiles.get((a, b))
            if tile is not None:
                (here_i, there_i), (here_j, there_j) = rows[a], columns[b]
                cells[there_i, there_j] = tile[here_i, here_j]
        return cells

    def around(self, low: Key, high: Key) -> tuple[NDArray[np.int8], Key]:
        """Returns whole tiles that hold the frame's cells of [low, high), and the first cell.

        The array is read-only, and the same one as at the last call while the tiles are the same:
        for readers that ask again and again about cells around a robot.
        """
        i0, i1 = _tiles_along(low[0], high[0], self.first[0], self.shape[0])
        j0, j1 = _tiles_along(low[1], high[1], self.first[1], self.shape[1])
        corner = (i0 * TILE, j0 * TILE)
        memo: tuple[Any, NDArray[np.int8]] | None = getattr(self, "_around", None)
        if memo is None or memo[0] != (i0, i1, j0, j1):
            cells = self.window(corner, (i1 * TILE, j1 * TILE))
            cells.flags.writeable = False
            memo = ((i0, i1, j0, j1), cells)
            object.__setattr__(self, "_around", memo)
        return memo[1], corner


def _spans(low: int, high: int) -> Spans:
    """Returns the tiles along an axis that hold [low, high): where in the tile, where in it."""
    spans = {}
    for index in range(low // TILE, -(-high // TILE)) if low < high else ():
        first = index * TILE
        a, b = max(first, low), min(first + TILE, high)
        spans[index] = slice(a - first, b - first), slice(a - low, b - low)
    return spans


def _tiles_along(low: int, high: int, first: int, size: int) -> tuple[int, int]:
    """Returns the tiles along one axis that hold cells of [low, high) in the frame."""
    low, high = max(low, first), min(high, first + size)
    return (low // TILE, -(-high // TILE)) if low < high else (0, 0)
