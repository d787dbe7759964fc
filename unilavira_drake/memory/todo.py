"""TODO List Memory: the list and its four operations (paper III-C), as a pure function."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass

from unilavira_drake.messages import LanguageAction, TodoItem, TodoList, TodoUpdate

MAX_ITEMS = 32
"""Length bound of the list, and size of the ``todo_status`` port."""
MIN_LETTERS = 3
"""A content or a result with fewer letters says nothing."""

_EMPTY_WORDS = frozenset(
    (
        *("done", "complete", "completed", "finished", "none", "null", "true", "yes", "ok", "now"),
        *("it", "is", "was", "has", "been", "this", "that", "the", "a", "task", "item", "step"),
    )
)
_WHOLE_WORDS = 0x3040
"""From this code point on, a letter of Chinese, Japanese or Korean says as much as several."""


@dataclass
class _Slot:
    """A place in the list during one reply; ``shown`` is its index in the prompt, if any."""

    shown: int | None
    item: TodoItem | None
    """None once removed: the place still anchors later ``add`` operations."""


def is_concrete(text: str) -> bool:
    """Whether a text says something: 3 letters or more beside 'it is done' and the like."""
    words = (w for w in re.findall(r"[^\W_]+", text.casefold()) if w not in _EMPTY_WORDS)
    letters = (character for word in words for character in word if character.isalpha())
    return sum(2 if ord(letter) >= _WHOLE_WORDS else 1 for letter in letters) >= MIN_LETTERS


def apply_updates(todo: TodoList, action: LanguageAction) -> TodoList:
    """Returns the list after the operations of one reply (paper Eq. 6), under its number.

    An index means the list as it was shown, before any operation of this reply.  Operations are
    applied in their order, several on one item too; items may be completed out of order and set
    back to pending.  Each operation is either applied or answered by one sentence of feedback:
    a completion without a concrete result is rolled back, a completed item is not rewritten, a
    list never grows beyond 32 items, and an unknown operation or index changes nothing.
    """
    slots = [_Slot(number, item) for number, item in enumerate(todo.items, start=1)]
    feedback = []
    for update in action.todo_updates:
        complaint = _apply(slots, update)
        if complaint:
            feedback.append(complaint)
    items = tuple(slot.item for slot in slots if slot.item is not None)
    # The examiner of a stop changes nothing: whoever decides next is to hear what was refused.
    kept = todo.feedback if action.call == "double_check" else ()
    return TodoList(n=action.n, items=items, feedback=kept + tuple(feedback))


def _apply(slots: list[_Slot], update: TodoUpdate) -> str:
    """Applies one operation in place; returns what was wrong, empty when nothing was."""
    if update.op == "add":
        return _add(slots, update)
    if update.op not in ("update", "rewrite", "remove"):
        return f"{update.op!r} is no operation; there are update, rewrite, add and remove."
    slot = next((s for s in slots if s.shown == update.index and s.shown is not None), None)
    if slot is None:
        count = sum(s.shown is not None for s in slots)
        return f"{update.op}: there was no item {update.index}; {count} items were shown."
    if slot.item is None:
        return f"{update.op}: item {update.index} was removed earlier in the same reply."
    if update.op == "remove":
        slot.item = None
        return ""
    change = _status_changed if update.op == "update" else _rewritten
    item, complaint = change(slot.item, update)
    slot.item = item
    return complaint


def _add(slots: list[_Slot], update: TodoUpdate) -> str:
    shown = sum(slot.shown is not None for slot in slots)
    if update.index is not None and not 1 <= update.index <= shown + 1:
        return (
            f"add {update.content!r}: there was no position {update.index}; "
            f"{shown} items were shown."
        )
    if not is_concrete(update.content):
        return f"add {update.content!r}: the content says nothing; name what is to be done."
    if sum(slot.item is not None for slot in slots) >= MAX_ITEMS:
        return f"add {update.content!r}: the list is full ({MAX_ITEMS} items); remove one first."
    item, complaint = TodoItem(content=update.content), ""
    if update.status == "completed":
        item, complaint = _status_changed(item, update)
    anchor = next(
        (
            i
            for i, slot in enumerate(slots)
            if slot.shown is not None and slot.shown == update.index
        ),
        len(slots),
    )
    slots.insert(anchor, _Slot(None, item))
    return complaint


def _status_changed(item: TodoItem, update: TodoUpdate) -> tuple[TodoItem, str]:
    if update.status == "pending":
        return dataclasses.replace(item, status="pending", result=update.result), ""
    if update.status != "completed":
        return item, f"update of {item.content!r}: {update.status!r} is no status."
    if not is_concrete(update.result):
        return item, (
            f"completion of {item.content!r} was rolled back, it is {item.status} as before: the "
            f"result {update.result!r} names no observation that proves it."
        )
    return dataclasses.replace(item, status="completed", result=update.result), ""


def _rewritten(item: TodoItem, update: TodoUpdate) -> tuple[TodoItem, str]:
    if item.status == "completed":
        return item, (
            f"rewrite of {item.content!r} was refused: it is completed; set it back to pending "
            "first if it is not done."
        )
    if not is_concrete(update.content):
        return (
            item,
            f"rewrite of {item.content!r}: the new content {update.content!r} says nothing.",
        )
    return dataclasses.replace(item, content=update.content), ""
