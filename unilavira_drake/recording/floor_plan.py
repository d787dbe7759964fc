"""A world seen from above, ready to be drawn: rooms, walls, openings and outlines of things."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.world import Box, Room, World, WorldObject

MARGIN = 0.2
"""Metres around the rooms."""
_OVERHEAD = 1.0
"""A piece of wall that begins above this height is a lintel: below it is an opening, metres."""
_HANGING = 1.8
"""What begins above this height is over the robot and gets no word, metres."""
_RASTER = 0.01
"""Metres; coarser where a thing is larger than a house."""
_MOST_CELLS = 3000
"""Along a side of the raster of a thing."""

Outline = NDArray[np.float64]
"""(k, 2) corners, metres in the world."""


@dataclass(frozen=True, eq=False)
class PlanThing:
    """A thing on the plan."""

    name: str
    category: str
    outlines: tuple[Outline, ...]
    """Of its boxes together; more than one when they stand apart."""
    box: tuple[float, float, float, float]
    """(x_min, y_min, x_max, y_max) of all outlines."""
    slight: bool
    """Whether it hangs over the robot, or is nothing that it could bump into."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """What a world looks like from above; metres."""

    bounds: tuple[float, float, float, float]
    """(x_min, y_min, x_max, y_max) with a margin."""
    rooms: tuple[Room, ...]
    walls: tuple[Outline, ...]
    """Walls and door jambs."""
    openings: tuple[Outline, ...]
    """Doorways: the floor under lintels."""
    things: tuple[PlanThing, ...]
    """Large ones first, so that small ones are drawn on top."""


def floor_plan(world: World) -> FloorPlan:
    """Returns the plan of a world."""
    doors = [thing for thing in world.objects if thing.category == "door"]
    jambs = [box for door in doors for box in door.boxes if _bottom(box) < _OVERHEAD]
    things = [
        _plan_thing(thing) for thing in world.objects if thing.boxes and thing.category != "door"
    ]
    return FloorPlan(
        bounds=_bounds(world.rooms),
        rooms=world.rooms,
        walls=_outlines([box for box in world.walls if _bottom(box) < _OVERHEAD] + jambs),
        openings=_outlines(box for box in world.walls if _bottom(box) >= _OVERHEAD),
        things=tuple(sorted(things, key=_extent, reverse=True)),
    )


def _plan_thing(thing: WorldObject) -> PlanThing:
    footprints = [np.array(box.corners()) for box in thing.boxes]
    corners = np.concatenate(footprints)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return PlanThing(
        name=thing.name,
        category=thing.category,
        outlines=_union(footprints, low, high),
        box=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        slight=min(map(_bottom, thing.boxes)) > _HANGING or not thing.solid,
    )


def _union(
    footprints: list[Outline], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[Outline, ...]:
    """The outlines of convex footprints together, through a raster."""
    if len(footprints) == 1:
        return (footprints[0],)
    step = max(_RASTER, float((high - low).max()) / _MOST_CELLS)
    columns, rows = np.ceil((high - low) / step).astype(int) + 1
    mask = np.zeros((rows, columns), np.uint8)
    for footprint in footprints:
        cv2.fillConvexPoly(mask, np.rint((footprint - low) / step).astype(np.int32), 1)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return tuple(cv2.approxPolyDP(contour, 1.0, True)[:, 0, :] * step + low for contour in contours)


def _bounds(rooms: Iterable[Room]) -> tuple[float, float, float, float]:
    rectangles = np.array([room.rectangle for room in rooms])
    x_min, y_min = rectangles[:, :2].min(axis=0) - MARGIN
    x_max, y_max = rectangles[:, 2:].max(axis=0) + MARGIN
    return float(x_min), float(y_min), float(x_max), float(y_max)


def _outlines(boxes: Iterable[Box]) -> tuple[Outline, ...]:
    return tuple(np.array(box.corners()) for box in boxes)


def _bottom(box: Box) -> float:
    return box.center[2] - box.size[2] / 2


def _extent(thing: PlanThing) -> float:
    x_min, y_min, x_max, y_max = thing.box
    return (x_max - x_min) * (y_max - y_min)
