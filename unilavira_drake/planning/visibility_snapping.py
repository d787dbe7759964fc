"""Where a flight may begin and end: the free voxel nearest to a point that is not free."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.planning.visibility_lines import bit, inside, sees
from unilavira_drake.planning.visibility_space import FlightSpace
from unilavira_drake.planning.visibility_window import FlightWindow, make_window

Point = tuple[float, float, float]

BESIDE = 1.0
"""The goal of a target farther than this and the radius is at least this far from the aircraft,
metres."""

SURFACE = 1.0
"""The front of a thing is looked for up to this far before the selected point, metres."""


def way_out(
    space: FlightSpace, window: FlightWindow, position: Point, reach: float
) -> NDArray[np.float64] | None:
    """Returns the free point nearest to an aircraft, which it reaches straight; (3,) in voxels.

    The aircraft may stand on the ground, or nearer to something than it should.

    Args:
        space: where things are.
        window: where the aircraft may fly.
        position: of the aircraft, metres in the world.
        reach: farthest that such a point is looked for, metres.
    """
    here = window.point(position)
    if not window.is_blocked(here):
        return here
    things = _things_around(space, position, reach)
    found = np.empty(3)
    offset = np.array(window.low, np.float64) - np.array(things.low)
    bound = reach / window.resolution
    rank = _nearest_free(window.words, things.words, offset, here, here, here, bound, 0.0, found)
    return found if rank == 0 else None


def snap_goal(
    space: FlightSpace,
    window: FlightWindow,
    *,
    target: Point,
    position: Point,
    viewpoint: Point,
    max_distance: float,
) -> NDArray[np.float64] | None:
    """Returns the point to fly to for a target, or None if nothing is free; (3,) in voxels.

    The target itself where it is free.  Otherwise the free voxel nearest to it in view of its
    front, or else the nearest one.

    Args:
        space: where things are.
        window: where the aircraft may fly.
        target: the selected point, metres in the world.
        position: of the aircraft.
        viewpoint: from where the target was seen.
        max_distance: bound on the distance from the target to the goal, metres.
    """
    there = window.point(target)
    if not window.is_blocked(there):
        return there
    here, far = window.point(position), math.dist(target, position)
    radius = space.clearance.radius
    apart = BESIDE if far > radius + BESIDE else 0.0
    things = _things_around(space, target, max_distance + SURFACE)
    offset = np.array(window.low, np.float64) - np.array(things.low)
    eye = window.point(viewpoint)
    reach = SURFACE / window.resolution
    front = _front(things.words, there + offset, eye + offset, reach) - offset
    found = np.empty(3)
    bound = max_distance / window.resolution
    rank = _nearest_free(
        window.words, things.words, offset, there, front, here, bound,
        apart / window.resolution, found,
    )  # fmt: skip
    return found if rank < 2 else None


def _things_around(space: FlightSpace, p_WP: Point, reach: float) -> FlightWindow:
    """Returns the window of the occupied voxels around a point."""
    resolution = space.voxels.resolution
    cells = math.ceil(reach / resolution) + 2
    x, y, z = space.voxels.voxel(p_WP)
    return make_window(
        space.occupied,
        low=(x - cells, y - cells, z - cells),
        high=(x + cells + 1, y + cells + 1, z + cells + 1),
        resolution=resolution,
    )


@kernel
def _front(
    things: NDArray[np.uint32],
    there: NDArray[np.float64],
    eye: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """Returns the first free point from a target towards an eye, or the target."""
    distance = math.sqrt(np.sum((eye - there) ** 2))
    steps = int(2.0 * min(reach, distance))
    for step in range(steps + 1):
        point = there + (eye - there) * (0.5 * step / max(distance, 0.5))
        if not inside(things, point[0], point[1], point[2]):
            break
        if not bit(things, math.floor(point[0]), math.floor(point[1]), math.floor(point[2])):
            return point
    return there.copy()


@kernel
def _nearest_free(
    words: NDArray[np.uint32],
    things: NDArray[np.uint32],
    offset: NDArray[np.float64],
    center: NDArray[np.float64],
    front: NDArray[np.float64],
    aircraft: NDArray[np.float64],
    bound: float,
    apart: float,
    found: NDArray[np.float64],
) -> int:
    """Fills ``found`` with the best free voxel's centre within ``bound`` of a point.

    Returns 0 if the point's front is in view from there, 1 if it is not, 2 if there is none.
    ``offset`` leads from voxels of ``words`` to those of ``things``.
    """
    nx, ny, nz = words.shape[0], words.shape[1], 32 * words.shape[2]
    rank, best = 2, np.inf
    eye = front + offset
    for x in range(max(int(center[0] - bound), 0), min(int(center[0] + bound) + 2, nx)):
        for y in range(max(int(center[1] - bound), 0), min(int(center[1] + bound) + 2, ny)):
            for z in range(max(int(center[2] - bound), 0), min(int(center[2] + bound) + 2, nz)):
                px, py, pz = x + 0.5, y + 0.5, z + 0.5
                distance = math.sqrt(
                    (px - center[0]) ** 2 + (py - center[1]) ** 2 + (pz - center[2]) ** 2
                )
                if distance > bound or (rank == 0 and distance >= best):
                    continue
                if bit(words, x, y, z):
                    continue
                to_aircraft = math.sqrt(
                    (px - aircraft[0]) ** 2 + (py - aircraft[1]) ** 2 + (pz - aircraft[2]) ** 2
                )
                if to_aircraft < apart:
                    continue
                ax, ay, az = px + offset[0], py + offset[1], pz + offset[2]
                seen = inside(things, ax, ay, az) and sees(
                    things, eye[0], eye[1], eye[2], ax, ay, az
                )
                if seen and rank > 0:
                    rank, best = 0, np.inf
                if (seen or rank > 0) and distance < best:
                    rank, best = (0 if seen else 1), distance
                    found[0], found[1], found[2] = px, py, pz
    return rank


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    words = np.full((3, 3, 1), 0xFFFFFFF9, np.uint32)
    point, offset = np.full(3, 1.5), np.zeros(3)
    _nearest_free(words, words, offset, point, point, point, 1.0, 0.0, np.empty(3))
    _front(words, point, point, 1.0)
