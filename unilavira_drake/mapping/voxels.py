"""The voxel map: depth images in, a new frozen map that shares what did not change out."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view
from unilavira_drake.mapping.depth_view import DepthView, fault_of
from unilavira_drake.mapping.voxels_carving import apply, carve, extent, sample
from unilavira_drake.messages import Message, VoxelMap
from unilavira_drake.messages.voxels import TILE, overlap, tiles_between

MAX_SPAN = 400
"""Most voxels between the camera and the end of its range."""


@dc.dataclass(frozen=True)
class VoxelParameters(Message):
    """How depth becomes voxels; metres.

    Raises:
        ValueError: if a number makes no sense, or the range has too many voxels.
    """

    resolution: float = 0.5
    max_range: float = 40.0
    """Distance from the camera up to which depth counts; beyond, a ray only frees."""
    saturation: float = math.inf
    """Readings from here on are none: what the sensor says when it knows nothing."""
    far_is_free: bool = False
    """Whether a reading of inf says that nothing lies within the range, as it does for Drake's
    cameras.  Otherwise it is no reading."""
    stride: int = 4
    """Every so many rows and columns of the image are read."""

    def __post_init__(self) -> None:
        if not (0.0 < self.resolution < math.inf and 0.0 < self.max_range < math.inf):
            raise ValueError("resolution and max_range must be positive")
        if self.max_range > MAX_SPAN * self.resolution:
            raise ValueError(f"max_range must be at most {MAX_SPAN} voxels")
        if self.stride < 1 or not self.saturation > 0.0:
            raise ValueError("stride and saturation must be positive")


def integrate_voxels(
    voxels: VoxelMap,
    views: Sequence[DepthView],
    *,
    parameters: VoxelParameters,
    n: int,
    time: float,
) -> VoxelMap:
    """Returns the map after these views, as a new value with the next version.

    Views that make no sense are left out, and ``rejected`` of the new map says why.  Without a
    single reading in any view the time of the map stays as it was: nothing was seen.

    Args:
        voxels: the map so far; version 0 is replaced by an empty one of the right resolution.
        views: depth images with their poses, in any attitude.
        parameters: resolution and range.
        n: number of the latest panorama that is part of the new map.
        time: simulated time of the views, seconds.

    Raises:
        ValueError: if the map has another resolution.
    """
    if voxels.version > 0 and voxels.resolution != parameters.resolution:
        raise ValueError(
            f"the map's voxels are {voxels.resolution:g} m, not {parameters.resolution:g} m"
        )
    tiles = dict(voxels.tiles)
    rejected, seen = [], False
    for number, view in enumerate(views):
        fault = fault_of(view)
        if fault:
            rejected.append(f"view {number}: {fault}")
        elif _integrate_view(tiles, view, parameters):
            seen = True
    return dc.replace(
        voxels,
        n=n,
        version=voxels.version + 1,
        time=time if seen else voxels.time,
        resolution=parameters.resolution,
        tiles=tiles,
        rejected=tuple(rejected),
    )


def _integrate_view(
    tiles: dict[tuple[int, int, int], NDArray[Any]], view: DepthView, parameters: VoxelParameters
) -> bool:
    """Replaces the tiles that the view changes; returns whether the view has any reading."""
    stride, lens = parameters.stride, view.intrinsics
    shape = tuple(-(-(size - stride // 2) // stride) for size in view.depth.shape)
    if min(shape) <= 0:
        return False
    camera = np.array([lens.fx, lens.fy, lens.cx, lens.cy])
    limits = np.array(
        [parameters.max_range, parameters.saturation, 1.0 if parameters.far_is_free else 0.0]
    )
    readings, sights = np.empty(shape), np.empty(shape)
    sample(frozen_view(view.depth, np.float32), stride, camera, limits, readings, sights)
    if not readings.any():
        return False
    pose = np.ascontiguousarray(view.X_WC[:3] / parameters.resolution, np.float64)
    box = np.empty((2, 3), np.int64)
    extent(stride, camera, pose, readings, sights, box)
    # The window consists of whole tiles.
    low = box[0] // TILE * TILE
    high = (box[1] // TILE + 1) * TILE
    stamps = np.zeros(tuple(high - low), np.uint8)
    carve(stride, camera, pose, readings, sights, low, stamps)
    empty = VoxelMap()
    corner = (int(low[0]), int(low[1]), int(low[2]))
    end = (int(high[0]), int(high[1]), int(high[2]))
    for key in tiles_between(corner, end):
        _, there = overlap(key, corner, end)
        old = tiles.get(key)
        new = np.empty((TILE, TILE, TILE), np.int8)
        if apply(empty.tile(key) if old is None else old, stamps[there], new):
            new.flags.writeable = False
            tiles[key] = new
    return True
