"""Doors and borders to other rooms as options."""

from __future__ import annotations

import math
from collections.abc import Iterator

from unilavira_drake.mllm.rules.aim import Aim, on_side, side_cost, turn_cost
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import explored, is_hub
from unilavira_drake.mllm.rules.option import Option, tried_cost
from unilavira_drake.mllm.rules.sight import Exit
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.vocabulary import usual_rooms


def exit_options(situation: Situation, aim: Aim) -> Iterator[Option]:
    """Yields one option for each exit in view."""
    chosen = _ordinal_exits(situation, aim)
    for door in situation.scene.exits:
        s = door.sight
        cost = s.distance + _exit_cost(door, situation, aim)
        cost += turn_cost(aim, s.bearing) + tried_cost(situation, s.direction)
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
        return cost + (0.0 if goal.ordinal else side_cost(goal.side, door.sight.bearing, aim))
    if goal.kind == "door":
        hub = 6.0 if kind and is_hub(kind) and is_hub(here) else 0.0
        side = 0.0 if goal.ordinal else 2.0 * side_cost(goal.side, door.sight.bearing, aim)
        return -60.0 + (20.0 if seen_before else 0.0) + hub + side
    if goal.kind in ("enter", "through", "along"):
        side = side_cost(goal.side, door.sight.bearing, aim)
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
    doors = [e for e in situation.scene.exits if on_side(goal.side, e.sight.bearing, aim)]
    if goal.landmark:
        doors.sort(key=lambda e: situation.scene.beside(e.sight, goal.landmark))
        return doors[:1]
    if "door" in situation.last_target and situation.origin is not None:
        return sorted(doors, key=lambda e: e.sight.distance)[:1]
    ahead = sorted((_ahead(e, aim), i) for i, e in enumerate(doors) if _ahead(e, aim) > -0.4)
    ranked = [doors[i] for _, i in ahead]
    if goal.ordinal == -1:
        return ranked[-1:]
    return ranked[goal.ordinal - 1 : goal.ordinal]


def _ahead(door: Exit, aim: Aim) -> float:
    """Returns how far ahead a door is once a pending turn is taken, metres."""
    return door.sight.distance * math.cos(math.radians(door.sight.bearing - aim.heading))
