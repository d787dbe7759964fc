"""Random TODO lists and replies, and an oracle of what the one makes of the other.

The oracle tells nothing step by step.  Of each item as it was shown it asks what its own
operations, and they alone, make of it: the last word on its status counts, the last new wording
that was allowed counts, and nothing counts after it was removed.  The new list is these items in
the order shown, with the additions before the item whose place they name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hypothesis import strategies as st

from unilavira_drake.memory.todo import MAX_ITEMS, is_concrete
from unilavira_drake.messages import TodoItem, TodoUpdate

Operations = tuple[TodoUpdate, ...]
Situation = tuple[tuple[TodoItem, ...], Operations]
"""A list as shown, and a reply to it."""

ON_AN_ITEM = ("update", "rewrite", "remove")
EMPTY_TALK = ("", " ", "ok", "Done.", "yes", "12345", "?!", "completed")
PROOFS = ("a white door behind me", "red sofa, front view", "Stairs: eight steps", "éclairage bleu")
GOALS = ("leave the room", "find the door", "pass the table on its left", "leave the room ")

pending = st.builds(TodoItem, st.sampled_from(GOALS), st.just("pending"), st.sampled_from(PROOFS))
completed = st.builds(
    TodoItem, st.sampled_from(GOALS), st.just("completed"), st.sampled_from(PROOFS)
)
items = pending | completed
lists = st.lists(items, max_size=6).map(tuple)
NEAR_FULL = st.integers(MAX_ITEMS - 2, MAX_ITEMS)


@st.composite
def updates(draw: st.DrawFn, length: int) -> TodoUpdate:
    """Draws an operation on a list of so many items: mostly a sensible one, at times nonsense."""
    inside = list(range(1, length + 1))[-4:]
    return TodoUpdate(
        draw(st.sampled_from(("update", "update", "rewrite", "add", "remove", "", "Update"))),
        draw(st.sampled_from((*inside, *inside, None, length + 1, length + 2, 0, -1))),
        draw(st.sampled_from(GOALS + GOALS + EMPTY_TALK[:3])),
        draw(st.sampled_from(("completed", "completed", "pending", "", "skipped"))),
        draw(st.sampled_from(PROOFS + EMPTY_TALK)),
    )


def replies(length: int, most: int = 9) -> st.SearchStrategy[Operations]:
    """A reply to a list of so many items."""
    return st.lists(updates(length), max_size=most).map(tuple)


@st.composite
def situations(draw: st.DrawFn) -> Situation:
    """A list as shown, and a reply; one list in four has hardly any room."""
    if draw(st.integers(0, 3)) == 3:
        goals = [f"goal number {k}" for k in range(draw(NEAR_FULL))]
        shown = tuple(TodoItem(goal) for goal in goals)
    else:
        shown = draw(lists)
    return shown, draw(replies(len(shown)))


episodes = st.lists(replies(4), max_size=7)


@dataclass(frozen=True)
class Fate:
    """What became of an item, and which of the operations on it did nothing or only half."""

    item: TodoItem | None
    idle: frozenset[int]


def fate(item: TodoItem, own: Sequence[tuple[int, TodoUpdate]]) -> Fate:
    """Returns an item's fate from its own (place in the reply, operation) pairs."""
    removals = [place for place, op in own if op.op == "remove"]
    end = min(removals, default=10**6)
    verdicts = {
        place: op
        for place, op in own
        if place < end
        and op.op == "update"
        and (op.status == "pending" or (op.status == "completed" and is_concrete(op.result)))
    }

    def closed(before: int) -> bool:
        latest = max((place for place in verdicts if place < before), default=None)
        return (item.status if latest is None else verdicts[latest].status) == "completed"

    wordings = {
        place: op.content
        for place, op in own
        if place < end and op.op == "rewrite" and is_concrete(op.content) and not closed(place)
    }
    effective = {*verdicts, *wordings, *removals[:1]}
    idle = frozenset(place for place, _ in own if place not in effective)
    if removals:
        return Fate(None, idle)
    last = verdicts.get(max(verdicts, default=-1))
    return Fate(
        TodoItem(
            wordings.get(max(wordings, default=-1), item.content),
            last.status if last else item.status,
            last.result if last else item.result,
        ),
        idle,
    )


@dataclass(frozen=True)
class Expected:
    """The list after a reply, and the places of the operations that must be answered."""

    items: tuple[TodoItem, ...]
    answered: tuple[int, ...]


def expected(shown: Sequence[TodoItem], reply: Operations) -> Expected:
    """Returns what a reply makes of the list as shown."""
    numbered = tuple(enumerate(reply))
    fates = {
        number: fate(
            item,
            [(p, op) for p, op in numbered if op.index == number and op.op in ON_AN_ITEM],
        )
        for number, item in enumerate(shown, start=1)
    }
    answered = {place for f in fates.values() for place in f.idle}
    answered |= {p for p, op in numbered if op.op not in (*ON_AN_ITEM, "add")}
    answered |= {p for p, op in numbered if op.op in ON_AN_ITEM and op.index not in fates}
    gone = [
        min(p for p, op in numbered if op.op == "remove" and op.index == number)
        for number, f in fates.items()
        if f.item is None
    ]
    added: list[tuple[int, int]] = []
    for place, op in numbered:
        if op.op != "add":
            continue
        at = len(shown) + 1 if op.index is None else op.index
        count = len(shown) + len(added) - sum(p < place for p in gone)
        if at in range(1, len(shown) + 2) and is_concrete(op.content) and count < MAX_ITEMS:
            added.append((at, place))
            if op.status == "completed" and not is_concrete(op.result):
                answered.add(place)
        else:
            answered.add(place)
    items: list[TodoItem] = []
    for number in range(1, len(shown) + 2):
        items += [new_item(reply[place]) for at, place in added if at == number]
        kept = fates[number].item if number in fates else None
        items += [] if kept is None else [kept]
    return Expected(tuple(items), tuple(sorted(answered)))


def new_item(op: TodoUpdate) -> TodoItem:
    proven = op.status == "completed" and is_concrete(op.result)
    return TodoItem(op.content, "completed", op.result) if proven else TodoItem(op.content)
