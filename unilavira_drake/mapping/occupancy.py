"""The occupancy map: depth images in, a new frozen map out.

Log-odds of occupancy on a grid of the floor (Moravec and Elfes' occupancy grid), in tenths, as
int8.  A height band above the floor is projected onto the grid; free space is carved along each
bearing up to the first obstacle, and only as far as the floor, or something beyond, was seen.
"""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view
from unilavira_drake.mapping.depth_scan import FREE_STEP, apply, scan, symmetric_columns
from unilavira_drake.messages import Frame, Intrinsics, Message, OccupancyMap

BLOCK = 64
"""The grid grows by whole blocks of so many cells."""

MIN_LEVEL = 0.2
"""A camera whose axis has less than this horizontal share looks at the floor or the ceiling: it
has no bearings, and is not integrated."""


@dc.dataclass(frozen=True)
class MappingParameters(Message):
    """How depth becomes occupancy; metres."""

    resolution: float = 0.05
    max_range: float = 5.0
    """Horizontal range up to which depth counts."""
    min_height: float = 0.10
    max_height: float = 1.40
    """Heights above the floor that are obstacles."""
    footprint_radius: float = 0.36
    """The unknown floor under the robot is free: it stands there."""
    stride: int = 2
    """Every so many rows and columns of the image are read."""


@dc.dataclass(frozen=True, eq=False)
class DepthView(Message):
    """A depth image and where it was taken."""

    depth: NDArray[np.float32]
    """(H, W) float32, metres along the camera's z; 0, NaN and negative are no reading."""
    intrinsics: Intrinsics
    X_WC: NDArray[np.float64]
    """(4, 4) float64 pose of the camera in the world."""

    @staticmethod
    def of(frame: Frame) -> DepthView:
        """Returns the depth view of a captured frame."""
        return DepthView(frame.depth, frame.intrinsics, frame.X_WC)


def integrate(
    occupancy: OccupancyMap,
    views: Sequence[DepthView],
    *,
    parameters: MappingParameters,
    position: tuple[float, float],
    floor_height: float,
    n: int,
    time: float,
) -> OccupancyMap:
    """Returns the map after these views, as a new value with the next version.

    Args:
        occupancy: the map so far; version 0 is replaced by an empty one.
        views: depth images with their poses, in any attitude but steeply up or down.
        parameters: resolution, range and height band.
        position: (x, y) of the robot, metres.
        floor_height: z of the floor in the world, metres.
        n: number of the latest panorama that is part of the new map.
        time: simulated time of the new map, seconds.
    """
    spots = [position, *((float(v.X_WC[0, 3]), float(v.X_WC[1, 3])) for v in views)]
    log_odds, first = _grown(occupancy, spots, parameters)
    _mark_footprint(log_odds, first, position, parameters)
    for view in views:
        _integrate_view(log_odds, first, view, floor_height, parameters)
    log_odds.flags.writeable = False
    resolution = parameters.resolution
    return OccupancyMap(
        n=n,
        version=occupancy.version + 1,
        time=time,
        resolution=resolution,
        origin=(first[1] * resolution, first[0] * resolution),
        log_odds=log_odds,
    )


def _grown(
    occupancy: OccupancyMap, spots: Sequence[tuple[float, float]], parameters: MappingParameters
) -> tuple[NDArray[np.int8], tuple[int, int]]:
    """Returns a writable copy that covers the range around all spots, and its first cell.

    Cells are counted from the world's origin in whole blocks, so a mirrored world has the
    mirrored grid.
    """
    block = BLOCK * parameters.resolution
    reach = parameters.max_range
    low: list[int] = []
    high: list[int] = []
    # Rows run along y, the second number of a spot.
    for values in ([spot[1] for spot in spots], [spot[0] for spot in spots]):
        low.append(math.floor((min(values) - reach) / block) * BLOCK)
        high.append(math.ceil((max(values) + reach) / block) * BLOCK)
    if occupancy.version == 0:
        return np.zeros((high[0] - low[0], high[1] - low[1]), np.int8), (low[0], low[1])
    row = round(occupancy.origin[1] / occupancy.resolution)
    column = round(occupancy.origin[0] / occupancy.resolution)
    rows, columns = occupancy.shape
    i0, i1 = min(low[0], row), max(high[0], row + rows)
    j0, j1 = min(low[1], column), max(high[1], column + columns)
    if (i1 - i0, j1 - j0) == (rows, columns):
        return occupancy.log_odds.copy(), (row, column)
    log_odds = np.zeros((i1 - i0, j1 - j0), np.int8)
    log_odds[row - i0 : row - i0 + rows, column - j0 : column - j0 + columns] = occupancy.log_odds
    return log_odds, (i0, j0)


def _mark_footprint(
    log_odds: NDArray[np.int8],
    first: tuple[int, int],
    position: tuple[float, float],
    parameters: MappingParameters,
) -> None:
    resolution, radius = parameters.resolution, parameters.footprint_radius
    rows = _cells(position[1], radius, resolution, first[0], log_odds.shape[0])
    columns = _cells(position[0], radius, resolution, first[1], log_odds.shape[1])
    window = log_odds[rows, columns]
    if window.all():
        return
    y = (np.arange(rows.start, rows.stop) + first[0] + 0.5) * resolution - position[1]
    x = (np.arange(columns.start, columns.stop) + first[1] + 0.5) * resolution - position[0]
    inside = (x[None, :] ** 2 + y[:, None] ** 2) <= radius**2
    window[inside & (window == 0)] = FREE_STEP


def _cells(center: float, radius: float, resolution: float, first: int, size: int) -> slice:
    """Returns the cells of one axis within a radius of a coordinate, clipped to the grid."""
    low = math.floor((center - radius) / resolution) - first
    high = math.floor((center + radius) / resolution) - first + 1
    return slice(min(max(low, 0), size), min(max(high, 0), size))


def _integrate_view(
    log_odds: NDArray[np.int8],
    first: tuple[int, int],
    view: DepthView,
    floor_height: float,
    parameters: MappingParameters,
) -> None:
    R_WC, p_WC = view.X_WC[:3, :3], view.X_WC[:3, 3]
    horizontal = math.hypot(R_WC[0, 2], R_WC[1, 2])
    if view.depth.ndim != 2 or view.depth.size == 0 or not horizontal >= MIN_LEVEL:
        return
    forward = (float(R_WC[0, 2]) / horizontal, float(R_WC[1, 2]) / horizontal)
    axes = np.array([[forward[0], forward[1], 0.0], [forward[1], -forward[0], 0.0], [0, 0, 1.0]])
    lens = view.intrinsics
    camera = np.array([lens.fx, lens.fy, lens.cx, lens.cy, p_WC[0], p_WC[1], p_WC[2]])
    band = np.array(
        [
            parameters.min_height,
            parameters.max_height,
            p_WC[2] - floor_height,
            parameters.max_range,
        ]
    )
    resolution, stride = parameters.resolution, parameters.stride
    rows = _cells(p_WC[1], parameters.max_range, resolution, first[0], log_odds.shape[0])
    columns = _cells(p_WC[0], parameters.max_range, resolution, first[1], log_odds.shape[1])
    grid = np.array(
        [forward[0], forward[1], resolution, rows.start + first[0], columns.start + first[1]]
    )
    hits = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.uint16)
    bearings = np.full((3, -(-view.depth.shape[1] // stride)), np.inf)
    bearings[1] = 0.0
    depth = frozen_view(view.depth, np.float32)
    sampled = symmetric_columns(view.depth.shape[1], stride)
    scan(depth, sampled, stride, camera, axes @ R_WC, band, grid, hits, bearings)
    corner = np.array([rows.start, columns.start])
    apply(log_odds, corner, stride, camera, parameters.max_range, grid, hits, bearings)
