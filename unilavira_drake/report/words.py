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
    return f"{words}." if left is None else f"{words}, {left:.1f} m from what was aimed at."
