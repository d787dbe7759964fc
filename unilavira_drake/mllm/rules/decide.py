"""One decision: close what is met, then go on, go back, or ask for the final check."""

from __future__ import annotations

import dataclasses
from typing import Any

from unilavira_drake.mllm.rules.aim import Aim, aim_of, in_sector
from unilavira_drake.mllm.rules.clauses import describe
from unilavira_drake.mllm.rules.lexicon import unused_words
from unilavira_drake.mllm.rules.memory import (
    Place,
    is_hub,
    open_ends,
    remembers,
    scene_sentence,
)
from unilavira_drake.mllm.rules.option import Option
from unilavira_drake.mllm.rules.options import options
from unilavira_drake.mllm.rules.plan import Step
from unilavira_drake.mllm.rules.progress import Progress, review
from unilavira_drake.mllm.rules.situation import Situation
from unilavira_drake.mllm.rules.stairs import out_of_reach, stairs_to_take

_RETURN = 6.0
"""What a backtrack costs beside its length, in metres of detour."""


def decide(situation: Situation) -> dict[str, Any]:
    """Returns the reply to ``decide`` or ``recover``."""
    progress = _reopened(situation, review(situation))
    updates = [_completed(step, evidence) for step, evidence in progress.closed]
    updates += [{"op": "remove", "index": step.index} for step in progress.moot]
    reply = {
        "progress_analysis": _analysis(situation, progress),
        "reasoning_todo": _todo_words(progress),
        "todo_updates": updates,
        "reasoning_action": "",
        "action": {"tool": "double_check"},
        "scene": _scene(situation),
    }
    if all(step.clause.kind in ("turn", "straight") for step in progress.pending):
        # All views are in sight anyway: a turn that nothing follows moves nothing.
        updates += [{"op": "remove", "index": step.index} for step in progress.pending]
        reply["reasoning_action"] = (
            "Every step is done and the target is here: check and stop."
            if progress.steps
            else "No step of the task was understood; nothing can be done."
        )
        return _without_list(reply, situation)
    reopened = [s for s in progress.pending if _was_done(s, situation)]
    updates += [
        {"op": "update", "index": s.index, "status": "pending", "result": "not in reach after all"}
        for s in reopened
    ]
    aim = aim_of(progress.steps, situation.scene.room)
    if why := out_of_reach(situation, aim.goal):
        reply["reasoning_action"] = f"{why} Give up: check and stop."
        return _without_list(reply, situation)
    flight = stairs_to_take(situation, aim.goal)
    if flight is not None:
        reply["action"] = {"tool": "go_stair", "stair": flight.stair, "direction": flight.direction}
        reply["reasoning_action"] = flight.why
        return _without_list(reply, situation)
    ranked = options(situation, aim)
    place = _way_back(situation, aim, ranked)
    if place is not None:
        reply["action"] = {"tool": "backtrack", "waypoint": place.id}
        reply["reasoning_action"] = (
            f"Nothing new leads on from the {situation.scene.room or 'present place'}; waypoint "
            f"{place.id} ({place.room or 'earlier place'}, {place.distance:.1f} m) has ways left."
        )
    elif ranked:
        reply["action"] = {"tool": "turn", "direction": ranked[0].direction}
        reply["reasoning_action"] = _reason(ranked[0], aim)
        updates += _turn_taken(aim.turn, ranked[0])
    else:
        blind = "left" if situation.variables.failed_direction == "back" else "back"
        reply["action"] = {"tool": "turn", "direction": blind}
        reply["reasoning_action"] = "Nothing is in view that leads on: look elsewhere."
    return _without_list(reply, situation)


def _was_done(step: Step, situation: Situation) -> bool:
    return any(s.index == step.index and s.done for s in situation.steps)


def _reopened(situation: Situation, progress: Progress) -> Progress:
    """Sets the last step back to pending when a check was rejected and it is not met now."""
    last = progress.steps[-1] if progress.steps else None
    if not situation.variables.rejection or progress.pending or last is None:
        return progress
    if not last.clause.category or situation.reached(last.clause):
        return progress
    steps = (*progress.steps[:-1], dataclasses.replace(last, done=False))
    return dataclasses.replace(progress, steps=steps)


def _completed(step: Step, evidence: str) -> dict[str, Any]:
    return {"op": "update", "index": step.index, "status": "completed", "result": evidence}


def _turn_taken(turn: Step | None, option: Option) -> list[dict[str, Any]]:
    """Closes a turn with the move that takes it; drops it when the way leads elsewhere."""
    if turn is None:
        return []
    if in_sector(turn.clause, option.bearing) and option.cites:
        way = f"the {option.direction} view leads that way ({option.cites})"
        return [_completed(turn, way)]
    if option.cost < -50.0:
        return [{"op": "remove", "index": turn.index}]
    return []


def _reason(option: Option, aim: Aim) -> str:
    goal = describe(aim.goal) if aim.goal else "finish the last step"
    return f"Next: {goal}. Chosen: {option.why}. {option.order}"


def _way_back(situation: Situation, aim: Aim, ranked: list[Option]) -> Place | None:
    """Returns the waypoint to drive back to, when that is better than every way on."""
    variables = situation.variables
    if not variables.second_chance:
        return None
    best = ranked[0].cost if ranked else 100.0
    goal = aim.goal
    offers = [p for p in situation.places if p.offered and p.id != variables.current_waypoint]
    costs = []
    for place in offers:
        if _was_refused(place, situation):
            continue
        before = sum(f"backtrack {place.id}:" in note.text for note in variables.decisions)
        cost = _RETURN + 0.3 * place.distance + 3.0 * before
        if goal is not None and goal.category and remembers(place, goal) and not place.tried:
            cost -= 10.0
        elif not _leads_on(place, situation):
            continue
        costs.append((round(cost, 3), -place.id, place))
    if not costs or min(costs)[0] >= best:
        return None
    return min(costs)[2]


def _was_refused(place: Place, situation: Situation) -> bool:
    """Whether driving back to a place has failed from where the robot stands."""
    here = f"at waypoint {situation.variables.current_waypoint}:"
    return any(
        note.text.startswith(here) and f"backtrack {place.id}: failed" in note.text
        for note in situation.variables.decisions
    )


def _leads_on(place: Place, situation: Situation) -> bool:
    """Whether new ways may start at a place; from a corridor only another corridor does better."""
    here = situation.scene.room
    if place.room == here or (is_hub(here) and not is_hub(place.room)):
        return False
    return is_hub(place.room) or open_ends(place, situation.visited) > 0


def _analysis(situation: Situation, progress: Progress) -> str:
    done = sum(step.done for step in progress.steps)
    text = f"In the {situation.scene.room or 'unknown room'}; {done} of {len(progress.steps)} "
    text += "steps done."
    if situation.variables.outcome.startswith("failed"):
        text += f" The last move {situation.variables.outcome}."
    if situation.variables.rejection:
        text += f" The check was rejected: {situation.variables.rejection}."
    if situation.variables.current_waypoint <= 1 and len(situation.variables.decisions) <= 1:
        unused = unused_words(situation.variables.task)
        text += f" Words not used: {', '.join(unused)}." if unused else ""
    return text


def _todo_words(progress: Progress) -> str:
    parts = [f"{describe(step.clause)}: {evidence}" for step, evidence in progress.closed]
    parts += [f"{describe(step.clause)}: no longer matters" for step in progress.moot]
    return "; ".join(parts) or "nothing new is met"


def _scene(situation: Situation) -> str:
    here = situation.variables.current_waypoint
    note = next((w for w in situation.variables.waypoints if w.id == here), None)
    return scene_sentence(situation.scene, note.heading if note else 0.0)


def _without_list(reply: dict[str, Any], situation: Situation) -> dict[str, Any]:
    if situation.variables.todo is None:
        reply["todo_updates"] = []
    return reply
