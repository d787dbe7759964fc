"""The final check and the answer to a question, from the present evidence only."""

from __future__ import annotations

import re
from typing import Any

from unilavira_drake.answer_words import chosen
from unilavira_drake.mllm.rules.aim import aim_of
from unilavira_drake.mllm.rules.clauses import Clause, describe
from unilavira_drake.mllm.rules.lexicon import tokenize
from unilavira_drake.mllm.rules.progress import review
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.stairs import out_of_reach

UNKNOWN = "unknown"


def double_check(situation: Situation) -> dict[str, Any]:
    """Returns the verdict: confirmed only if every step is done and the last target is here."""
    # Without a TODO list nothing tells which steps the last decision closed: look again.
    listed = situation.variables.todo is not None
    open_steps = situation.pending if listed else review(situation).pending
    if why := out_of_reach(situation, aim_of(review(situation).steps, situation.scene.room).goal):
        return {"reasoning": why, "confirmed": True, "reason": f"Not done, given up: {why}"}
    if open_steps:
        reason = f"not done: {describe(open_steps[0].clause)}"
        return {"reasoning": reason, "confirmed": False, "reason": reason}
    last = situation.steps[-1].clause if situation.steps else None
    if last is None:
        reason = "no step of the task was understood, so nothing shows that it is done"
        return {"reasoning": reason, "confirmed": False, "reason": reason}
    if last.category and last.kind in ("go", "stop"):
        sight = situation.reached(last)
        if sight is None:
            reason = f"not beside the {last.thing}"
            return {"reasoning": reason, "confirmed": False, "reason": reason}
        return _confirmed(f"{sight.name} at {sight.near:.1f} m", sight.id)
    if last.kind in ("enter", "through", "along") and situation.scene.room != last.room:
        reason = f"the floor underfoot is that of the {situation.scene.room or 'unknown room'}"
        return {"reasoning": reason, "confirmed": False, "reason": f"not in the {last.room}"}
    return _confirmed(f"in the {situation.scene.room}", situation.scene.room_id)


def answer(situation: Situation) -> dict[str, Any]:
    """Returns the answer to the task's question: a colour, a room, a count, yes, or ``unknown``.

    Of a closed vocabulary that has none of these, it gives the first word.
    """
    reply = _answer(situation)
    choices = situation.variables.choices
    if choices and not chosen(reply["answer"], choices):
        reply["answer"] = choices[0]
    return reply


def _answer(situation: Situation) -> dict[str, Any]:
    question = situation.variables.task.lower()
    asked = [s.clause for s in situation.steps if s.clause.category]
    thing = asked[-1] if asked else _asked_thing(question)
    seen = situation.scene.matching(thing) if thing else []
    if not seen:
        reason = "the thing asked about is not in view"
        return {"reasoning": reason, "evidence": [], "answer": UNKNOWN}
    shown = f"{seen[0].name} at {seen[0].near:.1f} m ({seen[0].id})"
    view, found = seen[0].direction, UNKNOWN
    if re.search(r"\bcolou?r\b", question):
        found = seen[0].color or UNKNOWN
    elif re.search(r"\bhow many\b", question):
        views = [s.direction for s in seen]
        view = max(views, key=views.count)
        shown, found = f"most in one view; {shown}", str(views.count(view))
    elif re.search(r"\b(where|room)\b", question):
        found = situation.scene.room or UNKNOWN
    elif re.match(r"(is|are|do|does|can)\b", question):
        found = "yes"
    return {"reasoning": shown, "evidence": [view], "answer": found}


def _asked_thing(question: str) -> Clause | None:
    things = [t.value for t in tokenize(question) if t.kind == "thing" and t.value != "door"]
    return Clause("go", things[0]) if things else None


def _confirmed(shown: str, sight_id: str) -> dict[str, Any]:
    return {"reasoning": f"{shown} ({sight_id})", "confirmed": True, "reason": ""}
