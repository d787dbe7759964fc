"""Which legs of the plan the present evidence closes, each with what shows it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from unilavira_drake.messages import DOWN
from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.situation import FAILED, LEVEL, FlightSituation, FlightStep

NEAR_GOAL = 45.0
"""So near to a stated place what was on the way to it no longer matters, metres."""
NEXT = 40.0
"""So near to the next landmark the one before it no longer matters, metres."""
ARRIVED = 20.0
"""So near to a stated place the search for the landmark itself begins, metres."""


@dataclass(frozen=True)
class FlightProgress:
    """What changed, and what is left."""

    closed: tuple[tuple[FlightStep, str], ...]
    moot: tuple[FlightStep, ...]
    pending: tuple[FlightStep, ...]


def review_flight(situation: FlightSituation) -> FlightProgress:
    """Closes every pending leg whose condition is met, in order.

    A hard leg waits for those before it; a soft one (turn, along, heading) blocks none and becomes
    moot when a later one is done.
    """
    closed: list[tuple[FlightStep, str]] = []
    moot: list[FlightStep] = []
    waiting: list[FlightStep] = []
    blocked = False
    for step in situation.pending:
        evidence = "" if blocked else _met(step, situation)
        if not evidence and not blocked and _left_behind(step, situation):
            moot.append(step)
            continue
        if not evidence:
            waiting.append(step)
            blocked = blocked or step.leg.hard
            continue
        closed.append((step, evidence))
        if step.leg.landmark and step.leg.hard:
            moot += waiting
            waiting = []
    return FlightProgress(tuple(closed), tuple(moot), tuple(waiting))


def _left_behind(step: FlightStep, situation: FlightSituation) -> bool:
    """Whether a landmark on the way need not be looked for any more.

    It is out of sight, and the next one is near, or the stated place of the goal is.
    """
    after = next_landmark(step, situation.steps)
    if not _ends_at_landmark(step.leg) or after is None or situation.meant(step.leg):
        return False
    stated = situation.stated()
    if stated is not None and stated[0] <= NEAR_GOAL:
        return True
    return any(sight.distance <= NEXT for sight in situation.meant(after))


def next_landmark(step: FlightStep, steps: tuple[FlightStep, ...]) -> Leg | None:
    """Returns the first leg after a step that ends at a landmark."""
    return next((s.leg for s in steps if s.index > step.index and _ends_at_landmark(s.leg)), None)


def _ends_at_landmark(leg: Leg) -> bool:
    return leg.hard and bool(leg.landmark)


def _met(step: FlightStep, situation: FlightSituation) -> str:
    """Returns the evidence that a leg is done, or nothing."""
    leg, height = step.leg, situation.height
    if leg.kind == "climb":
        if situation.tried(DOWN) >= FAILED:
            return "it cannot rise any more here"
        return f"{height:.0f} m above the ground" if height >= leg.height - LEVEL else ""
    if leg.kind == "descend":
        return f"{height:.0f} m above the ground" if height <= leg.height + LEVEL else ""
    if leg.kind == "turn":
        return ""
    if leg.kind in ("heading", "along"):
        return _way_done(step, situation)
    sight = situation.reached(leg)
    return f"{sight.name} at {sight.away:.0f} m ({sight.id})" if sight else ""


def _way_done(step: FlightStep, situation: FlightSituation) -> str:
    """A way is done when the landmark at its end is seen, or nothing is to come after it."""
    after = next_landmark(step, situation.steps)
    seen = situation.meant(after) if after is not None else []
    if seen:
        return f"{seen[0].name} in view ({seen[0].id})"
    if step.leg.kind == "heading":
        stated = situation.stated()
        return "the stated place is here" if stated and stated[0] <= ARRIVED else ""
    last = situation.variables.last_action
    along = f" to '{dataclasses.replace(step.leg, color='').landmark}" in last
    return f"{step.leg.landmark} flown along" if after is None and along else ""
