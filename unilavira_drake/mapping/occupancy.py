"""The occupancy map: depth images in, a new frozen map that shares what did not change out.

Log-odds of occupancy on a grid of the floor (Moravec and Elfes' occupancy grid), in tenths, as
int8.  A height band above the floor is projected onto the grid; free space is carved along each
bearing up to the first obstacle, and only as far as the floor, or something beyond, was seen.

Heights are relative to the plane on which the robot stands, so a robot on a slope sees that slope
as floor.  From level ground a slope is floor for its first ``min_height / tan(angle)`` metres and
an obstacle from there on: 1.2 m of a 1:12 ramp, room enough to drive onto it.  Where a slope ends
in level ground, that lies below the plane and is a drop from ``FLOOR_TOLERANCE / tan(angle)``
metres on (1.8 m), until the robot stands on it.  What is higher than ``max_height`` above the plane
is passed under.
"""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view
from unilavira_drake.mapping.depth_scan import FREE_STEP, carve, scan, stand, symmetric_columns
from unilavira_drake.mapping.depth_view import FARTHEST, DepthView, fault_of
from unilavira_drake.messages import Message, OccupancyMap
from unilavira_drake.messages.cell_tiles import TILE, CellTiles, Key

BLOCK = TILE
"""The grid grows by whole tiles of so many cells."""

MAX_FRAME = 64 * BLOCK
"""Most rows and columns of the grid that planners and pictures see, 205 m of cells of 5 cm.  What
lies farther from the robot is kept, and is seen again when the robot comes near."""

MAX_SPAN = 1000
"""Most cells between a camera and the end of its range, and between a camera and its robot."""

MIN_LEVEL = 0.2
"""A camera whose axis has less than this horizontal share looks at the floor or the ceiling: it
has no bearings, and is not integrated."""

NEWEST = 4
"""Where things move, see ``MappingParameters.newest``."""

UPRIGHT = (0.0, 0.0, 1.0)


@dc.dataclass(frozen=True)
class MappingParameters(Message):
    """How depth becomes occupancy; metres.

    Raises:
        ValueError: if a number makes no sense, or the range has too many cells.
    """

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
    free_step: int = FREE_STEP
    """What a cell seen free loses of its log-odds, tenths.  With 4 a thing that was carried away is
    gone after 3 looks at the place for one look before, 10 at most; from 40 on after one."""
    newest: int = 0
    """For things that move: what appears on free floor is believed after one look, forgotten after
    one, and out of view after so many seconds less one (at most ``free_step``).  What is known to
    move has just these log-odds.  0: nothing is expected to move, and what comes is believed after
    five looks."""
    saturation: float = math.inf
    """Readings from here on are none: what the sensor says when it knows nothing.  Without it a
    reading of inf says that nothing lies within the range, as it does for Drake's cameras."""

    def __post_init__(self) -> None:
        if not (0.0 < self.resolution < math.inf and 0.0 < self.max_range < math.inf):
            raise ValueError("resolution and max_range must be positive")
        if max(self.max_range, self.footprint_radius) > MAX_SPAN * self.resolution:
            raise ValueError(f"max_range and footprint_radius must be at most {MAX_SPAN} cells")
        if self.stride < 1 or self.free_step < 1 or not self.saturation > 0.0:
            raise ValueError("stride, free_step and saturation must be positive")
        if not 0 <= self.newest <= self.free_step:
            raise ValueError("newest must not be negative, nor above free_step")


def integrate(
    occupancy: OccupancyMap,
    views: Sequence[DepthView],
    *,
    parameters: MappingParameters,
    position: tuple[float, float],
    floor_height: float,
    n: int,
    time: float,
    up: tuple[float, float, float] = UPRIGHT,
) -> OccupancyMap:
    """Returns the map after these views, as a new value with the next version.

    Views that make no sense are left out, and ``rejected`` of the new map says why.  Where nothing
    is left of them, or nobody knows where the robot is, cells, version and time stay as they were.

    Args:
        occupancy: the map so far; version 0 is replaced by an empty one.
        views: depth images with their poses, in any attitude but steeply up or down.
        parameters: resolution, range and height band.
        position: (x, y) of the robot, metres.
        floor_height: z of the floor under the robot in the world, metres.
        n: number of the latest panorama that is part of the new map.
        time: simulated time of the new map, seconds.
        up: unit vector in the world, upright on the floor under the robot.

    Raises:
        ValueError: if the map has another resolution.
    """
    if occupancy.version > 0 and occupancy.resolution != parameters.resolution:
        raise ValueError(
            f"the map's cells are {occupancy.resolution:g} m, not {parameters.resolution:g} m"
        )
    lost = _fault_of_robot(position, floor_height, up)
    faults = [lost or _fault_of(view, position, parameters) for view in views]
    rejected = tuple(f"view {k}: {fault}" for k, fault in enumerate(faults) if fault)
    if lost or (views and all(faults)):
        return dc.replace(occupancy, n=n, rejected=rejected or (lost,))
    believed = [view for view, fault in zip(views, faults, strict=True) if not fault]
    old = occupancy.cells if occupancy.version > 0 else CellTiles(shape=(0, 0))
    if parameters.newest and math.floor(time) > math.floor(occupancy.time):
        old = _older(old, parameters.newest)
    low, high = _frame(old, position, believed, parameters)
    canvas = _Canvas(old, low, high, [position, *map(_spot, believed)], parameters)
    canvas.stand(position)
    for view in believed:
        canvas.look(view, (*position, floor_height), up)
    resolution = parameters.resolution
    return OccupancyMap(
        n=n,
        version=occupancy.version + 1,
        time=time,
        resolution=resolution,
        origin=(low[1] * resolution, low[0] * resolution),
        cells=old.updated(canvas.changed(), first=low, shape=(high[0] - low[0], high[1] - low[1])),
        rejected=rejected,
    )


def _spot(view: DepthView) -> tuple[float, float]:
    return float(view.X_WC[0, 3]), float(view.X_WC[1, 3])


def _older(cells: CellTiles, newest: int) -> CellTiles:
    """Returns the cells a second later: newcomers lose 1, and at 0 the floor is free again."""
    changed = {}
    for key, tile in cells.tiles.items():
        new = (tile > 0) & (tile <= newest)
        if new.any():
            aged = np.where(new, tile - 1, tile).astype(np.int8)
            aged[new & (aged == 0)] = -1
            aged.flags.writeable = False
            changed[key] = aged
    return cells.updated(changed, first=cells.first, shape=cells.shape)


def _fault_of_robot(
    position: tuple[float, float], floor_height: float, up: tuple[float, float, float]
) -> str:
    numbers = (*position, floor_height)
    if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in numbers):
        return f"the robot's position is not finite, or beyond {FARTHEST:g} m"
    if not (abs(math.hypot(*up) - 1.0) < 1e-3 and up[2] > 0.5):
        return "the robot does not stand upright"
    return ""


def _fault_of(view: DepthView, position: tuple[float, float], parameters: MappingParameters) -> str:
    fault = fault_of(view)
    if fault:
        return fault
    if not math.hypot(view.X_WC[0, 2], view.X_WC[1, 2]) >= MIN_LEVEL:
        return "the camera looks steeply up or down"
    away = math.hypot(view.X_WC[0, 3] - position[0], view.X_WC[1, 3] - position[1])
    if away > MAX_SPAN * parameters.resolution:
        return f"the camera is {away:.0f} m from the robot"
    return ""


def _frame(
    cells: CellTiles,
    position: tuple[float, float],
    views: Sequence[DepthView],
    parameters: MappingParameters,
) -> tuple[Key, Key]:
    """Returns the new frame [low, high): the old one and the range around robot and cameras.

    Cells are counted from the world's origin in whole tiles, so a mirrored world has the mirrored
    grid.  A frame that gets too large is begun anew around the robot.
    """
    block, reach = BLOCK * parameters.resolution, parameters.max_range
    # Rows run along y, the second number of a position.
    low, high = [], []
    for axis in (1, 0):
        spots = [position[axis], *(_spot(view)[axis] for view in views)]
        low.append(math.floor((min(spots) - reach) / block) * BLOCK)
        high.append(math.ceil((max(spots) + reach) / block) * BLOCK)
    whole = _joined((low[0], low[1]), (high[0], high[1]), cells.first, cells.shape)
    if all(b - a <= MAX_FRAME for a, b in zip(*whole, strict=True)):
        return whole
    center = [math.floor(position[axis] / block) * BLOCK for axis in (1, 0)]
    ends = [(c - MAX_FRAME // 2, c + MAX_FRAME // 2) for c in center]
    nearby = [
        key
        for key in cells.tiles
        if all(a <= index * TILE < b for index, (a, b) in zip(key, ends, strict=True))
    ]
    for axis in (0, 1):
        indices = [key[axis] for key in nearby]
        low[axis] = max(min([low[axis], *(i * TILE for i in indices)]), ends[axis][0])
        high[axis] = min(max([high[axis], *((i + 1) * TILE for i in indices)]), ends[axis][1])
    return (low[0], low[1]), (high[0], high[1])


def _joined(low: Key, high: Key, first: Key, shape: Key) -> tuple[Key, Key]:
    if 0 in shape:
        return low, high
    return (
        (min(low[0], first[0]), min(low[1], first[1])),
        (max(high[0], first[0] + shape[0]), max(high[1], first[1] + shape[1])),
    )


class _Canvas:
    """The tiles around a robot side by side, while they are changed.

    Args:
        cells: what is known so far.
        low: of the new frame [low, high).
        high: of the new frame.
        spots: (x, y) of the robot and its cameras, metres.
        parameters: of the map.
    """

    def __init__(
        self,
        cells: CellTiles,
        low: Key,
        high: Key,
        spots: Sequence[tuple[float, float]],
        parameters: MappingParameters,
    ) -> None:
        self._frame = low, high
        self._parameters = parameters
        reach = max(parameters.max_range, parameters.footprint_radius)
        windows = [self._window(spot, reach) for spot in spots]
        first = [min(window[0][axis] for window in windows) // TILE for axis in (0, 1)]
        last = [(max(window[1][axis] for window in windows) - 1) // TILE for axis in (0, 1)]
        self._first = first[0], first[1]
        self._corner = first[0] * TILE, first[1] * TILE
        end = (last[0] + 1) * TILE, (last[1] + 1) * TILE
        self._cells = cells.window(self._corner, end)
        self._touched = np.zeros((last[0] + 1 - first[0], last[1] + 1 - first[1]), np.bool_)

    def _window(self, spot: tuple[float, float], radius: float) -> tuple[Key, Key]:
        """Returns the cells [low, high) within a radius of a point along each axis, framed."""
        resolution, (low, high) = self._parameters.resolution, self._frame
        i0, j0 = (math.floor((spot[axis] - radius) / resolution) for axis in (1, 0))
        i1, j1 = (math.floor((spot[axis] + radius) / resolution) + 1 for axis in (1, 0))
        return (max(i0, low[0]), max(j0, low[1])), (min(i1, high[0]), min(j1, high[1]))

    def stand(self, position: tuple[float, float]) -> None:
        """Frees the unknown floor under the robot."""
        x, y = float(position[0]), float(position[1])
        radius, resolution = self._parameters.footprint_radius, self._parameters.resolution
        stand(self._cells, self._touched, *self._corner, (x, y), radius, resolution)

    def look(
        self, view: DepthView, foot: tuple[float, float, float], up: tuple[float, float, float]
    ) -> None:
        """Enters what a view says; ``foot`` is the point of the floor under the robot."""
        R_WC, p_WC = view.X_WC[:3, :3], view.X_WC[:3, 3].tolist()
        x, y, _ = R_WC[:, 2].tolist()
        horizontal = math.hypot(x, y)
        x, y = x / horizontal, y / horizontal
        axes = np.array([[x, y, 0.0], [y, -x, 0.0], up])
        lens, own = view.intrinsics, self._parameters
        width, stride = view.depth.shape[1], own.stride
        camera = np.array([lens.fx, lens.fy, lens.cx, lens.cy, *p_WC])
        height = sum(up[axis] * (p_WC[axis] - foot[axis]) for axis in (2, 1, 0))
        known = own.saturation if math.isfinite(own.saturation) else math.nan
        band = np.array([own.min_height, own.max_height, height, own.max_range, known])
        (i0, j0), (i1, j1) = self._window(_spot(view), own.max_range)
        grid = np.array([x, y, own.resolution, i0, j0])
        hits = np.zeros((i1 - i0, j1 - j0), np.uint32)
        struck = np.empty(hits.size, np.int64)
        bearings = np.full((3, -(-width // stride)), np.inf)
        bearings[1] = 0.0
        with np.errstate(over="ignore"):
            depth = frozen_view(view.depth, np.float32)
        columns, rays = symmetric_columns(width, stride), axes @ R_WC
        count = scan(depth, columns, stride, camera, rays, band, grid, hits, struck, bearings)
        carve(
            self._cells,
            self._touched,
            np.array([i0 - self._corner[0], j0 - self._corner[1]]),
            stride,
            camera,
            own.max_range,
            own.free_step,
            own.newest,
            grid,
            hits,
            struck[:count],
            bearings,
        )

    def changed(self) -> dict[Key, NDArray[np.int8]]:
        """Returns the tiles that changed, read-only."""
        tiles = {}
        for a, b in np.argwhere(self._touched).tolist():
            tile = self._cells[a * TILE : (a + 1) * TILE, b * TILE : (b + 1) * TILE].copy()
            tile.flags.writeable = False
            tiles[self._first[0] + a, self._first[1] + b] = tile
        return tiles
