"""When to take stairs, and which way; what is out of reach of a robot that takes none."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import climbed
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.vocabulary import STAIRS

_SEARCHED = 3
"""Rooms that are looked at on a floor before another floor is tried without being told."""
_LULL = 8
"""After this many places without a new kind of room a floor is given up, where no other is left."""


@dataclass(frozen=True)
class StairChoice:
    """Stairs in view that lead on."""

    stair: str
    """``up`` or ``down``."""
    direction: str
    """The view that shows them."""
    why: str


def stairs_to_take(situation: Situation, goal: Clause | None) -> StairChoice | None:
    """Returns the stairs to take now, or None.

    They are taken when the next step says so; or when the goal is not in view, was not found in the
    rooms of this floor, and no other floor has been searched yet.
    """
    if not situation.variables.can_climb or goal is None:
        return None
    seen = [s for s in situation.scene.things if s.category == STAIRS]
    if not seen:
        return None
    told = goal.kind == "climb"
    if not told and not _searched(situation, goal):
        return None
    for stair in (goal.side,) if told else ("up", "down"):
        if not _failed_here(situation, stair):
            largest = max(seen, key=lambda s: (s.pixels, s.id))
            why = f"Next: go {stair}stairs." if told else f"Not found here: look {stair}stairs."
            why += f" The {largest.direction} view shows the stairs ({largest.id})."
            return StairChoice(stair, largest.direction, why)
    return None


def out_of_reach(situation: Situation, goal: Clause | None) -> str:
    """Returns why a robot that is told it takes no stairs gives up, or nothing.

    The next step takes stairs; or its goal is not in view, and the latest places that it
    remembers are in kinds of rooms that it knew before.  A room that was not entered may be left.
    """
    if not situation.variables.stairs_barred or goal is None:
        return ""
    if goal.kind == "climb":
        return f"The next step is to go {goal.side}stairs, and this robot cannot take stairs."
    searches = bool(goal.category or goal.room) and goal.kind != "leave"
    if not searches or situation.scene.matching(goal) or not _nothing_new(situation):
        return ""
    what = goal.thing or goal.room
    return (
        f"No {what} was seen so far, the latest places brought no new kind of room, "
        "and this robot cannot take stairs."
    )


def _nothing_new(situation: Situation) -> bool:
    """Whether the newest of the places that are remembered lie in kinds of rooms known before."""
    rooms = [place.room for place in situation.visited if place.room]
    return len(rooms) > _LULL and set(rooms[-_LULL:]) <= set(rooms[:-_LULL])


def _searched(situation: Situation, goal: Clause) -> bool:
    """Whether this floor was looked at and no other one was."""
    decisions = situation.variables.decisions
    if any(climbed(note.text) for note in decisions) or situation.scene.matching(goal):
        return False
    if not (goal.category or goal.room):
        return False
    rooms = {place.room for place in situation.visited if place.room}
    return len(rooms) > _SEARCHED


def _failed_here(situation: Situation, stair: str) -> bool:
    here = f"at waypoint {situation.variables.current_waypoint}:"
    return any(
        note.text.startswith(here) and f"go_stair {stair}: failed" in note.text
        for note in situation.variables.decisions
    )
