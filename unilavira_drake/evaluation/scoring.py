"""Scoring: success, navigation error and SPL, from the truth and never from the agent.

Success: the agent ended by its own verified stop, and the stop keeps the task's
``tasks.SuccessRule``: near enough to the free floor at the goal by geodesic distance and, where the
rule says so, in the goal's room and with the goal instance in its last panorama.
SPL = success * l / max(l, p) with the shortest way l and the way gone p (Anderson et al., "On
Evaluation of Embodied Navigation Agents", 2018).  Of a flight l is 20 m less than the shortest way,
for the last 20 m need not be flown (OpenUAV).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from unilavira_drake.errors import TaskError
from unilavira_drake.evaluation.free_space import free_space, path_distance, quick_distance
from unilavira_drake.evaluation.goal import GoalTarget, footprint, resolve_goal
from unilavira_drake.evaluation.stair_ways import StoreyedField
from unilavira_drake.messages import Message, Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.planning.geodesic import GeodesicField
from unilavira_drake.tasks import SuccessRule
from unilavira_drake.worlds.world import World

HOME_RULE = SuccessRule()
LOOSE_DISTANCE = 3.0
"""The radius common in the literature, printed beside, metres."""
SEEN_PIXELS = 60
"""A goal instance counts as seen when one frame shows at least this many pixels of it."""


@dataclass(frozen=True, eq=False)
class GoalField(Message):
    """The goal of an episode: its alternatives, and the geodesic distance to each of them."""

    world: World = World()
    targets: tuple[GoalTarget, ...] = ()
    fields: tuple[GeodesicField, ...] = ()
    """On the storey of each alternative."""
    ways: tuple[StoreyedField, ...] = ()
    """Over stairs too; empty in a world of one storey."""

    @property
    def places(self) -> tuple[tuple[float, float], ...]:
        """Middle of each alternative, metres in the world; for pictures."""
        return tuple(target.place(self.world) for target in self.targets)

    def on(self, elevation: float) -> GoalField:
        """Returns the goal with the alternatives of one storey alone; for pictures."""
        if len(self.world.elevations) < 2:
            return self
        kept = [i for i, target in enumerate(self.targets) if target.elevation == elevation]
        return self._with(kept)

    def distances(self, x: float, y: float, z: float = 0.0) -> tuple[float, ...]:
        """Returns the geodesic distance to each alternative, metres; inf where there is no way."""
        if self.ways:
            return tuple(way.distance(x, y, z, path_distance) for way in self.ways)
        return tuple(path_distance(field, x, y) for field in self.fields)

    def distance(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the distance to the nearest alternative, metres: a few percent long, and fast."""
        if self.ways:
            return min(way.distance(x, y, z, quick_distance) for way in self.ways)
        return min(quick_distance(field, x, y) for field in self.fields)

    def way_from(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the length of the shortest way from a start, metres; see ``shortest_path``."""
        space = self.ways[0].space(z) if self.ways else self.fields[0].space
        beside = (-space.resolution, 0.0, space.resolution)
        # A start up to one cell beside free floor is free: the border of the grid is that coarse.
        if not any(space.is_free(x + dx, y + dy) for dx in beside for dy in beside):
            raise TaskError(
                f"start: {x:.2f},{y:.2f} is inside an obstacle, too near to one, or shut in; "
                "choose a start on free floor."
            )
        return min(self.distances(x, y, z))

    def path_type(self, way: float) -> str | None:
        """Returns how hard a way of this length is called; None on the ground."""
        del way
        return None

    def _with(self, kept: list[int]) -> GoalField:
        """Returns the goal with some of its alternatives."""
        return dataclasses.replace(
            self,
            targets=tuple(self.targets[i] for i in kept),
            fields=tuple(self.fields[i] for i in kept),
            ways=tuple(self.ways[i] for i in kept),
        )


@dataclass(frozen=True)
class Score(Message):
    """The verdict on an episode; None where it is not scored or not defined."""

    success: bool | None = None
    success_3m: bool | None = None
    """Stopped within 3 m, whatever the room and the view."""
    navigation_error_m: float | None = None
    path_length_m: float = 0.0
    shortest_path_m: float | None = None
    path_type: str | None = None
    """``easy`` or ``hard``, of a flight."""
    spl: float | None = None
    oracle_success: bool | None = None
    """Whether the robot ever was within the rule's radius."""
    same_room: bool | None = None
    goal_seen: bool | None = None
    answer_correct: bool | None = None
    notes: tuple[str, ...] = ()
    """Why a figure is not defined."""


def make_goal_field(
    goal: str, world: World, *, radius: float, resolution: float | None = None
) -> GoalField:
    """Returns what scores a goal text in a world for a robot of this radius.

    Cells have a side of 5 cm, or 25 cm under the open sky, unless ``resolution`` says otherwise.

    Raises:
        TaskError: if the text does not resolve, or no free floor is near a target.
    """
    if resolution is None:
        resolution = 0.25 if world.outdoors else 0.05
    targets = resolve_goal(goal, world)
    spaces = {
        elevation: free_space(world, radius=radius, resolution=resolution, elevation=elevation)
        for elevation in world.elevations
    }
    fields = tuple(
        GeodesicField.to_cells(
            spaces[target.elevation], footprint(target, world, spaces[target.elevation])
        )
        for target in targets
    )
    if len(spaces) == 1:
        return GoalField(world, targets, fields)
    ways = tuple(
        StoreyedField.of(world, spaces, target.elevation, field, radius=radius)
        for target, field in zip(targets, fields, strict=True)
    )
    return GoalField(world, targets, fields, ways)


def shortest_path(goal: GoalField, x: float, y: float, z: float = 0.0) -> float:
    """Returns the length of the shortest way from a start to the goal, metres.

    Raises:
        TaskError: if the start is inside an obstacle or cut off from every alternative.
    """
    return goal.way_from(x, y, z)


def score(
    goal: GoalField | None,
    metrics: EpisodeMetrics,
    start: tuple[float, ...],
    panorama: Panorama,
    rule: SuccessRule = HOME_RULE,
) -> Score:
    """Returns the verdict on an episode.

    Args:
        goal: None when the episode is not scored.
        metrics: at the end of the episode.
        start: (x, y) or (x, y, z) of the base at the start, metres.
        panorama: the last one.
        rule: what makes a stop a success; what an answer makes of it: ``answers.score_answer``.

    Raises:
        TaskError: if the start cannot be one.
    """
    if goal is None:
        return Score(path_length_m=metrics.path_length)
    shortest = shortest_path(goal, *start)
    x, y = metrics.position
    distances = goal.distances(x, y, metrics.z)
    error = min(distances)
    stopped = metrics.cause == "stopped"
    nearest = goal.targets[distances.index(error)]
    success = stopped and any(
        rule.reached(distance)
        and (not rule.in_room or in_room(target, goal.world, x, y, metrics.z))
        and (not rule.seen or seen(target, panorama) is not False)
        for target, distance in zip(goal.targets, distances, strict=True)
    )
    spl, notes = _spl(success, shortest, metrics.path_length, rule.unflown)
    if math.isinf(error):
        notes += ("navigation_error_m: the robot ended where it has no way to the goal",)
    closest = error if metrics.min_goal_distance is None else metrics.min_goal_distance
    return Score(
        success=success,
        success_3m=stopped and error <= LOOSE_DISTANCE,
        navigation_error_m=error if math.isfinite(error) else None,
        path_length_m=metrics.path_length,
        shortest_path_m=shortest if math.isfinite(shortest) else None,
        path_type=goal.path_type(shortest),
        spl=spl,
        oracle_success=rule.reached(min(closest, error)),
        same_room=in_room(nearest, goal.world, x, y, metrics.z),
        goal_seen=seen(nearest, panorama),
        notes=notes,
    )


def in_room(target: GoalTarget, world: World, x: float, y: float, z: float = 0.0) -> bool:
    """Whether a floor point lies in (one of) the target's rooms."""
    room = world.room_at(x, y, z)
    return room is not None and room.name in target.rooms


def seen(target: GoalTarget, panorama: Panorama) -> bool | None:
    """Whether a frame shows the target; None for a room or a point, which need not be seen."""
    if target.kind != "instance":
        return None
    if target.label is None:
        return False
    return any(
        int(np.count_nonzero(frame.label == target.label)) >= SEEN_PIXELS
        for frame in panorama.frames
    )


def _spl(
    success: bool, shortest: float, gone: float, unflown: float
) -> tuple[float | None, tuple[str, ...]]:
    asked = max(shortest - unflown, 0.0)
    if asked == 0.0:
        return None, ("spl: the robot started at the goal",)
    if math.isinf(shortest):
        return None, ("spl: there is no way from the start to the goal",)
    return (asked / max(asked, gone) if success else 0.0), ()
