"""How a TODO list changed in one step, item by item, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import TodoItem, TodoList, TodoUpdate

KINDS = {
    "kept": "",
    "added": "added",
    "completed": "completed",
    "reopened": "opened again",
    "rolled_back": "completion rolled back",
    "rewritten": "rewritten",
    "reworded": "new result",
    "removed": "removed",
}
"""What can happen to an item, and the words for it."""


@dataclass(frozen=True)
class TodoChange:
    """One item, after (or, if removed, before) a step."""

    kind: str
    """A key of ``KINDS``."""
    content: str
    status: str
    result: str = ""
    before: str = ""
    """The content or the result that it had, where that was replaced."""
    claim: str = ""
    """The result that was not accepted."""

    @property
    def words(self) -> str:
        """What happened, empty when nothing did."""
        return KINDS[self.kind]


def todo_changes(
    before: Sequence[TodoItem], after: TodoList, updates: Sequence[TodoUpdate]
) -> tuple[TodoChange, ...]:
    """Returns every item of the list as it is now, with what became of it, and the removed ones.

    What happened is read from the two lists, whatever kept them; the operations that were asked
    for only tell which item of one list is which of the other, and what was refused.
    """
    wordings = _wordings(before, updates)
    pairs = _aligned(before, after.items, wordings)
    changes = []
    for old, new in pairs:
        if new is None:
            assert old is not None
            item = before[old]
            changes.append(TodoChange("removed", item.content, item.status, item.result))
        elif old is None:
            item = after.items[new]
            changes.append(TodoChange("added", item.content, item.status, item.result))
        else:
            asked = [update for update in updates if update.index == old + 1]
            changes.append(_changed(before[old], after.items[new], asked))
    return tuple(changes)


def _changed(old: TodoItem, new: TodoItem, asked: Sequence[TodoUpdate]) -> TodoChange:
    claims = [
        update.result
        for update in asked
        if update.op == "update" and update.status == "completed" and update.result != new.result
    ]
    if old.status != new.status:
        kind = "completed" if new.status == "completed" else "reopened"
        rewritten = old.content if old.content != new.content else ""
        return TodoChange(kind, new.content, new.status, new.result, before=rewritten)
    if claims:
        return TodoChange("rolled_back", new.content, new.status, new.result, claim=claims[-1])
    if old.content != new.content:
        return TodoChange("rewritten", new.content, new.status, new.result, before=old.content)
    if old.result != new.result:
        return TodoChange("reworded", new.content, new.status, new.result, before=old.result)
    if any(update.status == "completed" for update in asked) and new.status != "completed":
        return TodoChange("rolled_back", new.content, new.status, new.result)
    return TodoChange("kept", new.content, new.status, new.result)


def _wordings(before: Sequence[TodoItem], updates: Sequence[TodoUpdate]) -> tuple[set[str], ...]:
    """The contents under which each item may be found again."""
    wordings = tuple({item.content} for item in before)
    for update in updates:
        if update.op == "rewrite" and update.index and update.index <= len(before):
            wordings[update.index - 1].add(update.content)
    return wordings


def _aligned(
    before: Sequence[TodoItem], after: Sequence[TodoItem], wordings: Sequence[set[str]]
) -> list[tuple[int | None, int | None]]:
    """Pairs of indices in order: the longest common subsequence; None where one side has none."""
    rows, columns = len(before), len(after)
    longest = [[0] * (columns + 1) for _ in range(rows + 1)]
    for i in reversed(range(rows)):
        for j in reversed(range(columns)):
            same = after[j].content in wordings[i]
            longest[i][j] = (
                longest[i + 1][j + 1] + 1 if same else max(longest[i + 1][j], longest[i][j + 1])
            )
    pairs: list[tuple[int | None, int | None]] = []
    i = j = 0
    while i < rows or j < columns:
        if i < rows and j < columns and after[j].content in wordings[i]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif j == columns or (i < rows and longest[i + 1][j] >= longest[i][j + 1]):
            pairs.append((i, None))
            i += 1
        else:
            pairs.append((None, j))
            j += 1
    return pairs
