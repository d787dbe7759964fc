from __future__ import annotations

import functools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.memory.todo import MAX_ITEMS, apply_updates, is_concrete
from unilavira_drake.messages import LanguageAction, TodoItem, TodoList, TodoUpdate

FIXED = settings(derandomize=True, deadline=None, max_examples=200)
A, B, C = TodoItem("leave room"), TodoItem("find door"), TodoItem("stop at sofa")
LIST = TodoList(n=3, items=(A, B, C))
DONE_B = TodoItem("find door", "completed", "a white door")


def _apply(*updates: TodoUpdate, to: TodoList = LIST) -> TodoList:
    return apply_updates(to, LanguageAction(n=to.n + 1, call="decide", todo_updates=updates))


def _done(index: int | None, result: str = "a white door") -> TodoUpdate:
    return TodoUpdate("update", index, status="completed", result=result)


def _contents(todo: TodoList) -> list[str]:
    return [item.content for item in todo.items]


def test_nothing_to_do_keeps_the_items_under_the_new_number() -> None:
    assert _apply() == TodoList(n=4, items=LIST.items)


def test_items_complete_out_of_order() -> None:
    assert _apply(_done(2)).items == (A, DONE_B, C)
    assert _apply(_done(2)).feedback == ()


@pytest.mark.parametrize("result", ["", "  ", "ok", "123 45", "...", "Done.", "completed", "yes"])
def test_completion_without_evidence_is_rolled_back(result: str) -> None:
    todo = _apply(_done(2, result))
    assert todo.items == LIST.items
    (sentence,) = todo.feedback
    assert "'find door' was rolled back" in sentence


def test_back_to_pending() -> None:
    done = _apply(_done(2))
    again = _apply(TodoUpdate("update", 2, status="pending", result="dead end"), to=done)
    assert again.items == (A, TodoItem("find door", "pending", "dead end"), C)
    assert again.feedback == ()


def test_evidence_survives_a_bad_second_completion() -> None:
    todo = _apply(_done(2, ""), to=TodoList(3, (A, DONE_B, C)))
    assert todo.items == (A, DONE_B, C)
    assert len(todo.feedback) == 1


def test_rewrite() -> None:
    todo = _apply(TodoUpdate("rewrite", 1, "leave the bedroom"), TodoUpdate("rewrite", 2, "?"))
    assert _contents(todo) == ["leave the bedroom", "find door", "stop at sofa"]
    assert len(todo.feedback) == 1


def test_a_completed_item_is_not_rewritten() -> None:
    done = _apply(_done(2))
    refused = _apply(TodoUpdate("rewrite", 2, "find window"), to=done)
    assert refused.items == done.items
    assert "is completed" in refused.feedback[0]
    # In one reply too; and it may be opened and then rewritten.
    assert _apply(_done(2), TodoUpdate("rewrite", 2, "find window")).items == done.items
    opened = _apply(
        TodoUpdate("update", 2, status="pending"), TodoUpdate("rewrite", 2, "find window"), to=done
    )
    assert opened.items == (A, TodoItem("find window"), C)
    assert opened.feedback == ()


def test_add() -> None:
    todo = _apply(
        TodoUpdate("add", 2, "first at two"),
        TodoUpdate("add", None, "at the end"),
        TodoUpdate("add", 2, "second at two"),
        TodoUpdate("add", 4, "end again"),
        TodoUpdate("add", 1, "at the start"),
    )
    assert _contents(todo) == [
        "at the start", "leave room", "first at two", "second at two", "find door", "stop at sofa",
        "at the end", "end again",
    ]  # fmt: skip
    assert all(item.status == "pending" for item in todo.items)


def test_the_check_guards_add() -> None:
    todo = _apply(
        TodoUpdate("add", None, "x"),
        TodoUpdate("add", None, "look around", "completed", ""),
        TodoUpdate("add", None, "see bench", "completed", "a red bench"),
    )
    assert todo.items[3:] == (
        TodoItem("look around"),
        TodoItem("see bench", "completed", "a red bench"),
    )
    assert len(todo.feedback) == 2


def test_indices_mean_the_list_as_shown() -> None:
    todo = _apply(
        TodoUpdate("remove", 1),
        TodoUpdate("add", 1, "brand new"),
        _done(2),
        TodoUpdate("rewrite", 3, "stop at the red sofa"),
    )
    assert todo.items == (TodoItem("brand new"), DONE_B, TodoItem("stop at the red sofa"))
    assert todo.feedback == ()


def test_an_item_added_in_this_reply_has_no_index_yet() -> None:
    todo = _apply(TodoUpdate("add", None, "brand new"), _done(4))
    assert todo.items[3] == TodoItem("brand new")
    assert "there was no item 4" in todo.feedback[0]


def test_a_removed_item_is_gone_for_later_operations() -> None:
    todo = _apply(TodoUpdate("remove", 2), _done(2), TodoUpdate("remove", 2))
    assert todo.items == (A, C)
    assert len(todo.feedback) == 2


@pytest.mark.parametrize(
    "update",
    [
        _done(0),
        _done(4),
        _done(-1),
        _done(None),
        TodoUpdate("update", 1, status="skipped", result="no reason"),
        TodoUpdate("add", 5, "too far"),
        TodoUpdate("add", 0, "too near"),
        TodoUpdate("remove", None),
        TodoUpdate("shuffle", 1),
    ],
)
def test_bad_operations_change_nothing_and_are_reported(update: TodoUpdate) -> None:
    todo = _apply(update)
    assert todo.items == LIST.items
    assert len(todo.feedback) == 1


def test_the_list_is_bounded() -> None:
    adds = [TodoUpdate("add", None, f"item number {i}") for i in range(MAX_ITEMS + 2)]
    full = _apply(*adds, to=TodoList())
    assert len(full.items) == MAX_ITEMS
    assert len(full.feedback) == 2
    swapped = _apply(TodoUpdate("remove", 1), TodoUpdate("add", 1, "another item"), to=full)
    assert len(swapped.items) == MAX_ITEMS
    assert swapped.items[0].content == "another item"


def _independent(
    items: list[list[str]], updates: tuple[TodoUpdate, ...]
) -> tuple[list[list[str]], int]:
    """The same semantics in another way: returns the list and how many operations applied.

    Shown items keep their identity as list objects; removal marks, sorting keys place additions.
    """
    shown = items
    removed: set[int] = set()
    placed = [((i, 1, 0), item) for i, item in enumerate(shown)]
    applied = 0
    for order, op in enumerate(updates):
        live = len(placed) - len(removed)
        if op.op == "add":
            index = len(shown) + 1 if op.index is None else op.index
            if 1 <= index <= len(shown) + 1 and is_concrete(op.content) and live < MAX_ITEMS:
                good = op.status in ("", "pending") or is_concrete(op.result)
                completed = op.status == "completed" and good
                item = [op.content, *(("completed", op.result) if completed else ("pending", ""))]
                placed.append(((index - 1, 0, order), item))
                applied += good
        elif op.index is not None and 1 <= op.index <= len(shown) and op.index not in removed:
            item = shown[op.index - 1]
            if op.op == "remove":
                removed.add(op.index)
                applied += 1
            elif op.op == "rewrite" and item[1] == "pending" and is_concrete(op.content):
                item[0] = op.content
                applied += 1
            elif op.op == "update" and (
                op.status == "pending" or (op.status == "completed" and is_concrete(op.result))
            ):
                item[1:] = [op.status, op.result]
                applied += 1
    alive = [entry for entry in placed if not any(entry[1] is shown[k - 1] for k in removed)]
    return [item for _, item in sorted(alive, key=lambda entry: entry[0])], applied


words = st.sampled_from(["", "ok", "done", "find the door", "saw a bench", "12345", "walk on"])
updates = st.builds(
    TodoUpdate,
    op=st.sampled_from(["update", "rewrite", "add", "add", "remove", "shuffle"]),
    index=st.none() | st.integers(-1, 7),
    content=words,
    status=st.sampled_from(["completed", "pending", ""]),
    result=words,
)
replies = st.lists(st.lists(updates, max_size=8).map(tuple), max_size=6)


@given(replies)
@FIXED
def test_properties_of_any_history(replies: list[tuple[TodoUpdate, ...]]) -> None:
    todo = TodoList()
    expected: list[list[str]] = []
    for n, operations in enumerate(replies, start=1):
        before = todo
        todo = apply_updates(todo, LanguageAction(n=n, todo_updates=operations))
        expected, applied = _independent([list(item) for item in expected], operations)
        assert [[i.content, i.status, i.result] for i in todo.items] == expected
        assert len(todo.feedback) + applied == len(operations)
        assert all(i.status == "pending" or is_concrete(i.result) for i in todo.items)
        assert len(todo.items) <= MAX_ITEMS
        assert before.n == n - 1
    # The log of operations alone rebuilds the list.
    actions = [LanguageAction(n=n, todo_updates=ops) for n, ops in enumerate(replies, start=1)]
    assert functools.reduce(apply_updates, actions, TodoList()) == todo


@pytest.mark.parametrize("text", ["It is done.", "task completed", "yes, OK", "!!", "a 1 2"])
def test_words_that_prove_nothing(text: str) -> None:
    assert not is_concrete(text)


@pytest.mark.parametrize("text", ["the sofa is done up in red", "左转", "door", "Tür"])
def test_words_that_say_something(text: str) -> None:
    assert is_concrete(text)


def test_what_was_refused_is_still_told_after_the_examiner_has_spoken() -> None:
    done = TodoUpdate(op="update", index=1, status="completed", result="done")
    before = TodoList(n=1, items=(TodoItem("find the sofa"),))
    proposed = apply_updates(before, LanguageAction(2, "decide", todo_updates=(done,)))
    assert len(proposed.feedback) == 1
    checked = apply_updates(proposed, LanguageAction(3, "double_check", confirmed=False))
    assert checked.feedback == proposed.feedback
    assert apply_updates(checked, LanguageAction(4, "decide")).feedback == ()
