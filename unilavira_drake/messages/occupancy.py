"""The occupancy map of a floor: unknown, free and occupied cells, in tiles that maps share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages.cell_tiles import CellTiles, Key
from unilavira_drake.messages.frozen import Message


@dataclass(frozen=True, eq=False, init=False)
class OccupancyMap(Message):
    """Log-odds of occupancy on a horizontal grid.

    Cell (row i, column j) covers x in [x0 + j r, x0 + (j + 1) r) and y in
    [y0 + i r, y0 + (i + 1) r).  0 is unknown, negative free, positive occupied.  The cells lie in
    tiles; a map made from another shares all tiles that did not change.

    Args:
        n: number of the latest panorama that is part of this map.
        version: counts the changes.
        time: of the latest change, seconds.
        resolution: side of a cell, metres.
        origin: world (x0, y0) of the corner of cell (0, 0), metres; multiples of the resolution.
        log_odds: (rows, columns) int8; one unknown cell by default.
        cells: the same as tiles, instead of ``log_odds``.
        rejected: why views of the latest integration were left out, one reason each.

    Raises:
        ValueError: if the resolution makes no sense, or ``log_odds`` is no grid of int8.
    """

    n: int
    version: int
    time: float
    resolution: float
    origin: tuple[float, float]
    cells: CellTiles
    """Counted from the world's origin; their frame is the grid."""
    rejected: tuple[str, ...]

    def __init__(
        self,
        n: int = 0,
        version: int = 0,
        time: float = 0.0,
        resolution: float = 0.05,
        origin: tuple[float, float] = (0.0, 0.0),
        log_odds: NDArray[np.int8] | None = None,
        *,
        cells: CellTiles | None = None,
        rejected: tuple[str, ...] = (),
    ) -> None:
        if not 0.0 < resolution < math.inf:
            raise ValueError(f"the resolution must be positive, not {resolution}")
        if cells is None:
            first = (round(origin[1] / resolution), round(origin[0] / resolution))
            unknown = np.zeros((1, 1), np.int8)
            cells = CellTiles.of(unknown if log_odds is None else log_odds, first)
        values: dict[str, Any] = {
            "n": n,
            "version": version,
            "time": time,
            "resolution": resolution,
            "origin": origin,
            "cells": cells,
            "rejected": rejected,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def log_odds(self) -> NDArray[np.int8]:
        """All cells of the grid, (rows, columns) int8, read-only; put together when asked for."""
        return self.cells.dense()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.cells.shape

    def cell(self, x: float, y: float) -> Key:
        """Returns (row, column) of a world point; it may lie outside the grid."""
        return (
            math.floor((y - self.origin[1]) / self.resolution),
            math.floor((x - self.origin[0]) / self.resolution),
        )

    def center(self, row: int, column: int) -> tuple[float, float]:
        """Returns the world (x, y) of a cell's centre, metres."""
        return (
            self.origin[0] + (column + 0.5) * self.resolution,
            self.origin[1] + (row + 0.5) * self.resolution,
        )

    def state_at(self, x: float, y: float) -> str:
        """Returns ``unknown``, ``free`` or ``occupied`` of a world point, metres."""
        row, column = self.cell(x, y)
        value = int(self.window((row, column), (row + 1, column + 1))[0, 0])
        return "unknown" if value == 0 else "free" if value < 0 else "occupied"

    def window(self, low: Key, high: Key) -> NDArray[np.int8]:
        """Returns a copy of the log-odds of rows and columns in [low, high), of the grid or not."""
        i, j = self.cells.first
        return self.cells.window((low[0] + i, low[1] + j), (high[0] + i, high[1] + j))

    def around(self, x: float, y: float, reach: float) -> tuple[NDArray[np.int8], Key]:
        """Returns cells of the grid that hold all within ``reach`` of a point, and the first one.

        The array, (rows, columns) int8, is read-only and stays the same while point and map
        hardly change; its first cell counts as the grid's do.  Cells of the grid that are not in
        it are farther.

        Args:
            x: of the point, metres.
            y: of the point, metres.
            reach: metres along each axis.
        """
        i, j = self.cells.first
        # One cell more: a reader may round otherwise.
        low, high = self.cell(x - reach, y - reach), self.cell(x + reach, y + reach)
        cells, (row, column) = self.cells.around(
            (low[0] + i - 1, low[1] + j - 1), (high[0] + i + 2, high[1] + j + 2)
        )
        return cells, (row - i, column - j)
