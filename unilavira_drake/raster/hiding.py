"""Which boxes lie wholly behind what is drawn already: exact, for it asks too little, never more.

Greene's hierarchical depth buffer (SIGGRAPH 1993) with one coarse level.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel

TILE = 16
"""Pixels a side of a tile of the coarse depth."""

_MARGIN = 1e-3


def farthest(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the greatest depth in each tile of an image, (ceil(H / 16), ceil(W / 16))."""
    return _farthest(frozen_view(depth, np.float32))


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
    return _hidden(
        frozen_view(tiles, np.float32),
        float(size[0]),
        float(size[1]),
        frozen_view(clip_from_world[[0, 1, 3]], np.float64),
        frozen_view(middles, np.float64),
        frozen_view(axes, np.float64),
    )


def warm_up() -> None:
    """Compiles the kernels."""
    tiles = farthest(np.zeros((1, 1), np.float32))
    hidden(tiles, (1, 1), np.eye(4), np.zeros((1, 3)), np.zeros((1, 3, 3)))


@kernel
def _farthest(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    height, width = depth.shape
    tiles = np.zeros((-(-height // TILE), -(-width // TILE)), np.float32)
    for v in range(height):
        row = tiles[v // TILE]
        for u in range(width):
            if depth[v, u] > row[u // TILE]:
                row[u // TILE] = depth[v, u]
    return tiles


@kernel
def _hidden(
    tiles: NDArray[np.float32],
    width: float,
    height: float,
    rows: NDArray[np.float64],
    middles: NDArray[np.float64],
    axes: NDArray[np.float64],
) -> NDArray[np.bool_]:
    result = np.zeros(len(middles), np.bool_)
    edges, middle = np.empty((3, 3)), np.empty(3)
    for n in range(len(middles)):
        for i in range(3):
            for j in range(3):
                edges[i, j] = (
                    rows[i, 0] * axes[n, 0, j]
                    + rows[i, 1] * axes[n, 1, j]
                    + rows[i, 2] * axes[n, 2, j]
                )
            middle[i] = (
                rows[i, 0] * middles[n, 0]
                + rows[i, 1] * middles[n, 1]
                + rows[i, 2] * middles[n, 2]
                + rows[i, 3]
            )
        nearest = middle[2] - abs(edges[2, 0]) - abs(edges[2, 1]) - abs(edges[2, 2])
        if nearest <= _MARGIN:
            continue
        u_min, v_min, u_max, v_max = np.inf, np.inf, -np.inf, -np.inf
        for corner in range(8):
            a, b, c = 2 * (corner & 1) - 1, (corner & 2) - 1, (corner & 4) / 2 - 1
            depth = middle[2] + a * edges[2, 0] + b * edges[2, 1] + c * edges[2, 2]
            x = (middle[0] + a * edges[0, 0] + b * edges[0, 1] + c * edges[0, 2]) / depth
            y = (middle[1] + a * edges[1, 0] + b * edges[1, 1] + c * edges[1, 2]) / depth
            u_min, u_max = min(u_min, x), max(u_max, x)
            v_min, v_max = min(v_min, y), max(v_max, y)
        result[n] = _covered(
            tiles,
            nearest - _MARGIN,
            (u_min + 1.0) * width / 2.0,
            (v_min + 1.0) * height / 2.0,
            (u_max + 1.0) * width / 2.0,
            (v_max + 1.0) * height / 2.0,
        )
    return result


@kernel
def _covered(
    tiles: NDArray[np.float32],
    nearest: float,
    u_min: float,
    v_min: float,
    u_max: float,
    v_max: float,
) -> bool:
    """Whether all tiles of a rectangle, a pixel larger on each side, are nearer than a depth."""
    rows, columns = tiles.shape
    # Clipped before they become whole numbers: a corner just ahead of the camera is far outside.
    first_row = int(min(max((v_min - 1.0) / TILE, 0.0), rows))
    first_column = int(min(max((u_min - 1.0) / TILE, 0.0), columns))
    last_row = int(np.floor(min(max((v_max + 1.0) / TILE, -1.0), rows - 1.0)))
    last_column = int(np.floor(min(max((u_max + 1.0) / TILE, -1.0), columns - 1.0)))
    for i in range(first_row, last_row + 1):
        for j in range(first_column, last_column + 1):
            if tiles[i, j] >= nearest:
                return False
    return True
