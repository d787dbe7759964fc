"""Where the robot could go from here, each with a cost in metres of detour."""

from __future__ import annotations

import math
from collections.abc import Iterator

from unilavira_drake.messages import VIEW_YAW, direction_of
from unilavira_drake.mllm.rules.aim import Aim, side_cost, turn_cost
from unilavira_drake.mllm.rules.exit_options import exit_options
from unilavira_drake.mllm.rules.memory import is_hub
from unilavira_drake.mllm.rules.option import Option, tried_cost
from unilavira_drake.mllm.rules.sight import angle_between
from unilavira_drake.mllm.rules.situation import Situation

_STEP = 3.5
"""Longest move over open floor, metres."""
_LEAST = 0.8
"""Shortest move over open floor, metres."""


def options(situation: Situation, aim: Aim) -> list[Option]:
    """Returns every option, cheapest first; equal costs are ordered by the call's seed.

    After a backtrack the direction that has failed from here is no option.
    """
    found = [
        *_things(situation, aim),
        *_passing(situation, aim),
        *exit_options(situation, aim),
        *_floors(situation, aim),
        *_remembered(situation, aim),
        *_open_floor(situation, aim),
    ]
    failed = situation.variables.failed_direction
    found = [option for option in found if option.direction != failed]
    coin = -1 if situation.key % 2 else 1
    return sorted(found, key=lambda o: (round(o.cost, 3), coin * o.bearing))


def _things(situation: Situation, aim: Aim) -> Iterator[Option]:
    goal = aim.goal
    if goal is None or not goal.category or goal.kind not in ("go", "stop"):
        return
    sights = situation.scene.matching(goal)
    if goal.landmark:
        sights = sorted(sights, key=lambda s: situation.scene.beside(s, goal.landmark))
    elif goal.ordinal > 1 and len(sights) >= goal.ordinal:
        sights = sights[goal.ordinal - 1 :]
    elif goal.ordinal == -1 or _towards_the_end(situation, aim):
        sights = sights[::-1]
    for rank, s in enumerate(sights):
        failure = 8.0 * tried_cost(situation, s.direction)
        cost = (
            -200.0 + 3.0 * rank + 0.1 * s.distance + failure + side_cost(goal.side, s.bearing, aim)
        )
        yield Option(s.direction, s.bearing, s.distance, s.name, cost, f"{s.name} in view", s.id)


def _towards_the_end(situation: Situation, aim: Aim) -> bool:
    """Whether the way still leads to the end of a corridor: then the farther of two is meant."""
    return is_hub(situation.scene.room) and any(c.kind == "end" for c in aim.soft)


def _passing(situation: Situation, aim: Aim) -> Iterator[Option]:
    clause = next((c for c in aim.soft if c.kind in ("pass", "see")), None)
    if clause is None or not clause.category or clause.category == "door":
        return
    for s in situation.scene.matching(clause)[:1]:
        yaw = math.degrees(VIEW_YAW[s.direction])
        free = situation.scene.free.get(s.direction, 0.0)
        cost = -70.0 + turn_cost(aim, s.bearing) + tried_cost(situation, s.direction)
        why = f"the way leads past the {s.name}"
        if angle_between(s.bearing, yaw) < 30.0 and free > s.distance:
            reach = min(free - 0.6, s.distance + 0.8, 5.0)
            yield Option(s.direction, yaw, reach, "open floor", cost, why, s.id)
        else:
            yield Option(s.direction, s.bearing, s.distance, s.name, cost, why, s.id)


def _floors(situation: Situation, aim: Aim) -> Iterator[Option]:
    """Floors of the wanted room that are in view without their own exit, e.g. through two doors."""
    goal = aim.goal
    if goal is None or goal.kind not in ("enter", "through", "along") or aim.ends_first:
        return
    for s in situation.scene.floors:
        if s.room == goal.room != situation.scene.room:
            # From a corridor, what is seen through one room has a door of its own further on.
            cost = 2.0 if is_hub(situation.scene.room) else -80.0
            cost += s.distance + turn_cost(aim, s.bearing)
            cost += tried_cost(situation, s.direction)
            target = f"floor of the {s.room}"
            yield Option(s.direction, s.bearing, s.distance, target, cost, f"{target} seen", s.id)


def _remembered(situation: Situation, aim: Aim) -> Iterator[Option]:
    """Doors to the wanted room that captions of earlier places tell of, where none is in view."""
    goal = aim.goal
    if goal is None or goal.kind not in ("enter", "through", "along") or aim.ends_first:
        return
    for place in situation.places:
        for kind, (x, y) in place.exits:
            distance, bearing = math.hypot(x, y), math.degrees(math.atan2(y, x))
            if kind != goal.room or distance < 0.8:
                continue
            direction = direction_of(math.radians(bearing))
            cost = -40.0 + distance + turn_cost(aim, bearing) + tried_cost(situation, direction)
            why = f"at waypoint {place.id} a door to the {kind} was seen"
            cites = situation.scene.room_id
            yield Option(direction, bearing, distance, "open floor", cost, why, cites)


def _open_floor(situation: Situation, aim: Aim) -> Iterator[Option]:
    scene = situation.scene
    for direction, free in scene.free.items():
        bearing, reach = math.degrees(VIEW_YAW[direction]), min(free - 0.6, _STEP)
        floor = next(
            (f for f in scene.floors if f.direction == direction and f.room == scene.room), None
        )
        if reach < _LEAST and floor is not None:
            # A wall on the axis, as in a corridor seen obliquely: the floor beside it.
            bearing, reach, free = floor.bearing, floor.distance, floor.far
        if reach < _LEAST:
            continue
        cost = _open_cost(situation, aim, direction, free)
        cost += turn_cost(aim, bearing) + tried_cost(situation, direction)
        cites = floor.id if floor else scene.room_id
        ahead = (reach * math.cos(math.radians(bearing)), reach * math.sin(math.radians(bearing)))
        visited = any(
            math.dist(ahead, p.position) < 1.5 for p in situation.places if p.distance > 0.6
        )
        cost += 6.0 if visited else 0.0
        yield Option(direction, bearing, reach, "open floor", cost, "free floor ahead", cites)


def _on_threshold(situation: Situation) -> bool:
    """Whether the robot stands in the door of a room that it has not looked at from inside."""
    here, room = situation.variables.current_waypoint, situation.scene.room
    inside = any(p.room == room and p.id != here and p.distance < 4.0 for p in situation.places)
    return situation.on_threshold and not inside


def _open_cost(situation: Situation, aim: Aim, direction: str, free: float) -> float:
    room, goal = situation.scene.room, aim.goal
    cost = 5.0 - 0.6 * min(free, 7.0)
    if any(c.kind == "end" for c in aim.soft) and direction == "front" and situation.origin:
        return cost - (8.0 if situation.origin.room == room else 0.0)
    if goal is not None and goal.kind == "leave":
        return cost + 20.0
    if is_hub(room):
        return cost - 2.0 + (3.0 if direction == "back" and aim.turn is None else 0.0)
    floors = [f for f in situation.scene.floors if f.direction == direction]
    ahead = max(floors, key=lambda f: f.pixels).room if floors else ""
    if _on_threshold(situation) and ahead == room and goal is not None and goal.category:
        return cost - 12.0
    if aim.inside and aim.inside == room:
        return cost
    return 11.0 - 2.0 * max(0.0, free - 4.0)
