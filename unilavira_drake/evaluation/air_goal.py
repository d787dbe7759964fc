"""The goal of a flight: straight distances in three dimensions, and the way that is compared.

As in OpenUAV (Wang et al., "Towards Realistic UAV Vision-Language Navigation", 2024): a flight
succeeds within 20 m of its goal, and is Easy or Hard by the length of its reference way.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.evaluation.air_space import air_space, air_way
from unilavira_drake.evaluation.goal import GoalTarget, resolve_goal
from unilavira_drake.evaluation.scoring import GoalField, make_goal_field
from unilavira_drake.planning.visibility_space import FlightSpace
from unilavira_drake.tasks import SuccessRule
from unilavira_drake.worlds.air_clearance import box_distances, nearest_on
from unilavira_drake.worlds.world import Box, World

EASY = 250.0
"""A flight whose reference way is at most this long is Easy, metres."""

_CIRCLE = 24


@dataclass(frozen=True, eq=False)
class AirGoal(GoalField):
    """The goal of a flight."""

    boxes: tuple[tuple[Box, ...], ...] = ()
    """Of each alternative: what the distance is measured to."""
    radius: float = 0.3
    """The aircraft's, metres; the reference way keeps it free."""

    def distances(self, x: float, y: float, z: float = 0.0) -> tuple[float, ...]:
        """Returns the straight distance to each alternative, metres."""
        point = np.array([[x, y, z]])
        return tuple(float(box_distances(point, boxes)[0]) for boxes in self.boxes)

    def distance(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the straight distance to the nearest alternative, metres."""
        return min(self.distances(x, y, z))

    def way_from(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the length of the reference way, metres: past and over what is in the way.

        It ends in the free air at that point of a goal that is nearest to the start; inf where
        there is no way.
        """
        start = (x, y, z)
        ways = []
        for boxes in self.boxes:
            nearest = min(
                (nearest_on(box, start) for box in boxes), key=lambda p: math.dist(p, start)
            )
            # The last voxel may lie a little before the goal.
            ways.append(max(air_way(self._space, start, nearest), math.dist(start, nearest)))
        return min(ways)

    def path_type(self, way: float) -> str | None:
        """Returns ``easy`` or ``hard`` for a reference way, metres; None where there is none."""
        return path_type(way) if math.isfinite(way) else None

    def outlines(self, radius: float) -> tuple[NDArray[np.float64], ...]:
        """Returns what lies within a radius of each alternative seen from above, (k, 2) metres."""
        angle = 2.0 * math.pi * np.arange(_CIRCLE) / _CIRCLE
        ring = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
        return tuple(
            _hull(np.concatenate([corner + ring for box in boxes for corner in box.corners()]))
            for boxes in self.boxes
        )

    def _with(self, kept: list[int]) -> AirGoal:
        return dataclasses.replace(
            self,
            targets=tuple(self.targets[i] for i in kept),
            boxes=tuple(self.boxes[i] for i in kept),
        )

    @functools.cached_property
    def _space(self) -> FlightSpace:
        return air_space(self.world, radius=self.radius)


def make_goal(text: str, world: World, rule: SuccessRule, *, radius: float) -> GoalField:
    """Returns what scores a goal text under a rule, for a robot of this radius.

    Raises:
        TaskError: if the text does not resolve, or no free floor is near a target on the ground.
    """
    if not rule.straight:
        return make_goal_field(text, world, radius=radius)
    targets = resolve_goal(text, world)
    boxes = tuple(_boxes(target, world, to_middle=rule.to_middle) for target in targets)
    return AirGoal(world, targets, (), boxes=boxes, radius=radius)


def path_type(length: float) -> str:
    """Returns ``easy`` or ``hard`` for the length of a reference way, metres (OpenUAV)."""
    return "easy" if length <= EASY else "hard"


def _boxes(target: GoalTarget, world: World, *, to_middle: bool) -> tuple[Box, ...]:
    thing = world.object(target.text)
    if target.point is not None:
        return (Box((*target.point, target.height), (0.0, 0.0, 0.0)),)
    if thing is None:
        room = world.room(target.rooms[0])
        assert room is not None
        x_min, y_min, x_max, y_max = room.rectangle
        boxes: tuple[Box, ...] = (Box((*room.center, 0.0), (x_max - x_min, y_max - y_min, 0.0)),)
    else:
        boxes = thing.boxes
    if not to_middle:
        return boxes
    low = np.min([np.array(box.center) - np.array(box.size) / 2 for box in boxes], axis=0)
    high = np.max([np.array(box.center) + np.array(box.size) / 2 for box in boxes], axis=0)
    x, y, z = (float(value) for value in (low + high) / 2)
    return (dataclasses.replace(boxes[0], center=(x, y, z), size=(0.0, 0.0, 0.0)),)


def _hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, points.tolist()))
    chains = []
    for way in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for point in way:
            while len(chain) > 1 and _left(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _left(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
