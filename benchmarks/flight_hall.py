"""A hall parted by a wall with one door, and the voxel map of it, for flights."""

from __future__ import annotations

import dataclasses as dc

import numpy as np
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.flight_navigation import MOVING_VIEWS
from unilavira_drake.messages import Panorama, VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.ports import Level, image_input, message_input, pose_input

SIDE, CEILING, THICKNESS, LINTEL = 8.0, 2.5, 0.15, 2.0
"""The hall is this long and wide, and high, metres; a wall with one door parts it in the middle,
this thick; the door is this high."""
Block = tuple[float, float, float, float, float, float]
"""Lowest x, y, z and highest x, y, z, metres."""


class KnownVoxels(Level):
    """In the place of the mapper: one map, renewed once a second."""

    def __init__(self, voxels: VoxelMap) -> None:
        super().__init__(voxels, period=1.0, offset=0.0)
        message_input(self, "panorama", Panorama())
        for view in MOVING_VIEWS:
            image_input(self, f"{view}.depth_image", ImageDepth32F)
            pose_input(self, f"{view}.X_BC")
        pose_input(self, "pose_estimate")
        self.declare_output("voxel_map", lambda state: state, VoxelMap())

    def step(self, context: Context, state: VoxelMap) -> VoxelMap:
        """Returns the map with the time of now."""
        return dc.replace(state, time=context.get_time())


def hall(door: float, width: float) -> list[Block]:
    """Returns floor, ceiling and walls of a hall parted at x = 0, with a door at y = ``door``."""
    half, t, top = SIDE / 2, THICKNESS, CEILING
    out = half + t
    return [
        (-out, -out, -t, out, out, 0.0),
        (-out, -out, top, out, out, top + t),
        (-out, -out, 0.0, out, -half, top),
        (-out, half, 0.0, out, out, top),
        (-out, -half, 0.0, -half, half, top),
        (half, -half, 0.0, out, half, top),
        (-t / 2, -half, 0.0, t / 2, door - width / 2, top),
        (-t / 2, door + width / 2, 0.0, t / 2, half, top),
        (-t / 2, door - width / 2, LINTEL, t / 2, door + width / 2, top),
    ]


def map_of(blocks: list[Block], resolution: float) -> VoxelMap:
    """Returns the map of a hall; a voxel is occupied whose centre is in a block."""
    lowest = np.min([block[:3] for block in blocks], axis=0)
    highest = np.max([block[3:] for block in blocks], axis=0)
    first = np.floor(lowest / resolution / TILE).astype(int)
    count = np.ceil(highest / resolution / TILE).astype(int) - first
    log_odds = np.full(TILE * count, -20, np.int8)
    for block in blocks:
        corners = np.array(block).reshape(2, 3) / resolution - 0.5
        low, high = np.ceil(corners).astype(int) - TILE * first
        log_odds[tuple(map(slice, low, high))] = 20
    tiles = {}
    for a, b, c in np.ndindex(*count):
        cut = tuple(slice(TILE * k, TILE * (k + 1)) for k in (a, b, c))
        tiles[a + int(first[0]), b + int(first[1]), c + int(first[2])] = log_odds[cut]
    return VoxelMap(n=1, version=1, resolution=resolution, tiles=tiles)
