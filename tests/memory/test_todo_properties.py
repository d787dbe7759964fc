"""What holds of the TODO list after any replies whatever (paper III-C)."""

from __future__ import annotations

import dataclasses
import functools
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from todo_oracle import (
    EMPTY_TALK,
    GOALS,
    ON_AN_ITEM,
    PROOFS,
    Operations,
    Situation,
    episodes,
    expected,
    lists,
    new_item,
    replies,
    situations,
    updates,
)

from unilavira_drake.memory.todo import MAX_ITEMS, apply_updates, is_concrete
from unilavira_drake.memory.todo_system import TodoMemory
from unilavira_drake.messages import LanguageAction, TodoItem, TodoList, TodoUpdate
from unilavira_drake.recording.run_folder import TRANSCRIPT
from unilavira_drake.recording.transcript import transcript_line
from unilavira_drake.report.reading import read_transcript

SWAP = (TodoUpdate("remove", 1), TodoUpdate("add", None, GOALS[0]), TodoUpdate("add", 2, GOALS[1]))
FULL = tuple(TodoItem(f"goal number {k}") for k in range(MAX_ITEMS))


def check(examples: int) -> settings:
    return settings(derandomize=True, deadline=None, max_examples=examples)


def test_the_words_of_these_tests_are_what_they_are_meant_to_be() -> None:
    assert not any(map(is_concrete, EMPTY_TALK))
    assert all(map(is_concrete, PROOFS + GOALS))


def reply_of(n: int, reply: Operations) -> LanguageAction:
    return LanguageAction(n=n, call="decide", tool="turn", direction="left", todo_updates=reply)


def after(shown: Sequence[TodoItem], *reply: TodoUpdate) -> TodoList:
    return apply_updates(TodoList(n=1, items=tuple(shown)), reply_of(2, reply))


def names(sentence: str, op: TodoUpdate, contents: set[str]) -> bool:
    """Whether a sentence says which operation it answers: what was asked, and of which item."""
    asked = {"update": ("update", "completion")}.get(op.op, (op.op,))
    item = [f"item {op.index};", f"item {op.index} ", f"position {op.index};", repr(op.content)]
    item += map(repr, contents)
    if op.op not in (*ON_AN_ITEM, "add"):
        return sentence.startswith(repr(op.op))
    verbs = [word for word in (*asked, "completion") if sentence.startswith(word)]
    return bool(verbs) and any(text in sentence for text in item)


@given(situations())
@example((FULL, SWAP))
@check(400)
def test_every_operation_shows_in_the_list_or_is_answered_by_one_sentence_that_names_it(
    situation: Situation,
) -> None:
    shown, reply = situation
    todo, wanted = after(shown, *reply), expected(shown, reply)
    assert todo.items == wanted.items
    assert len(todo.feedback) == len(wanted.answered)
    # Sentences stand in the order of the operations, so each is compared with its own.
    for place, sentence in zip(wanted.answered, todo.feedback, strict=True):
        op = reply[place]
        contents = {item.content for item in shown} if op.op == "add" else set()
        if op.op in ON_AN_ITEM and op.index is not None and 1 <= op.index <= len(shown):
            wordings = (o.content for o in reply if (o.op, o.index) == ("rewrite", op.index))
            contents = {shown[op.index - 1].content, *wordings}
        assert names(sentence, op, contents), (sentence, op)


@given(lists.flatmap(lambda shown: st.tuples(st.just(shown), updates(len(shown)))))
@check(300)
def test_one_operation_does_what_it_asks_or_nothing_and_is_answered(
    situation: tuple[tuple[TodoItem, ...], TodoUpdate],
) -> None:
    shown, op = situation
    todo = after(shown, op)
    items = todo.items
    at = len(shown) + 1 if op.index is None else op.index
    before, here, behind = shown[: at - 1], shown[at - 1 : at], shown[at:]
    if todo.feedback:
        assert len(todo.feedback) == 1
        # An addition without its proof is refused that alone: the item is still to be done.
        unproven = (*before, TodoItem(op.content), *here, *behind)
        assert items == shown or (op.op, op.status, items) == ("add", "completed", unproven)
    elif op.op == "remove":
        assert items == before + behind
    elif op.op == "add":
        assert items == (*before, new_item(op), *here, *behind)
    elif op.op == "update":
        assert items == (*before, TodoItem(here[0].content, op.status, op.result), *behind)
    else:
        assert (op.op, here[0].status) == ("rewrite", "pending")
        assert items == (*before, dataclasses.replace(here[0], content=op.content), *behind)


@given(episodes)
@check(150)
def test_nothing_is_completed_without_evidence(episode: list[Operations]) -> None:
    todo = TodoList()
    for n, reply in enumerate(episode, start=1):
        todo = apply_updates(todo, reply_of(n, reply))
        for item in todo.items:
            assert item.status in ("pending", "completed")
            assert item.status == "pending" or is_concrete(item.result)
            assert is_concrete(item.content)
        proofs = {op.result for said in episode[:n] for op in said}
        assert {item.result for item in todo.items} <= proofs | {""}


@given(situations())
@check(200)
def test_an_index_means_the_list_as_shown_whatever_stands_around_it(
    situation: Situation,
) -> None:
    """Operations on different items may come in any order: none shifts another's index."""
    shown, reply = situation
    mine = [op for op in reply if op.op in ON_AN_ITEM]
    by_item = sorted(mine, key=lambda op: -1 if op.index is None else op.index)
    assert after(shown, *by_item).items == after(shown, *mine).items
    # And additions shift none either.
    additions = tuple(TodoUpdate("add", k % (len(shown) + 1) + 1, GOALS[k % 4]) for k in range(3))
    around = after(shown, *additions[:2], *mine, *additions[2:]).items
    tagged = [item for item in around if item not in map(new_item, additions)]
    alone = [i for i in after(shown, *mine).items if i not in map(new_item, additions)]
    assert tagged == alone


@given(situations())
@check(200)
def test_one_by_one_with_indices_of_the_present_list_is_the_same(
    situation: Situation,
) -> None:
    """Whoever rewrites each index for the list as it has become by then gets the same list."""
    shown, reply = situation
    removed = {op.index for op in reply if op.op == "remove"}
    # Before an item that is gone there is no place any more that a present index could name.
    reply = tuple(op for op in reply if op.op != "add" or op.index not in removed)
    present, places = tuple(shown), list(range(1, len(shown) + 1))
    for op in reply:
        at = None
        if op.index in places and op.index:
            at = places.index(op.index) + 1
        elif not (op.op == "add" and op.index in (None, len(shown) + 1)):
            continue
        changed = after(present, dataclasses.replace(op, index=at)).items
        if len(changed) > len(present):
            places.insert(len(places) if at is None else at - 1, 0)
        elif len(changed) < len(present) and at is not None:
            del places[at - 1]
        present = changed
    assert after(shown, *reply).items == present


@given(episodes)
@check(40)
def test_the_transcript_alone_rebuilds_the_list(episode: list[Operations]) -> None:
    actions = [reply_of(n, reply) for n, reply in enumerate(episode, start=1)]
    todo = functools.reduce(apply_updates, actions, TodoList())
    lines = [
        transcript_line(0.1, a.n, "language", "language_action", a, {}) + "\n" for a in actions
    ]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / TRANSCRIPT).write_text("".join(lines), encoding="utf-8")
        transcript = read_transcript(Path(folder))
    assert not transcript.problems
    read = [entry.message for entry in transcript.entries]
    assert read == actions
    assert functools.reduce(apply_updates, read, TodoList()) == todo


class Memory:
    """The System, whose input is set by hand."""

    def __init__(self) -> None:
        self.system = TodoMemory(period=0.1)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()

    def show(self, action: LanguageAction, polls: int) -> TodoList:
        port = self.system.GetInputPort("language_action")
        port.FixValue(self.context, AbstractValue.Make(action))
        self.simulator.AdvanceTo(self.context.get_time() + 0.1 * polls)
        todo: Any = self.system.GetOutputPort("todo_list").Eval(self.context)
        assert isinstance(todo, TodoList)
        return todo

    @property
    def status(self) -> list[float]:
        vector: Any = self.system.GetOutputPort("todo_status").Eval(self.context)
        assert vector.shape == (MAX_ITEMS,)
        return [float(number) for number in vector]


def mirror(todo: TodoList) -> list[float]:
    """Returns the list as numbers: 0 pending, 1 completed, -1 for each free place behind it."""
    known = {"pending": 0.0, "completed": 1.0}
    numbers = [known[item.status] for item in todo.items]
    return numbers + [-1.0] * (MAX_ITEMS - len(numbers))


@given(st.lists(st.tuples(replies(4), st.integers(1, 3)), max_size=6), st.integers(0, 5))
@check(40)
def test_the_system_holds_what_the_log_says_at_any_time_and_in_numbers_too(
    episode: list[tuple[Operations, int]], saved_at: int
) -> None:
    memory, todo = Memory(), TodoList()
    for n, (reply, polls) in enumerate(episode, start=1):
        todo = apply_updates(todo, reply_of(n, reply))
        assert memory.show(reply_of(n, reply), polls) == todo
        assert memory.status == mirror(todo)
        if n == saved_at:
            # What was saved needs nothing but the rest of the log.
            memory.simulator = Simulator(memory.system, memory.context.Clone())
            memory.context = memory.simulator.get_mutable_context()
    assert memory.system.state(memory.context) == todo


@pytest.mark.parametrize("length", [0, 1, MAX_ITEMS])
def test_the_numbers_mirror_a_list_of_any_length(length: int) -> None:
    memory = Memory()
    reply = tuple(
        TodoUpdate("add", None, f"item number {k}", *(("completed", PROOFS[0]) if k % 3 else ()))
        for k in range(length)
    )
    todo = memory.show(reply_of(1, reply), 2)
    assert len(todo.items) == length
    assert memory.status == mirror(todo)
    assert np.count_nonzero(np.array(memory.status) == 1.0) == length - len(range(0, length, 3))
