"""Kernels of the occupancy map: what one depth image says about the cells around it.

The image is reduced to bearings (narrow vertical slices of space around the camera).  Each one
knows its nearest obstacle, how far the floor or something beyond was seen, and from where on
the floor was in view.  Then each cell in view looks up the bearing of its centre, so no cell is
missed or visited twice, however near or far it is.

A row of the image is judged at once, in loops without branches that the compiler vectorizes; only
the few numbers that come out of it are entered one by one.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, inlined_kernel, kernel
from unilavira_drake.messages.cell_tiles import TILE

FREE_STEP = 4
"""What a cell seen free loses of its log-odds, tenths, unless a map's parameters say otherwise."""
HIT_STEP = 9
"""Change of log-odds of a cell seen occupied, tenths."""
LIMIT = 40
"""Log-odds stay within +-LIMIT, so a thing that moved away is forgotten after at most ten looks."""
MIN_HITS = 2
"""Depth readings in a cell that make it occupied: one alone may be noise."""
FLOOR_TOLERANCE = 0.15
"""Readings this far below the floor still are the floor; lower ones show a drop, metres."""
HIT_DEPTH = 0.2
"""Hits are pushed this share of a cell along their ray: a surface on the border of two cells
belongs to the cell behind it, from either side and in a mirrored world."""

_NOTHING, _BEYOND, _FLOOR, _OBSTACLE = 0, 1, 2, 3


@kernel
def scan(
    depth: NDArray[np.float32],
    columns: NDArray[np.int32],
    stride: int,
    camera: NDArray[np.float64],
    rays: NDArray[np.float64],
    band: NDArray[np.float64],
    grid: NDArray[np.float64],
    hits: NDArray[np.uint32],
    struck: NDArray[np.int64],
    bearings: NDArray[np.float64],
) -> int:
    """Counts hits per cell and fills the bearings from one depth image.

    Args:
        depth: (H, W) float32, metres along the camera's z; 0, NaN and negative are no reading.
        columns: image columns to read.
        stride: every so many rows are read.
        camera: fx, fy, cx, cy, x, y, z of the camera (pixels, metres).
        rays: (3, 3): change of (forward, right, up) per unit of (x, y, z) of the camera frame.
        band: lowest and highest obstacle and the camera above the floor, range, and from where on
            readings are none (NaN: nowhere), metres.
        grid: forward_x, forward_y, resolution, first row and first column of the window.
        hits: (rows, columns) uint32 of the window, counted up.
        struck: as long as the window has cells; gets the index of each occupied one.
        bearings: (3, K): nearest obstacle, farthest sight, nearest floor, as forward distance.

    Returns:
        The number of occupied cells.
    """
    size, count = columns.size, 0
    beams, line = np.empty(size), np.empty(size, np.float32)
    kinds = np.empty(size, np.int64)
    aheads, slots, rows, places = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    per_x, per_y = 1.0 / camera[0], 1.0 / camera[1]
    for k in range(size):
        beams[k] = (columns[k] - camera[2]) * per_x
    for v in range(stride // 2, depth.shape[0], stride):
        for k in range(size):
            line[k] = depth[v, columns[k]]
        y = (v - camera[3]) * per_y
        _judge(line, beams, y, stride, camera, rays, band, grid, kinds, aheads, slots, rows, places)
        count = _enter(kinds, aheads, slots, rows, places, hits, struck, count, bearings)
    return count


@inlined_kernel
def _judge(
    line: NDArray[np.float32],
    beams: NDArray[np.float64],
    y: float,
    stride: int,
    camera: NDArray[np.float64],
    rays: NDArray[np.float64],
    band: NDArray[np.float64],
    grid: NDArray[np.float64],
    kinds: NDArray[np.int64],
    aheads: NDArray[np.float64],
    slots: NDArray[np.float64],
    rows: NDArray[np.float64],
    places: NDArray[np.float64],
) -> None:
    """Says of each reading of a row what it is, how far ahead, at which bearing and in which cell.

    Bearings, rows and columns of cells stay floats: they may be any number, or none.
    """
    low, high, height, reach, saturation = band[0], band[1], band[2], band[3], band[4]
    forward_x, forward_y, cells = grid[0], grid[1], 1.0 / grid[2]
    row_0, column_0, push = grid[3], grid[4], HIT_DEPTH * grid[2]
    x_camera, y_camera = camera[4], camera[5]
    per_bearing, first = camera[0] / stride, (camera[2] + 0.5) / stride
    forward_1, right_1, up_1 = rays[0, 0], rays[1, 0], rays[2, 0]
    forward_0 = rays[0, 1] * y + rays[0, 2]
    right_0 = rays[1, 1] * y + rays[1, 2]
    up_0 = rays[2, 1] * y + rays[2, 2]
    for k in range(line.size):
        reading, x = np.float64(line[k]), beams[k]
        forward, right, up = forward_1 * x + forward_0, right_1 * x + right_0, up_1 * x + up_0
        valid = (reading > 0.0) & (forward > 0.0) & (not (reading >= saturation))
        sideways = forward * forward + right * right
        # Nothing up to the range: it tells something where the ray stays in the band.
        beyond = reading * reading * sideways > reach * reach
        d = reach / math.sqrt(sideways) if beyond else reading
        h = height + d * up
        # No floor where the ray passes its level: a drop, to be kept away from.
        drop = h < -FLOOR_TOLERANCE
        valid &= not (drop & ((height <= 0.0) | (reading == np.inf)))
        d = d * height / (height - h) if drop else d
        h = low if drop else h
        beyond &= not drop
        kind = _BEYOND if beyond else (_OBSTACLE if h >= low else _FLOOR)
        kinds[k] = kind if valid & (h <= high) else _NOTHING
        ahead, slope = d * forward, right / forward
        aheads[k] = ahead
        slots[k] = np.floor(slope * per_bearing + first)
        ahead += push
        y_hit = y_camera + ahead * (forward_y - slope * forward_x)
        x_hit = x_camera + ahead * (forward_x + slope * forward_y)
        rows[k] = np.floor(y_hit * cells) - row_0
        places[k] = np.floor(x_hit * cells) - column_0


@inlined_kernel
def _enter(
    kinds: NDArray[np.int64],
    aheads: NDArray[np.float64],
    slots: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    hits: NDArray[np.uint32],
    struck: NDArray[np.int64],
    count: int,
    bearings: NDArray[np.float64],
) -> int:
    """Enters the readings of a row, and returns how many cells are occupied by now."""
    for k in range(kinds.size):
        kind, ahead = kinds[k], aheads[k]
        if kind == _NOTHING:
            continue
        if 0.0 <= slots[k] < bearings.shape[1]:
            bearing = np.uint64(slots[k])
            bearings[1, bearing] = max(bearings[1, bearing], ahead)
            if kind == _OBSTACLE:
                bearings[0, bearing] = min(bearings[0, bearing], ahead)
            elif kind == _FLOOR:
                bearings[2, bearing] = min(bearings[2, bearing], ahead)
        if kind == _OBSTACLE and 0.0 <= rows[k] < hits.shape[0]:
            if 0.0 <= columns[k] < hits.shape[1]:
                i, j = np.uint64(rows[k]), np.uint64(columns[k])
                hits[i, j] += np.uint32(1)
                if hits[i, j] == MIN_HITS:
                    struck[count] = np.int64(i) * hits.shape[1] + np.int64(j)
                    count += 1
    return count


@kernel
def carve(
    log_odds: NDArray[np.int8],
    touched: NDArray[np.bool_],
    corner: NDArray[np.int64],
    stride: int,
    camera: NDArray[np.float64],
    reach: float,
    free_step: int,
    newest: int,
    grid: NDArray[np.float64],
    hits: NDArray[np.uint32],
    struck: NDArray[np.int64],
    bearings: NDArray[np.float64],
) -> None:
    """Changes the log-odds of the cells in view; arguments as for :func:`scan`.

    ``corner`` is the window's first row and column in ``log_odds``, which consists of whole tiles;
    ``touched`` tells which of them changed.  A cell seen free loses ``free_step``.  Nearer than the
    first floor in view the camera looks over low things: there, free only replaces unknown.

    With ``newest`` above 0, what appears where the floor was free is believed at once, with
    log-odds 1 less: it may go again, and is forgotten where the camera looks over it, too.
    """
    forward_x, forward_y, resolution = grid[0], grid[1], grid[2]
    per_bearing, first = camera[0] / stride, (camera[2] + 0.5) / stride
    near, far, floor = bearings[0], bearings[1], bearings[2]
    left, right = -first / per_bearing, (near.size - first) / per_bearing
    columns = float(hits.shape[1])
    _strike(log_odds, touched, corner, hits.shape[1], struck, newest)
    for i in range(hits.shape[0]):
        dy = (grid[3] + i + 0.5) * resolution - camera[5]
        low, high = _in_view(dy, reach, forward_x, forward_y, left, right)
        if not low <= high + resolution:
            continue
        # A column more on each side: each cell is tested below.
        begin = np.floor((low + camera[4]) / resolution - grid[4]) - 1.0
        end = np.floor((high + camera[4]) / resolution - grid[4]) + 2.0
        begin, end = min(max(begin, 0.0), columns), min(max(end, 0.0), columns)
        for j in range(int(begin), int(end)):
            dx = (grid[4] + j + 0.5) * resolution - camera[4]
            ahead = dx * forward_x + dy * forward_y
            if ahead <= 0.0 or dx * dx + dy * dy > reach * reach or hits[i, j] >= MIN_HITS:
                continue
            slot = np.floor((dx * forward_y - dy * forward_x) / ahead * per_bearing + first)
            if not 0.0 <= slot < near.size:
                continue
            bearing = np.uint64(slot)
            if ahead > far[bearing] or ahead > near[bearing] - resolution:
                continue
            row, column = corner[0] + i, corner[1] + j
            old: Any = np.int64(log_odds[row, column])
            # Nothing changes where it is free beyond doubt.
            if old == -LIMIT:
                continue
            if ahead < floor[bearing] and old != 0 and not 0 < old <= newest:
                continue
            new = max(old - free_step, -LIMIT)
            log_odds[row, column] = new if new != 0 else -1
            touched[row // TILE, column // TILE] = True


@inlined_kernel
def _strike(
    log_odds: NDArray[np.int8],
    touched: NDArray[np.bool_],
    corner: NDArray[np.int64],
    columns: int,
    struck: NDArray[np.int64],
    newest: int,
) -> None:
    """Raises the log-odds of the occupied cells; ``columns`` is those of the window."""
    for place in struck:
        row, column = corner[0] + place // columns, corner[1] + place % columns
        old: Any = np.int64(log_odds[row, column])
        if newest > 0 and old != 0 and old <= newest:
            log_odds[row, column] = max(newest - 1, 1)
            touched[row // TILE, column // TILE] = True
        elif old != LIMIT:
            new = min(old + HIT_STEP, LIMIT)
            log_odds[row, column] = new if new != 0 else 1
            touched[row // TILE, column // TILE] = True


@inlined_kernel
def _in_view(
    dy: float, reach: float, forward_x: float, forward_y: float, left: float, right: float
) -> tuple[float, float]:
    """Returns between which dx a row is in range and in view; the second is less where it is not.

    ``left`` and ``right`` are the slopes of the first bearing and behind the last one.
    """
    half = math.sqrt(max(reach * reach - dy * dy, 0.0))
    low, high = -half, half
    # In front of the camera, right of the first bearing and left of the last one: all a dx >= b.
    for side in range(3):
        if side == 0:
            a, b = forward_x, -dy * forward_y
        elif side == 1:
            a, b = forward_y - left * forward_x, dy * (forward_x + left * forward_y)
        else:
            a, b = right * forward_x - forward_y, -dy * (forward_x + right * forward_y)
        if a > 1e-9:
            low = max(low, b / a)
        elif a < -1e-9:
            high = min(high, b / a)
    return low, high


@kernel
def stand(
    log_odds: NDArray[np.int8],
    touched: NDArray[np.bool_],
    first_row: int,
    first_column: int,
    position: tuple[float, float],
    radius: float,
    resolution: float,
) -> None:
    """Frees the unknown cells around a robot; ``log_odds`` consists of whole tiles."""
    for i in range(log_odds.shape[0]):
        dy = (first_row + i + 0.5) * resolution - position[1]
        if dy * dy > radius * radius:
            continue
        for j in range(log_odds.shape[1]):
            dx = (first_column + j + 0.5) * resolution - position[0]
            if log_odds[i, j] == 0 and dx * dx + dy * dy <= radius * radius:
                log_odds[i, j] = -FREE_STEP
                touched[i // TILE, j // TILE] = True


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
    camera, grid, band = np.zeros(7), np.ones(5), np.ones(5)
    hits, bearings = np.zeros((1, 1), np.uint32), np.zeros((3, 1))
    depth, struck = frozen_view(np.zeros((1, 1)), np.float32), np.zeros(1, np.int64)
    columns = symmetric_columns(1, 1)
    count = scan(depth, columns, 1, camera, np.eye(3), band, grid, hits, struck, bearings)
    tile, touched = np.zeros((TILE, TILE), np.int8), np.zeros((1, 1), np.bool_)
    corner = np.zeros(2, np.int64)
    carve(tile, touched, corner, 1, camera, 1.0, FREE_STEP, 0, grid, hits, struck[:count], bearings)
    stand(tile, touched, 0, 0, (0.0, 0.0), 1.0, 1.0)
