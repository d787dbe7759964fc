"""Geodesic distances in a world of several storeys: over floors, and by stairs between them."""

from __future__ import annotations

import dataclasses as dc
import itertools
import math
from collections.abc import Callable, Mapping

from unilavira_drake.evaluation.free_space import path_distance
from unilavira_drake.messages import Message
from unilavira_drake.planning.geodesic import FreeSpace, GeodesicField
from unilavira_drake.worlds.stairs import Stairs
from unilavira_drake.worlds.world import World

Distance = Callable[[GeodesicField, float, float], float]
"""E.g. ``path_distance``."""


@dc.dataclass(frozen=True, eq=False)
class StairEnd(Message):
    """Where a flight begins or ends: the free floor before it, and the way from there."""

    stairs: Stairs
    elevation: float
    """Of its storey's floor, metres."""
    point: tuple[float, float]
    """Where a robot stands clear of the flight, metres."""
    field: GeodesicField
    """To ``point`` on this storey."""
    rest: float = math.inf
    """Way from ``point`` to the goal, metres."""


@dc.dataclass(frozen=True, eq=False)
class StoreyedField(Message):
    """Shortest way to the goal cells of one storey from any storey."""

    world: World
    spaces: Mapping[float, FreeSpace]
    """Free floor by the height of the storey's floor."""
    elevation: float
    """Of the goal's storey, metres."""
    goal: GeodesicField
    ends: tuple[StairEnd, ...] = ()

    @staticmethod
    def of(
        world: World,
        spaces: Mapping[float, FreeSpace],
        elevation: float,
        goal: GeodesicField,
        *,
        radius: float,
    ) -> StoreyedField:
        """Returns the field of a goal on the storey at ``elevation`` for a robot of a radius."""
        ends = []
        for stairs in world.stairs:
            gap = radius + spaces[stairs.bottom].resolution
            last = stairs.length - stairs.tread
            for floor, s in ((stairs.bottom, -gap), (stairs.top, last + gap)):
                point = stairs.point(s)
                space = spaces[floor]
                cells = space.cells_near([_spot(*point)], 0.75 * space.resolution)
                if not len(cells):
                    continue
                field = GeodesicField.to_cells(space, cells)
                ends.append(StairEnd(stairs, floor, point, field))
        return dc.replace(
            StoreyedField(world, spaces, elevation, goal), ends=_settled(ends, elevation, goal)
        )

    def space(self, z: float) -> FreeSpace:
        """Returns the free floor of the storey at a height."""
        return self.spaces[self.world.storey_at(z)]

    def distance(self, x: float, y: float, z: float, over_floor: Distance) -> float:
        """Returns the length of the shortest way from a place to the goal, metres."""
        flight = next((one for one in self.world.stairs if _is_on(one, x, y, z)), None)
        if flight is not None:
            return min(
                (_left(end, x, y) + end.rest for end in self.ends if end.stairs is flight),
                default=math.inf,
            )
        floor = self.world.storey_at(z)
        ways = [
            over_floor(end.field, x, y) + end.rest
            for end in self.ends
            if end.elevation == floor and math.isfinite(end.rest)
        ]
        if floor == self.elevation:
            ways.append(over_floor(self.goal, x, y))
        return min(ways, default=math.inf)


def climb_length(stairs: Stairs, s: float, end: float) -> float:
    """Returns the length of the way over stairs between two distances along the way up, metres."""
    low, high = min(s, end), max(s, end)
    corners = [(-math.inf, stairs.bottom), *stairs.profile, (math.inf, stairs.top)]
    total = 0.0
    for (a, z_a), (b, z_b) in itertools.pairwise(corners):
        part = max(0.0, min(b, high) - max(a, low))
        slope = 0.0 if math.isinf(b - a) else (z_b - z_a) / (b - a)
        total += part * math.hypot(1.0, slope)
    return total


def _settled(ends: list[StairEnd], elevation: float, goal: GeodesicField) -> tuple[StairEnd, ...]:
    """Returns the ends with the ways from them to the goal (Bellman and Ford's relaxation)."""
    rests = [
        path_distance(goal, *end.point) if end.elevation == elevation else math.inf for end in ends
    ]
    for _ in ends:
        for i, end in enumerate(ends):
            for k, other in enumerate(ends):
                if i == k or math.isinf(rests[k]):
                    continue
                if end.stairs is other.stairs:
                    s = [end.stairs.along(*one.point) for one in (end, other)]
                    way = climb_length(end.stairs, s[0], s[1])
                elif end.elevation == other.elevation:
                    way = path_distance(other.field, *end.point)
                else:
                    continue
                rests[i] = min(rests[i], way + rests[k])
    return tuple(dc.replace(end, rest=rest) for end, rest in zip(ends, rests, strict=True))


def _is_on(stairs: Stairs, x: float, y: float, z: float) -> bool:
    return stairs.contains(x, y) and abs(stairs.height(x, y) - z) < 0.5


def _left(end: StairEnd, x: float, y: float) -> float:
    stairs = end.stairs
    return climb_length(stairs, stairs.along(x, y), stairs.along(*end.point))


def _spot(x: float, y: float) -> tuple[tuple[float, float], ...]:
    e = 1e-3
    return ((x - e, y - e), (x + e, y - e), (x + e, y + e), (x - e, y + e))
