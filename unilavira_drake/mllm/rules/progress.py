"""Which steps of the plan the present evidence closes, each with the detection that shows it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import climbed, is_hub
from unilavira_drake.mllm.rules.plan import Step
from unilavira_drake.mllm.rules.sight import angle_between
from unilavira_drake.mllm.rules.situation import Situation

NEAR_DOOR = 2.2
END_FREE = 2.2
"""With less free floor than this ahead a room ends, metres."""


@dataclass(frozen=True)
class Progress:
    """What changed, and what is left."""

    closed: tuple[tuple[Step, str], ...]
    """Steps now met, with the evidence."""
    moot: tuple[Step, ...]
    """Steps that no longer matter because a later one is met."""
    steps: tuple[Step, ...]
    """The whole plan after both."""

    @property
    def pending(self) -> tuple[Step, ...]:
        """The steps still to be done, in order."""
        return tuple(step for step in self.steps if not step.done)


def review(situation: Situation) -> Progress:
    """Closes every pending step whose condition is met, in order.

    A hard step waits for the hard steps before it; a soft one (turn, pass, end, ...) does not
    block later ones and becomes moot when a later hard one is met.
    """
    closed: list[tuple[Step, str]] = []
    moot: list[Step] = []
    waiting: list[Step] = []
    turned = True
    room_closed = False
    for step in situation.pending:
        clause = step.clause
        blocked = any(w.clause.hard for w in waiting) and not _overtakes(step, waiting, situation)
        needs_turn = clause.kind in ("along", "end", "pass", "see", "near_door")
        fresh_door = clause.kind == "door" and room_closed
        evidence = ""
        if not (blocked or fresh_door or (needs_turn and not turned)):
            evidence = _met(clause, situation)
        if not evidence:
            waiting.append(step)
            turned = turned and clause.kind not in ("turn", "straight")
            continue
        closed.append((step, evidence))
        room_closed = room_closed or clause.kind in ("leave", "enter", "through")
        if clause.hard and clause.kind != "leave" and waiting:
            if not _still_to_turn(clause, waiting):
                moot += waiting
                waiting = []
                turned = True
    done = {step.index for step, _ in closed} | {step.index for step in moot}
    steps = tuple(
        dataclasses.replace(s, done=True) if s.index in done else s for s in situation.steps
    )
    return Progress(tuple(closed), tuple(moot), steps)


def _still_to_turn(clause: Clause, waiting: list[Step]) -> bool:
    """Whether the steps before are turns to be taken in this same corridor."""
    return clause.kind == "along" or (is_hub(clause.room) and clause.kind != "stop")


def _overtakes(step: Step, waiting: list[Step], situation: Situation) -> bool:
    """Whether a room may be entered although hard steps before it are open.

    Only where those steps are about rooms on the way, and none of them speaks of this room.
    """
    if step.clause.kind != "enter" or is_hub(step.clause.room):
        return False
    hard = [w.clause for w in waiting if w.clause.hard]
    on_the_way = all(c.kind in ("enter", "through", "along", "leave") for c in hard)
    start = situation.places[0].room if situation.places else situation.scene.room
    return on_the_way and step.clause.room not in (start, *(c.room for c in hard))


def _met(clause: Clause, situation: Situation) -> str:
    """Returns the evidence that a clause is met, or nothing."""
    scene = situation.scene
    if clause.kind in ("go", "stop"):
        sight = situation.reached(clause)
        return f"{sight.name} at {sight.near:.1f} m ({sight.id})" if sight else ""
    if clause.kind == "leave":
        return _underfoot(situation) if scene.room and scene.room != clause.room else ""
    if clause.kind in ("enter", "through"):
        return _underfoot(situation) if scene.room == clause.room else ""
    if clause.kind == "along":
        inside = scene.room == clause.room or (not clause.room and is_hub(scene.room))
        return _underfoot(situation) if inside else ""
    if clause.kind == "door":
        origin = situation.origin
        changed = origin is not None and origin.room not in ("", scene.room)
        return _underfoot(situation) if changed and scene.room else ""
    if clause.kind == "pass":
        return _passed(clause, situation)
    if clause.kind == "see":
        seen = scene.matching(clause)
        return f"{seen[0].name} in view ({seen[0].id})" if seen else ""
    others = {"near_door": _at_door, "end": _at_end, "climb": _climbed}
    return others[clause.kind](clause, situation) if clause.kind in others else ""


def _climbed(clause: Clause, situation: Situation) -> str:
    arrived = climbed(situation.variables.last_action) == clause.side
    return f"one floor {clause.side}, {_underfoot(situation)}" if arrived else ""


def _underfoot(situation: Situation) -> str:
    return f"floor of the {situation.scene.room} underfoot ({situation.scene.room_id})"


def _passed(clause: Clause, situation: Situation) -> str:
    scene = situation.scene
    if clause.category == "door":
        sights = [e.sight for e in scene.exits]
    elif clause.category:
        sights = scene.matching(clause)
    else:
        sights = [e.sight for e in scene.exits if e.kind == clause.room]
    for sight in sights:
        behind = angle_between(sight.bearing, 0.0) > 80.0 and sight.distance < 4.0
        if sight.near <= 1.5 or behind:
            place = "beside" if not behind else "behind"
            return f"{sight.name} {place} the robot at {sight.near:.1f} m ({sight.id})"
    return ""


def _at_door(clause: Clause, situation: Situation) -> str:
    scene = situation.scene
    if clause.room and scene.room == clause.room:
        return _underfoot(situation)
    for door in scene.exits:
        if door.sight.distance <= NEAR_DOOR and clause.room in ("", door.kind):
            return f"door to the {door.kind or 'next room'} at hand ({door.sight.id})"
    return ""


def _at_end(clause: Clause, situation: Situation) -> str:
    scene, origin = situation.scene, situation.origin
    if (clause.room and scene.room != clause.room) or origin is None:
        return ""
    came_along = origin.room == scene.room and origin.distance > 1.0
    bearing = math.degrees(math.atan2(origin.position[1], origin.position[0]))
    behind = angle_between(bearing, 180.0) < 60.0
    if came_along and behind and scene.free.get("front", math.inf) < END_FREE:
        return f"end of the {scene.room}: {scene.free['front']:.1f} m ahead ({scene.room_id})"
    return ""
