"""The true world as voxels, and the shortest way through its air."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.planning.visibility import FlightParameters, make_flight_plan
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space
from unilavira_drake.worlds.air_clearance import box_distances, solids
from unilavira_drake.worlds.world import Box, World

Point = tuple[float, float, float]

OUTDOORS, INDOORS = 1.0, 0.1
"""Side of a voxel, metres."""
CEILING = 60.0
"""Ways lead at most this high, metres; higher only where they begin."""
SNAP = 8.0
"""A way ends at most this far beside its goal, metres."""


def air_space(world: World, *, radius: float) -> FlightSpace:
    """Returns where an aircraft of a radius can fly in a true world."""
    resolution = OUTDOORS if world.outdoors else INDOORS
    voxels = VoxelMap(n=1, version=1, resolution=resolution, tiles=_tiles(world, resolution))
    clearance = Clearance(radius=radius, ground_margin=radius, ceiling_margin=radius)
    return update_space(FlightSpace(VoxelMap(resolution=resolution), clearance), voxels)


def air_way(space: FlightSpace, start: Point, goal: Point) -> float:
    """Returns the length of a shortest way from a place to the free air nearest to another, metres.

    inf where there is none.
    """
    radius = space.clearance.radius
    parameters = FlightParameters(
        clearance=space.clearance,
        min_altitude=min(radius, start[2]),
        max_altitude=max(CEILING, start[2] + 1.0),
        climb_angle=0.5 * math.pi,
        descend_angle=0.5 * math.pi,
        snap_distance=SNAP,
        max_distance=1e5,
    )
    plan = make_flight_plan(
        space, position=start, target=goal, viewpoint=start, parameters=parameters
    )
    return math.inf if plan.reason else plan.length


def _tiles(world: World, resolution: float) -> dict[tuple[int, int, int], NDArray[np.int8]]:
    """Returns the tiles of the voxels that touch something solid."""
    tiles: dict[tuple[int, int, int], NDArray[np.int8]] = {}
    for _, box in solids(world):
        low, high = _span(box, resolution)
        for key in np.ndindex(*(high // TILE - low // TILE + 1)):
            tile = tuple(int(value) for value in low // TILE + key)
            first = np.maximum(low, np.array(tile) * TILE)
            last = np.minimum(high, np.array(tile) * TILE + TILE - 1)
            axes = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
            cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            middles = (cells.reshape(-1, 3) + 0.5) * resolution
            touched = box_distances(middles, (box,)) < 0.5 * resolution
            inside = cells.reshape(-1, 3)[touched] - np.array(tile) * TILE
            a, b, c = tile
            filled = tiles.setdefault((a, b, c), np.zeros((TILE, TILE, TILE), np.int8))
            filled[tuple(inside.T)] = 1
    return tiles


def _span(box: Box, resolution: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns the first and the last voxel of a box along each axis."""
    corners = np.array(box.corners())
    half = box.size[2] / 2
    low = np.array([*corners.min(axis=0), box.center[2] - half])
    high = np.array([*corners.max(axis=0), box.center[2] + half])
    return (
        np.floor(low / resolution).astype(np.int64),
        np.floor(high / resolution).astype(np.int64),
    )
