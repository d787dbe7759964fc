"""Where to fly next: towards a sighted landmark, along a way, to a height, or to search."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.messages import DIRECTIONS, DOWN, VIEW_YAW
from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.progress import FlightProgress
from unilavira_drake.mllm.rules.flight.scene import LandmarkSight
from unilavira_drake.mllm.rules.flight.situation import LEVEL, PASSING, FlightSituation
from unilavira_drake.mllm.rules.flight.words import GROUND, WAYS

LOOKOUT = 25.0
"""Height from which one searches, metres."""
OPEN_GROUND = "open ground"
BELOW = "ground below"
_STRIDE = 30.0
"""Longest move without a mark, metres."""
_MARGIN = 8.0
"""What is left free ahead, metres."""
_BACK = 12.0
"""What each place where the aircraft was speaks against the view to it, metres of free distance."""
_NEAR_PLACE = 80.0
"""Farther places are not minded, metres."""
_AROUND = 60.0
"""Nearer to a stated place one searches around it, and minds where one was, metres."""
_PROMISE = 8.0
"""What each landmark in a view is worth to the search, metres of free distance."""
_FAILED = 50.0
_OFF_WAY = 0.4
"""What a degree off the direction to the stated place speaks against a thing, metres."""
_SIDES = {"left": 90.0, "right": -90.0, "around": 180.0}


@dataclass(frozen=True)
class Move:
    """One action and what it is for."""

    action: dict[str, object]
    why: str
    order: str = ""
    """The sentence that tells the vision model what to mark."""


def turn(
    direction: str, target: str, distance: float, bearing: float, why: str, climb: float | None
) -> Move:
    """Returns a flight to something in a view."""
    off = 0.0
    if direction != DOWN:
        off = math.remainder(bearing - math.degrees(VIEW_YAW[direction]), 360.0)
    side = "left" if off >= 0 else "right"
    order = (
        f"Target: {target}, about {distance:.1f} m, {abs(off):.0f} deg {side} of the {direction} "
        "view's axis."
    )
    height = None if climb is None else round(climb, 1)
    return Move({"tool": "turn", "direction": direction, "climb": height}, why, order)


def next_move(situation: FlightSituation, progress: FlightProgress) -> Move:
    """Returns the move that serves the first open legs best."""
    hard = next((step.leg for step in progress.pending if step.leg.hard), None)
    soft = [step.leg for step in progress.pending[: _first_hard(progress)]]
    side = next((leg.side for leg in soft if leg.kind == "turn"), "")
    if hard is not None and hard.kind in ("climb", "descend"):
        return _to_height(situation, hard)
    sight = _chosen(situation, hard, side) if hard is not None else None
    if sight is not None and hard is not None:
        return _to_sight(situation, hard, sight)
    if hard is not None and situation.lost(hard):
        return _look_lower(situation, hard)
    if situation.variables.bearings is not None:
        return _by_numbers(situation, side)
    along = next((leg for leg in soft if leg.kind == "along"), None)
    if along is not None:
        way = _chosen(situation, along, side, ahead=True)
        if way is not None:
            return _to_sight(situation, along, way)
    back = _remembered(situation, hard)
    if back is not None:
        return back
    around = _chosen(situation, Leg("go", hard.beside), side) if hard and hard.beside else None
    if around is not None and around.distance > PASSING:
        return _to_sight(situation, Leg("past", hard.beside if hard else ""), around)
    return _search(situation, side)


def side_of(move: Move) -> str:
    """Returns the side to which a move leads: left, right, around, or none."""
    direction = move.action.get("direction")
    if move.action.get("tool") == "fly":
        bearing = math.remainder(float(str(move.action["bearing"])), 360.0)
        fits = (side for side, to in _SIDES.items() if _apart(bearing, to) <= 45.0)
        return next(fits, "")
    return {"left": "left", "right": "right", "back": "around"}.get(str(direction), "")


def _first_hard(progress: FlightProgress) -> int:
    steps = progress.pending
    return next((i for i, step in enumerate(steps) if step.leg.hard), len(steps))


def _to_height(situation: FlightSituation, leg: Leg) -> Move:
    height = situation.height
    why = f"{leg.kind} from {height:.0f} m to {leg.height:.0f} m"
    return turn(DOWN, BELOW, height, 0.0, why, leg.height - height)


def _chosen(
    situation: FlightSituation, leg: Leg, side: str, *, ahead: bool = False
) -> LandmarkSight | None:
    """Returns the thing of a leg to fly to: the nearest, on the side that the plan says.

    One that was flown to in vain from here comes later; a thing straight below is no way along.
    """
    found = []
    goal = situation.stated()
    for i, sight in enumerate(situation.meant(leg)):
        if ahead and sight.direction == DOWN:
            continue
        cost = -sight.distance if ahead else sight.away
        if side and _apart(sight.bearing, _SIDES[side]) > 60.0:
            cost += 40.0
        if ahead and not side:
            cost += 0.5 * abs(sight.bearing)
        if leg.side and math.copysign(1.0, sight.bearing) != (1 if leg.side == "left" else -1):
            cost += 10.0
        if goal is not None:
            cost += _OFF_WAY * _apart(sight.bearing, goal[1])
        cost += situation.tried(sight.direction)
        if situation.tried(sight.direction) >= 2 * _FAILED:
            continue
        found.append((round(cost, 3), i, sight))
    return min(found)[2] if found else None


def _to_sight(situation: FlightSituation, leg: Leg, sight: LandmarkSight) -> Move:
    """Flies to a thing; straight above the end of the flight it goes down."""
    climb: float | None = None
    why = f"the {sight.name} is in the {sight.direction} view ({sight.id})"
    if sight.direction == DOWN and not (leg.kind in ("go", "stop") and sight.below):
        climb = 0.0
    failed = situation.variables.outcome.startswith("failed")
    if sight.direction != DOWN and failed and situation.tried(sight.direction) >= _FAILED:
        climb = 10.0
        why += "; higher, because the way was not free"
    return turn(sight.direction, sight.name, sight.distance, sight.bearing, why, climb)


def _look_lower(situation: FlightSituation, leg: Leg) -> Move:
    """Goes down to half the height: what lies between the level views and the one below shows."""
    why = f"the {leg.thing} was in view on the way here: look from lower"
    return turn(DOWN, BELOW, situation.height, 0.0, why, -situation.height / 2.0)


def _by_numbers(situation: FlightSituation, side: str) -> Move:
    """Answers the direction block: towards the stated place, the side of the plan, or free air."""
    note = situation.variables.bearings
    assert note is not None
    free = situation.scene.free
    if note.goal_distance is not None and note.goal_distance > 2.0:
        bearing, wanted = note.goal_bearing, note.goal_distance
        why = f"the task states its goal {wanted:.0f} m away"
    elif side:
        bearing, wanted, why = _SIDES[side], _STRIDE, f"the plan turns {side}"
    else:
        best = max(DIRECTIONS, key=lambda d: free.get(d, 0.0) - situation.tried(d))
        bearing, wanted = math.degrees(VIEW_YAW[best]), _STRIDE
        why = f"the {best} view is free for {free.get(best, 0.0):.0f} m"
    nearest = min(DIRECTIONS, key=lambda d: _apart(bearing, math.degrees(VIEW_YAW[d])))
    room = free.get(nearest, 0.0) - _MARGIN
    distance = round(max(min(room, wanted, _STRIDE), 0.0), 1)
    climb = 0.0 if distance >= 5.0 else 10.0
    distance = distance if distance >= 5.0 else 0.0
    action: dict[str, object] = {
        "tool": "fly", "bearing": round(bearing, 1), "distance": distance, "climb": climb,
    }  # fmt: skip
    return Move(action, f"nothing could be marked; {why}")


def _remembered(situation: FlightSituation, leg: Leg | None) -> Move | None:
    """Goes back to a place whose caption names the landmark, once."""
    variables = situation.variables
    if leg is None or not leg.landmark or not variables.second_chance:
        return None
    for note in reversed(variables.waypoints):
        again = any(f"backtrack {note.id}:" in d.text for d in variables.decisions)
        names = [name.strip() for name in note.caption.partition("sees ")[2].split(",")]
        if note.offered and not again and note.distance > _STRIDE and leg.thing in names:
            action: dict[str, object] = {"tool": "backtrack", "waypoint": note.id}
            return Move(action, f"the {leg.thing} was seen from waypoint {note.id}")
    return None


def _search(situation: FlightSituation, side: str) -> Move:
    """Climbs to a lookout, then follows what the plan says of the direction, else the free air."""
    scene = situation.scene
    if scene.height < LOOKOUT - LEVEL and situation.tried(DOWN) < _FAILED:
        why = f"nothing of it is in view from {scene.height:.0f} m: look from higher up"
        return turn(DOWN, BELOW, scene.height, 0.0, why, LOOKOUT - scene.height)
    stated = situation.stated()
    goal = stated[1] if stated is not None else _SIDES[side] if side else None
    # Around the stated place its direction tells ever less, and where one was ever more.
    near = max(1.0 - stated[0] / _AROUND, 0.0) if stated is not None else float(goal is None)

    def worth(direction: str) -> float:
        axis = math.degrees(VIEW_YAW[direction])
        value = scene.free.get(direction, 0.0) - situation.tried(direction)
        value += _PROMISE * min(len(_landmarks(situation, direction)), 5)
        if goal is not None:
            value -= (1.0 - near) * _apart(axis, goal)
        return value - min(2.0 * near, 1.0) * _visited(situation, axis)

    best = max(DIRECTIONS, key=lambda d: (round(worth(d), 3), -DIRECTIONS.index(d)))
    bearing = math.degrees(VIEW_YAW[best])
    if goal is not None and _apart(goal, bearing) <= 40.0:
        bearing = goal
    reach = min(scene.free.get(best, 0.0), _STRIDE)
    why = f"nothing of it is in view; the {best} view leads on"
    return turn(best, OPEN_GROUND, reach, bearing, why, None)


def _landmarks(situation: FlightSituation, direction: str) -> set[str]:
    """Returns the names of what stands or leads somewhere in a view."""
    sights = (s for s in situation.scene.sights if s.direction == direction)
    return {s.name for s in sights if s.category not in GROUND or s.category in WAYS}


def _visited(situation: FlightSituation, axis: float) -> float:
    """Returns what the places where the aircraft was speak against a direction, metres."""
    here = situation.here
    near = (w for w in situation.variables.waypoints if w is not here and w.distance < _NEAR_PLACE)
    return min(sum(_BACK for w in near if _apart(axis, w.bearing) <= 45.0), 4 * _BACK)


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, 360.0))
