"""The replies of ``rules`` to the language calls in flight."""

from __future__ import annotations

from typing import Any

from unilavira_drake.mllm.rules.flight.legs import describe
from unilavira_drake.mllm.rules.flight.moves import Move, next_move, side_of
from unilavira_drake.mllm.rules.flight.parser import plan_legs
from unilavira_drake.mllm.rules.flight.progress import FlightProgress, review_flight
from unilavira_drake.mllm.rules.flight.situation import FlightSituation

NOTHING_UNDERSTOOD = "No leg of the directive was understood"
SCENE_LIMIT = 100
"""Characters of a scene sentence."""


def plan_flight(situation: FlightSituation) -> dict[str, Any]:
    """Returns the reply to ``plan_todo``."""
    legs = plan_legs(situation.variables.task, situation.scene.height)
    return {
        "reasoning": f"{len(legs)} legs found in the text.",
        "todo": [describe(leg) for leg in legs] or [NOTHING_UNDERSTOOD],
    }


def decide_flight(situation: FlightSituation) -> dict[str, Any]:
    """Returns the reply to ``decide`` or ``recover``."""
    progress = review_flight(situation)
    updates: list[dict[str, Any]] = [
        {"op": "update", "index": step.index, "status": "completed", "result": evidence}
        for step, evidence in progress.closed
    ]
    updates += [{"op": "remove", "index": step.index} for step in progress.moot]
    if any(step.leg.hard for step in progress.pending) or _way_left(progress):
        move = _allowed(next_move(situation, progress), situation)
        updates += _turns_taken(progress, move)
    else:
        move = Move({"tool": "double_check"}, "every leg is flown: check and stop")
        updates += [{"op": "remove", "index": step.index} for step in progress.pending]
    return {
        "progress_analysis": _analysis(situation, progress),
        "reasoning_todo": _todo_words(progress),
        "todo_updates": [] if situation.variables.todo is None else updates,
        "reasoning_action": f"{_next_words(progress)}{move.why}. {move.order}".strip(),
        "action": move.action,
        "scene": _scene(situation),
    }


def check_flight(situation: FlightSituation) -> dict[str, Any]:
    """Returns the verdict: confirmed only if all legs are flown and the last landmark is here."""
    listed = situation.variables.todo is not None
    pending = situation.pending if listed else review_flight(situation).pending
    if pending:
        return _rejected(f"not done: {describe(pending[0].leg)}")
    last = next((s.leg for s in reversed(situation.steps) if s.leg.landmark), None)
    if not situation.steps:
        return _rejected("no leg of the directive was understood, so nothing shows that it is done")
    if last is None:
        shown = f"{situation.scene.height:.0f} m above the ground"
        return {"reasoning": shown, "confirmed": True, "reason": shown}
    sight = situation.reached(last)
    if sight is None:
        return _rejected(f"not at the {last.thing}")
    shown = f"{sight.name} at {sight.away:.0f} m ({sight.id})"
    return {"reasoning": shown, "confirmed": True, "reason": shown}


def _rejected(reason: str) -> dict[str, Any]:
    return {"reasoning": reason, "confirmed": False, "reason": reason}


def _way_left(progress: FlightProgress) -> bool:
    """Whether a way is still to be flown that no landmark ends; a mere turn moves nothing."""
    return any(step.leg.kind in ("along", "heading") for step in progress.pending)


def _turns_taken(progress: FlightProgress, move: Move) -> list[dict[str, Any]]:
    """Closes a turn that the plan has now with the move that takes it."""
    for step in progress.pending:
        if step.leg.hard:
            break
        if step.leg.kind == "turn" and step.leg.side == side_of(move):
            way = f"the way to the {step.leg.side} is taken: {move.why}"
            return [
                {"op": "update", "index": step.index, "status": "completed", "result": way[:300]}
            ]
    return []


def _allowed(move: Move, situation: FlightSituation) -> Move:
    """Returns the move, or the freest other view where it names the direction that has failed."""
    failed = situation.variables.failed_direction
    if not failed or move.action.get("direction") != failed:
        return move
    free = situation.scene.free
    others = [d for d in ("front", "left", "right", "back") if d != failed]
    best = max(others, key=lambda d: free.get(d, 0.0))
    order = f"Target: open ground, about 20.0 m, 0 deg left of the {best} view's axis."
    action: dict[str, object] = {"tool": "turn", "direction": best, "climb": None}
    return Move(action, f"the {failed} view has failed from here", order)


def _analysis(situation: FlightSituation, progress: FlightProgress) -> str:
    done = len(situation.steps) - len(progress.pending)
    ground = situation.scene.ground or "unknown ground"
    text = f"{situation.height:.0f} m above the {ground}; {done} of {len(situation.steps)} "
    text += "legs done."
    if situation.variables.outcome.startswith("failed"):
        text += f" The last move {situation.variables.outcome}."
    if situation.variables.rejection:
        text += f" The check was rejected: {situation.variables.rejection}."
    return text


def _todo_words(progress: FlightProgress) -> str:
    parts = [f"{describe(step.leg)}: {evidence}" for step, evidence in progress.closed]
    parts += [f"{describe(step.leg)}: no longer matters" for step in progress.moot]
    return "; ".join(parts) or "nothing new is done"


def _next_words(progress: FlightProgress) -> str:
    return f"Next: {describe(progress.pending[0].leg)}. Chosen: " if progress.pending else ""


def _scene(situation: FlightSituation) -> str:
    text = f"Above the {situation.scene.ground or 'ground'} at {situation.height:.0f} m"
    names = dict.fromkeys(s.name for s in sorted(situation.scene.sights, key=lambda s: s.away))
    for i, name in enumerate(names):
        extended = text + ("; sees " if i == 0 else ", ") + name
        if len(extended) > SCENE_LIMIT:
            break
        text = extended
    return text
