"""TODO List Memory as a System: it holds the list and turns with the ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from unilavira_drake.memory.todo import MAX_ITEMS, apply_updates
from unilavira_drake.messages import LanguageAction, TodoList
from unilavira_drake.ports import Level, message_input


class TodoMemory(Level):
    """Applies the TODO operations of each language action once and shows the list.

    ``todo_list`` n is the list after language action n, with what was wrong with its operations.
    ``todo_status`` is the same as numbers, shape (32,): -1 no item, 0 pending, 1 completed.
    Source: paper section III-C.

    .. pydrake_system::
        name: TodoMemory
        input_ports:
        - language_action
        output_ports:
        - todo_list
        - todo_status
    """

    def __init__(self, *, period: float) -> None:
        """Polls its input each ``period``, seconds."""
        super().__init__(TodoList(), period=period)
        self._language_action = message_input(self, "language_action", LanguageAction())
        self.declare_output("todo_list", lambda todo: todo, TodoList())
        self.declare_vector_mirror("todo_status", MAX_ITEMS, _status_vector, -1.0)

    def step(self, context: Context, state: TodoList) -> TodoList:
        """Returns the list after a new language action."""
        action = self._language_action(context)
        return apply_updates(state, action) if action.n > state.n else state


def _status_vector(todo: TodoList) -> NDArray[np.float64]:
    status = np.full(MAX_ITEMS, -1.0)
    for index, item in enumerate(todo.items):
        status[index] = float(item.status == "completed")
    return status
