"""Things whose pixels are known to move: kept out of the map, and remembered beside it.

The map forgets a newcomer within seconds, as it must where nobody can tell a person from a wall.
Who is known by their pixels is remembered apart from it: where they were last seen, until their
place is seen without them, they are seen elsewhere, or a time has passed.  A robot that drives past
somebody who stands sees them no more, and must not forget them while it is beside them.
"""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.depth_view import DepthView, fault_of
from unilavira_drake.mapping.occupancy import MappingParameters
from unilavira_drake.mapping.storeys import SAME_STOREY
from unilavira_drake.messages import Message, read_only

LEAST_PIXELS = 60
"""Who shows fewer is not seen."""
LABELS = 32768
"""Render labels are below this."""
BODY = 0.25
"""Radius of a thing about its middle, of a person with arms, metres."""
BEHIND = 0.10
"""Its middle lies so far behind what is seen of it, metres, ..."""
INWARD = 0.19
"""... and at least so far from the side of it that a view shows whose border cuts off the other."""
BESIDE, STOOD = 1.5, 20.0
"""Who is no farther from the robot than this, metres, and was not seen to walk, is remembered for
so long, seconds: a robot that drives sees who is farther, but not who is beside it."""
PROVEN = 2.0
"""Who was seen to stand for so long, seconds, is remembered as long wherever the robot is: or it
would turn back on its way round them."""
ELSEWHERE = 4.0
"""All others are remembered for so long, seconds."""
STRAY, STILL = 0.15, 0.5
"""Who leaves a place by more than these metres walks, until they stay for so many seconds; so does
who was just met."""
LONGEST_GAP = 1.6
"""Nobody knows what somebody did between looks farther apart than this, seconds."""
TALLEST = 2.1
"""Nobody is taller than this, metres."""
HEIGHTS = (0.6, 0.9, 1.2)
"""A place is seen empty where the camera looks past it at one of these, metres above the floor,"""
PAST = 0.30
"""and farther than its middle by this, metres."""

Point = tuple[float, float]
Cells = NDArray[np.int64]


@dc.dataclass(frozen=True, eq=False)
class Look(Message):
    """A depth view, and what moves in it."""

    view: DepthView
    labels: NDArray[np.int16]
    """(H, W) int16: whose pixel it is of the things that move, 0 of all else."""
    time: float
    """Seconds."""


@dc.dataclass(frozen=True, eq=False)
class MovingThing(Message):
    """Something that is known to move, as it was last seen."""

    label: int
    position: Point
    """Of its middle in the world, metres."""
    cells: Cells
    """(k, 2) rows and columns, counted from the world's origin, over which it was seen."""
    floor_height: float
    """z of the floor on which the robot was, metres."""
    time: float
    """When it was seen, seconds."""
    anchor: Point
    """Where it stays or was last seen to leave, metres, ..."""
    since: float
    """... and since when, seconds."""
    walks: bool = True

    def forgotten(self, robot: Point, time: float) -> bool:
        """Whether it was seen too long ago for where the robot is."""
        beside = math.dist(self.position, robot) <= BESIDE
        stands = not self.walks and (beside or self.time - self.since >= PROVEN)
        return time - self.time > (STOOD if stands else ELSEWHERE)


@dc.dataclass(frozen=True, eq=False)
class _Sighting:
    label: int
    pixels: int
    position: Point
    height: float
    """Median of what is seen, above the floor under the robot, metres."""
    cells: Cells
    """Of what is seen within the map's range and heights."""
    time: float


def wanted(labels: Sequence[int]) -> NDArray[np.int16]:
    """Returns a (32768,) table that is the label itself for these labels and 0 for others."""
    table = np.zeros(LABELS, np.int16)
    table[list(labels)] = list(labels)
    return table


def without(look: Look) -> DepthView:
    """Returns a view that says nothing where things move: no reading, neither free nor occupied."""
    if not look.labels.any():
        return look.view
    depth = np.where(look.labels != 0, np.float32(0.0), look.view.depth)
    return dc.replace(look.view, depth=depth)


def remembered(
    things: Iterable[MovingThing],
    looks: Sequence[Look],
    parameters: MappingParameters,
    *,
    robot: Point,
    floor_height: float,
    time: float,
) -> tuple[MovingThing, ...]:
    """Returns the things that are known after these looks, in the order of their labels.

    Args:
        things: known before.
        looks: any number; those that make no sense are left out.
        parameters: of the map.
        robot: (x, y) of the robot, metres.
        floor_height: z of the floor under the robot in the world, metres.
        time: seconds.
    """
    believed = [look for look in looks if not fault_of(look.view)]
    old = {thing.label: thing for thing in things}
    best: dict[int, _Sighting] = {}
    for look in believed:
        for sighting in _sightings(look, parameters, floor_height):
            known = best.get(sighting.label)
            if known is None or sighting.pixels >= known.pixels:
                best[sighting.label] = sighting
    new = {
        label: thing
        for label, thing in old.items()
        if label not in best
        and not thing.forgotten(robot, time)
        and not any(_seen_past(look, thing, parameters) for look in believed)
    }
    for label, sighting in best.items():
        # Who is out of range or on another storey is at least not where they were.
        if _within_reach(sighting, robot, parameters):
            new[label] = _followed(old.get(label), sighting, floor_height)
    return tuple(new[label] for label in sorted(new))


def cells_around(x: float, y: float, radius: float, resolution: float) -> Cells:
    """Returns the (k, 2) cells (row, column) whose centres lie within a radius of a point."""
    first_row, first_column = (math.floor((c - radius) / resolution) for c in (y, x))
    size = math.ceil(2.0 * radius / resolution) + 2
    rows, columns = np.mgrid[first_row : first_row + size, first_column : first_column + size]
    away = np.hypot((rows + 0.5) * resolution - y, (columns + 0.5) * resolution - x)
    near = away <= radius
    return np.stack((rows[near], columns[near]), axis=1)


def _sightings(look: Look, own: MappingParameters, floor_height: float) -> list[_Sighting]:
    """Returns what is seen of the things that move."""
    step, view = own.stride, look.view
    depth, labels = view.depth[::step, ::step], look.labels[::step, ::step]
    v, u = np.nonzero((labels != 0) & np.isfinite(depth) & (depth > 0.0))
    if not len(v):
        return []
    z = depth[v, u].astype(np.float64)
    k = view.intrinsics
    rays = np.stack(((step * u - k.cx) / k.fx * z, (step * v - k.cy) / k.fy * z, z))
    offset = view.X_WC[:3, :3] @ rays
    height = offset[2] + view.X_WC[2, 3] - floor_height
    inside = (height >= own.min_height) & (height <= own.max_height)
    inside &= np.hypot(offset[0], offset[1]) <= own.max_range
    whose = labels[v, u]
    found = []
    for label in np.unique(whose).tolist():
        mine = whose == label
        pixels = int(mine.sum()) * step**2
        if pixels < LEAST_PIXELS:
            continue
        cut = [bool((look.labels[:, column] == label).any()) for column in (0, -1)]
        above = float(np.median(height[mine]))
        x, y = (view.X_WC[:2, 3] + _middle(offset[:2, mine], cut[0], cut[1])).tolist()
        p_W = offset[:2, mine & inside].T + view.X_WC[:2, 3]
        cells = np.unique(np.floor(p_W[:, ::-1] / own.resolution).astype(np.int64), axis=0)
        found.append(_Sighting(label, pixels, (x, y), above, cells, look.time))
    return found


def _within_reach(sighting: _Sighting, robot: Point, own: MappingParameters) -> bool:
    """Whether who is seen, maybe by the head alone, is in range on the storey of the robot."""
    here = -SAME_STOREY <= sighting.height <= TALLEST + SAME_STOREY
    return here and math.dist(sighting.position, robot) <= own.max_range


def _middle(points: NDArray[np.float64], cut_left: bool, cut_right: bool) -> NDArray[np.float64]:
    """Returns the middle of a thing of which points are seen, (2,), relative to the camera.

    Args:
        points: (2, k) relative to the camera, metres.
        cut_left: whether the view's left border cuts it off.
        cut_right: whether its right border does.
    """
    median = np.median(points, axis=1)
    ahead = median / max(float(np.hypot(*median)), 1e-6)
    middle: NDArray[np.float64] = median + BEHIND * ahead
    if cut_left == cut_right:
        return middle
    towards = np.array([-ahead[1], ahead[0]]) * (1.0 if cut_left else -1.0)
    side = float(np.percentile(towards @ (points - median[:, None]), 5.0))
    return middle + towards * max(side + INWARD, 0.0)


def _followed(old: MovingThing | None, sighting: _Sighting, floor_height: float) -> MovingThing:
    position, time = sighting.position, sighting.time
    if old is None or time - old.time > LONGEST_GAP:
        anchor, since, walks = position, time, True
    else:
        strayed = math.dist(position, old.anchor) > STRAY
        anchor, since = (position, time) if strayed else (old.anchor, old.since)
        walks = strayed or (old.walks and time - since < STILL)
    return MovingThing(
        sighting.label,
        position,
        read_only(sighting.cells),
        floor_height,
        time,
        anchor,
        since,
        walks,
    )


def _seen_past(look: Look, thing: MovingThing, own: MappingParameters) -> bool:
    """Whether a thing's place is in view, and the camera looks past where its middle was."""
    if look.time <= thing.time:
        return False
    lens, X_WC = look.view.intrinsics, look.view.X_WC
    x, y = thing.position
    p_WP = np.array([(x, y, thing.floor_height + height) for height in HEIGHTS])
    px, py, pz = ((p_WP - X_WC[:3, 3]) @ X_WC[:3, :3]).T.tolist()
    for right, down, ahead in zip(px, py, pz, strict=True):
        if ahead <= BODY:
            continue
        row = round(lens.fy * down / ahead + lens.cy)
        columns = [round(lens.fx * (right + s) / ahead + lens.cx) for s in (-BODY, 0.0, BODY)]
        if not (0 <= row < lens.height and columns[0] >= 0 and columns[2] < lens.width):
            continue
        depth = float(look.view.depth[row, columns[1]])
        if ahead + PAST < depth and (math.isinf(depth) or depth < own.saturation):
            return True
    return False
