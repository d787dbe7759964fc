"""The plan as TODO items: one item a clause, read back from its own words."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import TodoItem
from unilavira_drake.mllm.rules.clauses import Clause, describe
from unilavira_drake.mllm.rules.lexicon import tokenize
from unilavira_drake.mllm.rules.memory import Place, climbed
from unilavira_drake.mllm.rules.parser import parse
from unilavira_drake.tasks import asks

MAX_ITEMS = 30
LONGEST_ITEM = 200
"""Characters that a TODO item may have."""


@dataclass(frozen=True)
class Step:
    """One item of the plan; ``index`` counts from 1 in the list as shown."""

    index: int
    clause: Clause
    done: bool = False


def clauses_of(task: str, family: str, room: str) -> tuple[Clause, ...]:
    """Returns the clauses of a task, given the kind of room where it starts.

    A question is searched for like an object; what it asks is answered at the end.
    """
    clauses = parse(task)
    if asks(family):
        clauses = _question(task)
    return tuple(
        dataclasses.replace(c, room=room) if c.kind == "leave" and not c.room else c
        for c in clauses
    )[:MAX_ITEMS]


def items_of(clauses: Sequence[Clause]) -> list[str]:
    """Returns the TODO items of a plan."""
    return [describe(clause)[:LONGEST_ITEM] for clause in clauses]


def steps_of(todo: Sequence[TodoItem]) -> list[Step]:
    """Returns the TODO list as steps; an item that is no clause counts as done."""
    steps = []
    for index, item in enumerate(todo, start=1):
        clauses = parse(item.content)
        if clauses:
            steps.append(Step(index, clauses[0], item.status == "completed"))
    return steps


def steps_from_history(
    clauses: Sequence[Clause], places: Sequence[Place], decisions: Sequence[str]
) -> list[Step]:
    """Returns the plan with what the history shows as done: all there is without a TODO list.

    Rooms are taken from the places in their order, turns from the window of past decisions.
    """
    rooms = [place.room for place in places if place.room]
    turns = [side for text in decisions for side in ("left", "right") if f"turn {side} " in text]
    steps, seen, reached = [], 0, True
    for index, clause in enumerate(clauses, start=1):
        done = False
        if clause.kind == "leave" and reached:
            done = any(room != clause.room for room in rooms[seen:])
            seen += next((i for i, r in enumerate(rooms[seen:]) if r != clause.room), 0)
        elif clause.kind in ("enter", "through", "along") and reached:
            done = clause.room in rooms[seen:]
            seen += rooms[seen:].index(clause.room) if done else 0
        elif clause.kind == "climb" and reached:
            done = any(climbed(text) == clause.side for text in decisions)
        elif clause.kind == "turn" and reached and clause.side in turns:
            turns.remove(clause.side)
            done = True
        elif not clause.hard:
            done = False
        reached = reached and (done or not clause.hard)
        steps.append(Step(index, clause, done))
    last = max((i for i, s in enumerate(steps) if s.done and s.clause.hard), default=-1)
    return [dataclasses.replace(s, done=True) if i < last else s for i, s in enumerate(steps)]


def _question(task: str) -> tuple[Clause, ...]:
    """Rooms that a question names are gone to first: they say which of several things is meant."""
    text = task.lower().strip(" ?.")
    things = [c for c in parse(f"find {text}") if c.kind == "go" and c.category]
    rooms = dict.fromkeys(token.value for token in tokenize(text) if token.kind == "room")
    return (*(Clause("enter", room=room) for room in rooms), *things[:1])
