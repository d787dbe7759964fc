"""Kernels of the occupancy map: what one depth image says about the cells around it.

The image is reduced to bearings (narrow vertical slices of space around the camera).  Each one
knows its nearest obstacle, how far the floor or something beyond was seen, and from where on
the floor was in view.  Then each cell of the window looks up the bearing of its centre, so no
cell is missed or visited twice, however near or far it is.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, inlined_kernel, kernel

FREE_STEP = -4
"""Change of log-odds of a cell seen free, tenths."""
HIT_STEP = 9
"""Change of log-odds of a cell seen occupied, tenths."""
LIMIT = 40
"""Log-odds stay within +-LIMIT, so a thing that moved away is forgotten after ten looks."""
MIN_HITS = 2
"""Depth readings in a cell that make it occupied: one alone may be noise."""
FLOOR_TOLERANCE = 0.15
"""Readings this far below the floor still are the floor; lower ones show a drop, metres."""
HIT_DEPTH = 0.2
"""Hits are pushed this share of a cell along their ray: a surface on the border of two cells
belongs to the cell behind it, from either side and in a mirrored world."""


@kernel
def scan(
    depth: NDArray[np.float32],
    columns: NDArray[np.int32],
    stride: int,
    camera: NDArray[np.float64],
    rays: NDArray[np.float64],
    band: NDArray[np.float64],
    grid: NDArray[np.float64],
    hits: NDArray[np.uint16],
    bearings: NDArray[np.float64],
) -> None:
    """Counts hits per cell and fills the bearings from one depth image.

    Args:
        depth: (H, W) float32, metres along the camera's z; 0, NaN and negative are no reading.
        columns: image columns to read.
        stride: every so many rows are read.
        camera: fx, fy, cx, cy, x, y, z of the camera (pixels, metres).
        rays: (3, 3): change of (forward, right, up) per unit of (x, y, z) of the camera frame.
        band: lowest and highest obstacle and the camera above the floor, range, metres.
        grid: forward_x, forward_y, resolution, first row and first column of the window.
        hits: (rows, columns) uint16 of the window, counted up.
        bearings: (3, K): nearest obstacle, farthest sight, nearest floor, as forward distance.
    """
    cx, cy, x_camera, y_camera = camera[2], camera[3], camera[4], camera[5]
    low, high, height, reach = band[0], band[1], band[2], band[3]
    forward_x, forward_y, cells = grid[0], grid[1], 1.0 / grid[2]
    row0, column0 = int(grid[3]), int(grid[4])
    per_bearing, first = camera[0] / stride, (cx + 0.5) / stride
    per_x, per_y = 1.0 / camera[0], 1.0 / camera[1]
    for v in range(stride // 2, depth.shape[0], stride):
        y = (v - cy) * per_y
        forward_row = rays[0, 1] * y + rays[0, 2]
        right_row = rays[1, 1] * y + rays[1, 2]
        up_row = rays[2, 1] * y + rays[2, 2]
        for u in columns:
            reading = np.float64(depth[v, u])
            x = (u - cx) * per_x
            forward = rays[0, 0] * x + forward_row
            if not (reading > 0.0 and forward > 0.0):
                continue
            right = rays[1, 0] * x + right_row
            up = rays[2, 0] * x + up_row
            sideways = forward * forward + right * right
            d = reading
            beyond = d * d * sideways > reach * reach
            if beyond:
                # Nothing up to the range: it tells something where the ray stays in the band.
                d = reach / math.sqrt(sideways)
            h = height + d * up
            if h < -FLOOR_TOLERANCE:
                if height <= 0.0 or reading == np.inf:
                    continue
                # No floor where the ray passes its level: a drop, to be kept away from.
                d, h, beyond = d * height / (height - h), low, False
            if h > high:
                continue
            ahead = d * forward
            slope = right / forward
            bearing = math.floor(slope * per_bearing + first)
            _note(bearings, bearing, ahead, h >= low, beyond)
            if h < low or beyond:
                continue
            ahead += HIT_DEPTH * grid[2]
            y_hit = y_camera + ahead * (forward_y - slope * forward_x)
            x_hit = x_camera + ahead * (forward_x + slope * forward_y)
            row = math.floor(y_hit * cells) - row0
            column = math.floor(x_hit * cells) - column0
            _count(hits, row, column)


@inlined_kernel
def _note(
    bearings: NDArray[np.float64], bearing: int, ahead: float, obstacle: bool, beyond: bool
) -> None:
    if bearing < 0 or bearing >= bearings.shape[1]:
        return
    bearings[1, bearing] = max(bearings[1, bearing], ahead)
    if not beyond:
        nearest = 0 if obstacle else 2
        bearings[nearest, bearing] = min(bearings[nearest, bearing], ahead)


@inlined_kernel
def _count(hits: NDArray[np.uint16], row: int, column: int) -> None:
    inside = 0 <= row < hits.shape[0] and 0 <= column < hits.shape[1]
    if inside and hits[row, column] < 65535:
        hits[row, column] += 1


@kernel
def apply(
    log_odds: NDArray[np.int8],
    corner: NDArray[np.int64],
    stride: int,
    camera: NDArray[np.float64],
    reach: float,
    grid: NDArray[np.float64],
    hits: NDArray[np.uint16],
    bearings: NDArray[np.float64],
) -> None:
    """Changes the log-odds of the window's cells; arguments as for :func:`scan`.

    ``corner`` is the window's first row and column in ``log_odds``.  Nearer than the first floor
    in view the camera looks over low things: there, free only replaces unknown.
    """
    forward_x, forward_y, resolution = grid[0], grid[1], grid[2]
    per_bearing = camera[0] / stride
    first = (camera[2] + 0.5) / stride
    near, far, floor = bearings[0], bearings[1], bearings[2]
    for i in range(hits.shape[0]):
        dy = (grid[3] + i + 0.5) * resolution - camera[5]
        for j in range(hits.shape[1]):
            old: Any = np.int64(log_odds[corner[0] + i, corner[1] + j])
            if hits[i, j] >= MIN_HITS:
                new = min(old + HIT_STEP, LIMIT)
                log_odds[corner[0] + i, corner[1] + j] = new if new != 0 else 1
                continue
            dx = (grid[4] + j + 0.5) * resolution - camera[4]
            ahead = dx * forward_x + dy * forward_y
            if ahead <= 0.0 or dx * dx + dy * dy > reach * reach:
                continue
            right = dx * forward_y - dy * forward_x
            bearing = math.floor(right / ahead * per_bearing + first)
            if bearing < 0 or bearing >= near.size:
                continue
            if ahead > far[bearing] or ahead > near[bearing] - resolution:
                continue
            if ahead < floor[bearing] and old != 0:
                continue
            new = max(old + FREE_STEP, -LIMIT)
            log_odds[corner[0] + i, corner[1] + j] = new if new != 0 else -1


@functools.lru_cache(16)
def symmetric_columns(width: int, stride: int) -> NDArray[np.int32]:
    """Returns every ``stride``-th column, counted from both edges towards the middle; read-only.

    So a mirrored image is read at the mirrored pixels.
    """
    left = np.arange(0, (width + 1) // 2, stride)
    columns = np.unique(np.concatenate((left, width - 1 - left))).astype(np.int32)
    return frozen_view(columns, np.int32)


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    camera, grid, band = np.zeros(7), np.ones(5), np.ones(4)
    hits, bearings = np.zeros((1, 1), np.uint16), np.zeros((3, 1))
    depth = frozen_view(np.zeros((1, 1)), np.float32)
    scan(depth, symmetric_columns(1, 1), 1, camera, np.eye(3), band, grid, hits, bearings)
    apply(np.zeros((1, 1), np.int8), np.zeros(2, np.int64), 1, camera, 1.0, grid, hits, bearings)
