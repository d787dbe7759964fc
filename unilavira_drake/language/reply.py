"""What a reply of the language model means (paper III-B1, III-C, III-D)."""

from __future__ import annotations

import dataclasses
from typing import Any

from unilavira_drake.answer_words import chosen
from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import DIRECTIONS, DOWN, LanguageAction, TodoUpdate
from unilavira_drake.mllm.reply_forms import (
    ActionReply,
    AddOp,
    AnswerReply,
    Backtrack,
    FlightReply,
    FlightTurn,
    Fly,
    GoStair,
    PlanReply,
    RemoveOp,
    RewriteOp,
    Turn,
    UpdateOp,
    VerdictReply,
    reply_form,
)
from unilavira_drake.mllm.reply_model import ReplyModel, bounded, clipped
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.tasks import asks

MAX_PLAN_ITEMS = 32
REASONING_LIMIT = 1500
SCENE_LIMIT = 160
CONTENT_LIMIT = 200
RESULT_LIMIT = 300
REASON_LIMIT = 400
ANSWER_LIMIT = 200


def parse_language_reply(text: str, request: MllmRequest) -> LanguageAction:
    """Returns the language action that a reply to this request means.

    ``plan_todo`` becomes ``stay`` with one ``add`` for each item; a confirmed ``double_check``
    becomes ``stop``, or ``stay`` for EQA, where the ``answer`` call follows; a rejected one
    becomes ``stay`` with the reason; an answer becomes ``stop``.  What was forgiven in the text
    stands in ``repairs``.

    Raises:
        ReplyFormatError: if the text has another form, or names a direction, waypoint, stair or
            TODO index that the request does not offer, or an answer outside a closed vocabulary.
            The sentence can go into a re-ask.
    """
    variables = request.variables
    if not isinstance(variables, LanguageVariables):
        raise TypeError(f"request {request.n} of role {request.role!r} has no language variables")
    form = reply_form(request.call, in_flight=variables.in_flight)
    if form is None:
        raise TypeError(f"a reply to the call {request.call!r} has no form")
    reply, repairs = form.read(text)
    action = _action(reply, request, variables)
    return dataclasses.replace(action, repairs=repairs + action.repairs)


def _action(
    reply: ReplyModel, request: MllmRequest, variables: LanguageVariables
) -> LanguageAction:
    if isinstance(reply, PlanReply):
        return _plan(reply, request)
    if isinstance(reply, VerdictReply):
        return _verdict(reply, request, variables)
    if isinstance(reply, AnswerReply):
        return _answer(reply, request, variables)
    assert isinstance(reply, ActionReply | FlightReply)
    return _decision(reply, request, variables)


def _plan(reply: PlanReply, request: MllmRequest) -> LanguageAction:
    if not 1 <= len(reply.todo) <= MAX_PLAN_ITEMS:
        raise ReplyFormatError(
            f"todo has {len(reply.todo)} items; give between 1 and {MAX_PLAN_ITEMS}."
        )
    adds = []
    for number, content in enumerate(reply.todo, start=1):
        line = bounded(content, CONTENT_LIMIT, f"item {number} of todo")
        if not line:
            raise ReplyFormatError(f"item {number} of todo is empty; leave it out or say it.")
        adds.append(TodoUpdate(op="add", content=line))
    return LanguageAction(
        n=request.n,
        call=request.call,
        tool="stay",
        todo_updates=tuple(adds),
        reasoning_todo=clipped(reply.reasoning, REASONING_LIMIT),
    )


def _verdict(
    reply: VerdictReply, request: MllmRequest, variables: LanguageVariables
) -> LanguageAction:
    reason = bounded(reply.reason, REASON_LIMIT, "reason")
    if not reply.confirmed and not reason:
        raise ReplyFormatError("confirmed is false and reason is empty; say what is missing.")
    stops = reply.confirmed and not asks(variables.family)
    return LanguageAction(
        n=request.n,
        call=request.call,
        tool="stop" if stops else "stay",
        progress_analysis=clipped(reply.reasoning, REASONING_LIMIT),
        confirmed=reply.confirmed,
        reason=reason,
    )


def _answer(
    reply: AnswerReply, request: MllmRequest, variables: LanguageVariables
) -> LanguageAction:
    answer = bounded(reply.answer, ANSWER_LIMIT, "answer")
    if not answer:
        raise ReplyFormatError("answer is empty; give the likeliest answer.")
    if variables.choices:
        choice = chosen(answer, variables.choices)
        if not choice:
            raise ReplyFormatError(
                f"answer {answer!r} names none, or several, of the answers that are possible; give "
                f"exactly one of: {', '.join(variables.choices)}."
            )
        answer = choice
    evidence, repairs = _evidence(reply, request)
    return LanguageAction(
        n=request.n,
        call=request.call,
        tool="stop",
        progress_analysis=clipped(reply.reasoning, REASONING_LIMIT),
        answer=answer,
        evidence=evidence,
        repairs=repairs,
    )


def _evidence(reply: AnswerReply, request: MllmRequest) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns the pictures that an answer names, and what was left out of it.

    An answer is worth more than the name of a picture: the words around a name are forgiven, and
    what names none is left out.
    """
    pictures = {name.casefold(): name for name in request.picture_names}
    named: list[str] = []
    repairs = []
    for text in reply.evidence:
        words = (word.strip(".,'\"()") for word in text.partition(":")[0].casefold().split())
        found = [pictures[word] for word in words if word in pictures]
        if len(found) == 1:
            named += found
        else:
            repairs.append(f"evidence {text!r} names no picture of the prompt; it was left out")
    return tuple(dict.fromkeys(named)), tuple(repairs)


def _decision(
    reply: ActionReply | FlightReply, request: MllmRequest, variables: LanguageVariables
) -> LanguageAction:
    updates = tuple(
        _todo_update(op, number, variables) for number, op in enumerate(reply.todo_updates, start=1)
    )
    action = reply.action
    if isinstance(action, Turn | FlightTurn):
        _check_turn(action, request.call, variables)
    elif isinstance(action, Backtrack):
        _check_backtrack(action, variables)
    elif isinstance(action, Fly) and variables.bearings is None:
        raise ReplyFormatError(
            "fly is offered only where nothing could be marked in the last view; use turn."
        )
    elif isinstance(action, GoStair) and not variables.can_climb:
        raise ReplyFormatError(
            "this robot cannot climb; go_stair is not offered, use another tool."
        )
    return LanguageAction(
        n=request.n,
        call=request.call,
        tool=action.tool,
        direction=_direction(action),
        waypoint=action.waypoint if isinstance(action, Backtrack) else None,
        stair=action.stair if isinstance(action, GoStair) else "",
        climb=action.climb if isinstance(action, FlightTurn | Fly) else None,
        bearing=action.bearing if isinstance(action, Fly) else 0.0,
        distance=action.distance if isinstance(action, Fly) else 0.0,
        todo_updates=updates,
        progress_analysis=clipped(reply.progress_analysis, REASONING_LIMIT),
        reasoning_todo=clipped(reply.reasoning_todo, REASONING_LIMIT),
        reasoning_action=clipped(reply.reasoning_action, REASONING_LIMIT),
        scene=clipped(reply.scene, SCENE_LIMIT),
    )


def _direction(action: Any) -> str:
    """Returns the view that an action names, or nothing."""
    if isinstance(action, GoStair):
        return action.direction or ""
    return action.direction if isinstance(action, Turn | FlightTurn) else ""


def _check_turn(action: Turn | FlightTurn, call: str, variables: LanguageVariables) -> None:
    failed = variables.failed_direction
    if call == "recover" and action.direction == failed:
        offered = (*DIRECTIONS, DOWN) if variables.in_flight else DIRECTIONS
        remaining = ", ".join(word for word in offered if word != failed)
        raise ReplyFormatError(
            f"{failed} is the direction that has just failed from here; choose among {remaining}."
        )


def _check_backtrack(action: Backtrack, variables: LanguageVariables) -> None:
    if not variables.second_chance:
        raise ReplyFormatError("backtrack is not offered in this episode; use another tool.")
    offered = [note.id for note in variables.waypoints if note.offered]
    if not offered:
        raise ReplyFormatError("no waypoint may be chosen for backtrack now; use another tool.")
    if action.waypoint not in offered:
        raise ReplyFormatError(
            f"waypoint {action.waypoint} may not be chosen for backtrack; choose among "
            f"{', '.join(map(str, offered))}."
        )


def _todo_update(
    op: UpdateOp | RewriteOp | AddOp | RemoveOp, number: int, variables: LanguageVariables
) -> TodoUpdate:
    place = f"operation {number} of todo_updates"
    if variables.todo is None:
        raise ReplyFormatError("there is no TODO list in this episode; leave todo_updates out.")
    last = len(variables.todo) + (1 if isinstance(op, AddOp) else 0)
    if op.index is not None and not 1 <= op.index <= last:
        raise ReplyFormatError(
            f"{place} ({op.op}) has index {op.index}; the list as shown allows 1 to {last}."
            if last
            else f"{place} ({op.op}) has index {op.index}; the list is empty, only add can be used."
        )
    content = op.content if isinstance(op, RewriteOp | AddOp) else ""
    result = op.result if isinstance(op, UpdateOp) else ""
    return TodoUpdate(
        op=op.op,
        index=op.index,
        content=bounded(content, CONTENT_LIMIT, f"the content of {place}"),
        status=op.status if isinstance(op, UpdateOp) else "",
        result=bounded(result, RESULT_LIMIT, f"the result of {place}"),
    )
