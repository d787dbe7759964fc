"""What the page says about a step, in words."""

from __future__ import annotations

from unilavira_drake.messages import ON_THE_WAY
from unilavira_drake.report.model import Step

_TOOLS = {
    "turn": "turn",
    "double_check": "propose to stop",
    "stay": "stay",
    "stop": "stop",
    "none": "no usable action",
}
_REASONING = (
    ("progress_analysis", "Progress"),
    ("reasoning_todo", "About the list"),
    ("reasoning_action", "About the action"),
    ("scene", "Scene"),
    ("reason", "Reason"),
    ("answer", "Answer"),
    ("evidence", "Seen in"),
)

LEAST_TRAVEL = 0.05
"""Metres that are told; below, it is the sway of a robot that stands."""
_LEAST_CLIMB = 0.5
"""Metres of height that are told."""
_LEAST_AFTER = 0.5
"""Metres; twice the travel between two points of the record."""
_PURE = 0.9
"""The share of a way from which on it is one of height alone."""


def action_words(step: Step) -> str:
    """Returns what was decided, e.g. ``turn left``."""
    action = step.action
    if action is None:
        return "no action recorded"
    if action.tool == "turn":
        return f"turn {action.argument}"
    if action.tool == "fly":
        return f"fly {action.argument}"
    if action.tool == "backtrack":
        return f"drive back to waypoint {action.waypoint}"
    if action.tool == "go_stair":
        return f"take the stairs {action.stair}"
    if action.call == "plan_todo" and action.tool == "stay":
        return "write the plan"
    if action.confirmed is not None and action.tool == "stay":
        return "stop confirmed, answer" if action.confirmed else "stop rejected"
    return _TOOLS.get(action.tool, action.tool)


def step_badges(step: Step) -> tuple[tuple[str, str], ...]:
    """Returns what is unusual about a step: ``bad``, ``warn``, ``good`` or ``note``, and words."""
    badges = []
    if step.call == "recover":
        badges.append(("warn", "recover"))
    if step.reasks:
        badges.append(("warn", "asked again" if step.reasks == 1 else f"re-asked {step.reasks}×"))
    if step.fallback:
        badges.append(("bad", "fallback"))
    if any(attempt.reply is not None and attempt.reply.error for attempt in step.attempts):
        badges.append(("bad", "model error"))
    if step.grounding is not None and step.grounding.doubt:
        refined = step.grounding.refined
        badges.append(("note", "mark refined") if refined else ("warn", "mark doubted"))
    if step.feedback:
        badges.append(("warn", "list refused"))
    done = sum(change.kind == "completed" for change in step.changes or ())
    if done:
        badges.append(("good", f"{done} done"))
    if step.status is not None and step.status.state == "failed":
        badges.append(("bad", "failed"))
    return tuple(badges)


def reasoning(step: Step) -> tuple[tuple[str, str, str], ...]:
    """Returns the fields in which the model reasoned: field, title and text."""
    if step.action is None:
        return ()
    found = []
    for name, title in _REASONING:
        value = getattr(step.action, name)
        text = value if isinstance(value, str) else ", ".join(value)
        if text:
            found.append((name, title, text))
    return tuple(found)


def outcome_words(step: Step) -> str:
    """Returns how the action ended."""
    if step.action is not None and step.action.tool == "stop":
        return "The agent ends the episode here."
    if step.status is None:
        if step.action is None:
            return "The record ends before there was an action."
        return "The record ends before this action did."
    if step.status.state == "failed":
        return f"Failed: {step.status.reason or 'without a reason'}."
    if step.goal is not None and step.goal.kind == "stay":
        return "Nothing to drive: the next call sees the same panorama."
    words = "Arrived" + (f": {step.status.reason}" if step.status.reason else "")
    if step.status.reason == ON_THE_WAY:
        words = ON_THE_WAY.capitalize()
    left = step.status.remaining
    return f"{words}." if left is None else f"{words}, {_left_words(left, step.status.height)}."


def travel_words(seconds: float, travel: float, after: float, climb: float) -> str:
    """Returns how long an action took and how far it led; empty where it led nowhere.

    Args:
        seconds: from the decision to the arrival.
        travel: metres from the decision to the next one.
        after: metres of ``travel`` that lie after the arrival.
        climb: metres that it led up, negative down.
    """
    if travel < LEAST_TRAVEL:
        return ""
    words = f"It took {seconds:.1f} s and {travel:.1f} m"
    if abs(climb) >= max(_LEAST_CLIMB, _PURE * travel):
        words += f": it {'climbed' if climb > 0 else 'descended'} {abs(climb):.1f} m"
    elif abs(climb) >= _LEAST_CLIMB:
        words += f", {abs(climb):.1f} m {'up' if climb > 0 else 'down'}"
    if after >= _LEAST_AFTER:
        words += f"; the last {after:.1f} m came after that, until it stood"
    return f"{words}."


def _left_words(left: float, height: float | None) -> str:
    """Returns how far away, and how much above or below, the robot is from its aim.

    Args:
        left: metres, straight.
        height: how much higher than the robot the aim is; None on the ground.
    """
    if height is None or abs(height) < _LEAST_CLIMB:
        return f"{left:.1f} m from what was aimed at"
    side = "above" if height < 0 else "below"
    if abs(height) >= _PURE * left:
        return f"{abs(height):.1f} m {side} what was aimed at"
    return f"{left:.1f} m from what was aimed at, {abs(height):.1f} m {side} it"
