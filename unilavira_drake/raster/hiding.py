"""Which boxes lie wholly behind what is drawn already: exact, for it asks too little, never more.

Greene's hierarchical depth buffer (SIGGRAPH 1993) with one coarse level.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TILE = 16
"""Pixels a side of a tile of the coarse depth."""

_MARGIN = 1e-3
_SIGNS = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], float)


def farthest(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the greatest depth in each tile of an image, (ceil(H / 16), ceil(W / 16))."""
    rows, columns = -(-depth.shape[0] // TILE), -(-depth.shape[1] // TILE)
    missing = rows * TILE - depth.shape[0], columns * TILE - depth.shape[1]
    if any(missing):
        depth = np.pad(depth, ((0, missing[0]), (0, missing[1])))
    by_row = depth.reshape(rows, TILE, -1).max(axis=1)
    tiles: NDArray[np.float32] = by_row.reshape(rows, columns, TILE).max(axis=2)
    return tiles


def hidden(
    tiles: NDArray[np.float32],
    size: tuple[int, int],
    clip_from_world: NDArray[np.float64],
    middles: NDArray[np.float64],
    axes: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Returns which boxes are behind the drawn depth in every tile that they touch.

    Args:
        tiles: of ``farthest``.
        size: width and height of the image, pixels.
        clip_from_world: (4, 4); its fourth coordinate is metric depth.
        middles: (n, 3) of the boxes.
        axes: (n, 3, 3); the columns are the half edges as vectors.
    """
    rows = clip_from_world[[0, 1, 3]]
    middle = middles @ rows[:, :3].T + rows[:, 3]
    # One plain product for all boxes is much faster than a small one for each.
    edges = (axes.transpose(0, 2, 1).reshape(-1, 3) @ rows[:, :3].T).reshape(-1, 3, 3)
    corners = edges.transpose(0, 2, 1).reshape(-1, 3) @ _SIGNS.T
    clip = corners.reshape(-1, 3, 8) + middle[:, :, None]
    depth = clip[:, 2]
    nearest = depth.min(axis=1)
    ahead = nearest > _MARGIN
    ahead_or_one = np.where(depth > _MARGIN, depth, 1.0)
    pixels = (clip[:, :2] / ahead_or_one[:, None, :] + 1.0) * (np.array(size)[:, None] / 2.0)
    # A pixel more on each side, against rounding.
    low = np.floor((pixels.min(axis=2) - 1.0) / TILE)
    high = np.floor((pixels.max(axis=2) + 1.0) / TILE)
    column, row = np.arange(tiles.shape[1]), np.arange(tiles.shape[0])
    across = (column >= low[:, :1]) & (column <= high[:, :1])
    down = (row >= low[:, 1:]) & (row <= high[:, 1:])
    behind = tiles < (nearest - _MARGIN)[:, None, None]
    touched = down[:, :, None] & across[:, None, :]
    result: NDArray[np.bool_] = ahead & ~(touched & ~behind).any(axis=(1, 2))
    return result
