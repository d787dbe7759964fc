"""The direction-constrained module (paper V): what to reason on where vision could not ground."""

from __future__ import annotations

import math

from unilavira_drake.messages import NO_TARGET, History, LanguageAction, Panorama
from unilavira_drake.mllm.request import DirectionNote
from unilavira_drake.stated_direction import stated_direction


def direction_note(
    task: str, last_action: LanguageAction, panorama: Panorama, history: History
) -> DirectionNote | None:
    """Returns the facts for a decision by numbers, or None where vision did its part.

    They are given in flight only, and exactly when the last ``turn`` failed because nothing in its
    view could be marked, or no place lies behind the mark.  Start and present pose come from the
    pose estimate; the direction of the goal comes from the task's own words, if they state one.
    """
    outcome = panorama.outcome
    grounded = outcome.state != "failed" or not outcome.reason.startswith(NO_TARGET)
    if not panorama.in_flight or last_action.tool != "turn" or grounded or not history.waypoints:
        return None
    start = history.waypoints[0]
    x, y, z = (a - b for a, b in zip(panorama.position, start.position, strict=True))
    c, s = math.cos(start.heading), math.sin(start.heading)
    here = (c * x + s * y, c * y - s * x)
    yaw = _degrees(panorama.yaw - start.heading)
    now = (round(here[0], 1), round(here[1], 1), round(z, 1), yaw)
    stated = stated_direction(task)
    if stated is None:
        return DirectionNote(now)
    angle = math.radians(stated.bearing)
    ahead = stated.distance * math.cos(angle) - here[0]
    left = stated.distance * math.sin(angle) - here[1]
    return DirectionNote(
        now,
        goal_distance=round(math.hypot(ahead, left), 1),
        goal_bearing=_degrees(math.atan2(left, ahead) - (panorama.yaw - start.heading)),
    )


def _degrees(angle: float) -> float:
    return round(math.degrees(math.remainder(angle, 2 * math.pi)), 1)
