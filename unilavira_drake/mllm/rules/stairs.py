"""When to take stairs, and which way."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import climbed
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.vocabulary import STAIRS

_SEARCHED = 3
"""Rooms that are looked at on a floor before another floor is tried without being told."""


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
