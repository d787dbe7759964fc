"""Where the robot could go from here, each with a cost in metres of detour."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from unilavira_drake.messages import VIEW_YAW
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import explored, is_hub
from unilavira_drake.mllm.rules.plan import Step
from unilavira_drake.mllm.rules.scene import Exit, Sight, angle_between
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.vocabulary import usual_rooms

_STEP = 3.5
"""Longest move over open floor, metres."""
_SECTOR = 65.0
_WANTED = {"left": 90.0, "right": -90.0, "around": 180.0, "straight": 0.0}
"""Bearing of each turn word, degrees to the left of ``front``."""


@dataclass(frozen=True)
class Option:
    """One place to go to."""

    direction: str
    bearing: float
    """Degrees to the left of ``front``."""
    distance: float
    target: str
    """What is to be grounded, in words."""
    cost: float
    why: str
    cites: str = ""
    """Detection that shows it."""

    @property
    def order(self) -> str:
        """The sentence that tells the vision model what to ground."""
        axis = math.degrees(VIEW_YAW[self.direction])
        off = math.remainder(self.bearing - axis, 360.0)
        side = "left" if off >= 0 else "right"
        return (
            f"Target: {self.target}, about {self.distance:.1f} m, {abs(off):.0f} deg {side} "
            f"of the {self.direction} view's axis."
        )


@dataclass(frozen=True)
class Aim:
    """What the pending steps ask of the next move."""

    goal: Clause | None
    """First hard step."""
    turn: Step | None
    """Turn to be taken with this very move."""
    soft: tuple[Clause, ...]
    """Steps before the goal that only say how to get there."""
    rooms: tuple[str, ...]
    """Rooms named from here on, in order."""
    inside: str
    """Kind of room in which the goal is said to be, if the robot was sent there."""

    @property
    def ends_first(self) -> bool:
        """Whether the goal has to wait until the end of a room, or something, was reached."""
        return any(c.kind == "end" for c in self.soft)


def aim_of(steps: Sequence[Step], room: str) -> Aim:
    """Returns what the pending steps of a plan ask of the next move in a kind of room.

    To walk along the room that the robot is in says how to go on, not where to be.
    """
    pending = [s for s in steps if not s.done]
    here = [s for s in pending if s.clause.kind == "along" and s.clause.room in ("", room)]
    at = next((i for i, s in enumerate(pending) if s.clause.hard and s not in here), len(pending))
    goal = pending[at].clause if at < len(pending) else None
    first = pending[0] if pending else None
    turn = first if first is not None and first.clause.kind in ("turn", "straight") else None
    soft = tuple(s.clause for s in pending[:at])
    rooms = tuple(s.clause.room for s in pending if s.clause.room and s.clause.kind != "leave")
    entered = [s.clause.room for s in steps if s.done and s.clause.kind == "enter"]
    inside = entered[-1] if goal and goal.category and entered else ""
    return Aim(goal, turn, soft, rooms, inside)


def options(situation: Situation, aim: Aim) -> list[Option]:
    """Returns every option, cheapest first; equal costs are ordered by the call's seed.

    After a backtrack the direction that has failed from here is no option.
    """
    found = [
        *_things(situation, aim),
        *_passing(situation, aim),
        *_exits(situation, aim),
        *_floors(situation, aim),
        *_open_floor(situation, aim),
    ]
    failed = situation.variables.failed_direction
    found = [option for option in found if option.direction != failed]
    coin = -1 if situation.key % 2 else 1
    return sorted(found, key=lambda o: (round(o.cost, 3), coin * o.bearing))


def in_sector(turn: Clause, bearing: float) -> bool:
    """Whether a bearing counts as taking a turn."""
    return angle_between(bearing, _WANTED[turn.side or turn.kind]) <= _SECTOR


def _turn_cost(aim: Aim, bearing: float) -> float:
    if aim.turn is None:
        return 0.0
    off = angle_between(bearing, _WANTED[aim.turn.clause.side or aim.turn.clause.kind])
    return off / 15.0 - 8.0 if off <= _SECTOR else 10.0


def _side_cost(side: str, bearing: float) -> float:
    if side not in ("left", "right"):
        return 0.0
    on_side = (bearing > 0.0) == (side == "left")
    return -4.0 if on_side else 4.0


def _failure_cost(situation: Situation, direction: str) -> float:
    here = situation.here
    tried = here.tried if here else ()
    cost = 0.0
    if any(t.startswith(f"{direction}: failed") for t in tried):
        cost += 25.0
    return cost


def _things(situation: Situation, aim: Aim) -> Iterator[Option]:
    goal = aim.goal
    if goal is None or not goal.category or goal.kind not in ("go", "stop"):
        return
    sights = situation.scene.matching(goal)
    if goal.landmark:
        sights = sorted(sights, key=lambda s: _beside(s, goal.landmark, situation))
    elif goal.ordinal > 1 and len(sights) >= goal.ordinal:
        sights = sights[goal.ordinal - 1 :]
    elif goal.ordinal == -1:
        sights = sights[::-1]
    for rank, s in enumerate(sights):
        failure = 8.0 * _failure_cost(situation, s.direction)
        cost = -200.0 + 3.0 * rank + 0.1 * s.distance + failure + _side_cost(goal.side, s.bearing)
        yield Option(s.direction, s.bearing, s.distance, s.name, cost, f"{s.name} in view", s.id)


def _beside(sight: Sight, landmark: str, situation: Situation) -> float:
    marks = situation.scene.matching(Clause("see", landmark))
    return min((math.dist(sight.position, m.position) for m in marks), default=0.0)


def _passing(situation: Situation, aim: Aim) -> Iterator[Option]:
    clause = next((c for c in aim.soft if c.kind in ("pass", "see")), None)
    if clause is None or not clause.category or clause.category == "door":
        return
    for s in situation.scene.matching(clause)[:1]:
        yaw = math.degrees(VIEW_YAW[s.direction])
        free = situation.scene.free.get(s.direction, 0.0)
        cost = -70.0 + _turn_cost(aim, s.bearing) + _failure_cost(situation, s.direction)
        why = f"the way leads past the {s.name}"
        if angle_between(s.bearing, yaw) < 30.0 and free > s.distance:
            reach = min(free - 0.6, s.distance + 0.8, 5.0)
            yield Option(s.direction, yaw, reach, "open floor", cost, why, s.id)
        else:
            yield Option(s.direction, s.bearing, s.distance, s.name, cost, why, s.id)


def _exits(situation: Situation, aim: Aim) -> Iterator[Option]:
    chosen = _ordinal_exits(situation, aim)
    for door in situation.scene.exits:
        s = door.sight
        cost = s.distance + _exit_cost(door, situation, aim)
        cost += _turn_cost(aim, s.bearing) + _failure_cost(situation, s.direction)
        if chosen is not None:
            cost += -40.0 if door in chosen else 40.0
        if door.beyond is None:
            target, why = s.name, "a door not yet looked through"
        elif door.beyond is s:
            target, why = f"floor of the {door.kind}", f"the floor of the {door.kind} is in view"
        else:
            target = f"floor of the {door.kind} beyond the {s.name}"
            why = f"a door to the {door.kind}"
        s = door.beyond or s
        distance = door.sight.distance
        yield Option(s.direction, s.bearing, distance, target, cost, why, s.id)


def _exit_cost(door: Exit, situation: Situation, aim: Aim) -> float:
    goal, kind, here = aim.goal, door.kind, situation.scene.room
    seen_before = explored(kind, door.sight.position, situation.visited)
    cost = 12.0 if seen_before else 0.0
    if any(c.kind == "near_door" and c.room == kind != "" for c in aim.soft):
        return -50.0
    if goal is None:
        return cost + 5.0
    if goal.kind == "leave":
        named = aim.rooms.index(kind) if kind in aim.rooms else 2
        cost = -60.0 + (-30.0, -6.0, 0.0)[min(named, 2)] - (5.0 if is_hub(kind) else 0.0)
        return cost + (0.0 if goal.ordinal else _side_cost(goal.side, door.sight.bearing))
    if goal.kind == "door":
        hub = 6.0 if kind and is_hub(kind) and is_hub(here) else 0.0
        side = 0.0 if goal.ordinal else 2.0 * _side_cost(goal.side, door.sight.bearing)
        return -60.0 + (20.0 if seen_before else 0.0) + hub + side
    if goal.kind in ("enter", "through", "along"):
        side = _side_cost(goal.side, door.sight.bearing)
        if kind == goal.room:
            return (0.0 if aim.ends_first else -100.0) + side
        wrong = 0.0 if not kind else (-3.0 if is_hub(kind) else 8.0)
        return cost + wrong + (side if not kind else 0.0)
    return cost + _search_cost(goal, kind, here, aim)


def _search_cost(goal: Clause, kind: str, here: str, aim: Aim) -> float:
    """How promising an exit is when a thing is looked for."""
    if aim.inside:
        return -20.0 if kind == aim.inside != here else 8.0
    usual = 1.5 if kind and kind in usual_rooms(goal.category) else 0.0
    return -4.0 - usual


def _ordinal_exits(situation: Situation, aim: Aim) -> list[Exit] | None:
    """Returns the one exit that ``second door on the left`` means, once it is in view."""
    goal = aim.goal
    if goal is None or goal.kind not in ("door", "leave") or not (goal.ordinal or goal.landmark):
        return None
    doors = [
        e
        for e in situation.scene.exits
        if goal.side not in ("left", "right") or (e.sight.bearing > 0) == (goal.side == "left")
    ]
    if goal.landmark:
        doors.sort(key=lambda e: _beside(e.sight, goal.landmark, situation))
        return doors[:1]
    if "door" in situation.last_target and situation.origin is not None:
        return sorted(doors, key=lambda e: e.sight.distance)[:1]
    ahead = [e for e in doors if e.sight.position[0] > -0.4]
    ahead.sort(key=lambda e: e.sight.position[0])
    if goal.ordinal == -1:
        return ahead[-1:]
    return ahead[goal.ordinal - 1 : goal.ordinal]


def _floors(situation: Situation, aim: Aim) -> Iterator[Option]:
    """Floors of the wanted room that are in view without their own exit, e.g. through two doors."""
    goal = aim.goal
    if goal is None or goal.kind not in ("enter", "through", "along") or aim.ends_first:
        return
    for s in situation.scene.floors:
        if s.room == goal.room != situation.scene.room:
            cost = -80.0 + s.distance + _turn_cost(aim, s.bearing)
            cost += _failure_cost(situation, s.direction)
            target = f"floor of the {s.room}"
            yield Option(s.direction, s.bearing, s.distance, target, cost, f"{target} seen", s.id)


def _open_floor(situation: Situation, aim: Aim) -> Iterator[Option]:
    scene = situation.scene
    for direction, free in scene.free.items():
        if free < 1.3:
            continue
        bearing = math.degrees(VIEW_YAW[direction])
        reach = min(free - 0.6, _STEP)
        cost = _open_cost(situation, aim, direction, free)
        cost += _turn_cost(aim, bearing) + _failure_cost(situation, direction)
        floor = next(
            (f for f in scene.floors if f.direction == direction and f.room == scene.room), None
        )
        cites = floor.id if floor else scene.room_id
        ahead = (reach * math.cos(math.radians(bearing)), reach * math.sin(math.radians(bearing)))
        visited = any(
            math.dist(ahead, p.position) < 1.5 for p in situation.places if p.distance > 0.6
        )
        cost += 6.0 if visited else 0.0
        yield Option(direction, bearing, reach, "open floor", cost, "free floor ahead", cites)


def _open_cost(situation: Situation, aim: Aim, direction: str, free: float) -> float:
    room, goal = situation.scene.room, aim.goal
    cost = 5.0 - 0.8 * min(free, 5.0)
    if any(c.kind == "end" for c in aim.soft) and direction == "front" and situation.origin:
        return cost - (8.0 if situation.origin.room == room else 0.0)
    if goal is not None and goal.kind == "leave":
        return cost + 20.0
    if is_hub(room):
        return cost - 2.0 + (3.0 if direction == "back" and aim.turn is None else 0.0)
    if aim.inside and aim.inside == room:
        return cost
    return 11.0 - 2.0 * max(0.0, free - 4.0)
