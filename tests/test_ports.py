"""Typed ports: a wrong wiring is an error that names system, port and both types."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus

from unilavira_drake.errors import PortTypeError
from unilavira_drake.messages import Goal, Panorama, TodoList
from unilavira_drake.ports import Level, message_input, vector_input


class Counter(Level):
    """Counts its ticks up to ten."""

    def __init__(self) -> None:
        super().__init__(TodoList(), period=0.1)
        self.declare_output("todo_list", lambda state: state, TodoList())
        self.declare_vector_mirror("count", 1, lambda state: np.array([state.n]), -1.0)

    def step(self, context: Context, state: Any) -> Any:
        """Returns the same object when there is nothing to do."""
        return state if state.n == 10 else TodoList(n=state.n + 1)


class Listener(Level):
    """Reads a goal and a vector."""

    def __init__(self) -> None:
        super().__init__(Goal(), period=0.1)
        self.goal = message_input(self, "goal", Goal())
        self.twist = vector_input(self, "twist", 6)

    def step(self, context: Context, state: Any) -> Any:
        """Ends as soon as there is a goal."""
        goal = self.goal.optional(context)
        if goal is None:
            self.twist(context)
        return EventStatus.ReachedTermination(self, "goal seen")


def test_level_publishes_its_state_and_the_mirror_of_it() -> None:
    counter = Counter()
    simulator = Simulator(counter)
    simulator.AdvanceTo(0.45)
    context = simulator.get_context()
    assert counter.GetOutputPort("todo_list").Eval(context).n == 5
    assert counter.GetOutputPort("count").Eval(context) == [5.0]
    simulator.AdvanceTo(5.0)
    assert counter.GetOutputPort("count").Eval(context) == [10.0]


def test_wrong_type_is_named() -> None:
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", Counter())
    target = builder.AddNamedSystem("target", Listener())
    builder.Connect(source.GetOutputPort("todo_list"), target.GetInputPort("goal"))
    with pytest.raises(PortTypeError, match=r"target: input port 'goal' expects Goal.*TodoList"):
        Simulator(builder.Build()).AdvanceTo(0.1)


def test_unconnected_port_is_named() -> None:
    with pytest.raises(PortTypeError, match="'twist' is not connected"):
        Simulator(Listener()).AdvanceTo(0.1)


def test_an_optional_port_is_absent_where_nothing_feeds_it() -> None:
    listener = Listener()
    fed, unfed = listener.CreateDefaultContext(), listener.CreateDefaultContext()
    listener.GetInputPort("goal").FixValue(fed, Goal(n=3))
    values = [listener.goal.optional(context) for context in (unfed, fed, unfed, fed)]
    assert values == [None, Goal(n=3), None, Goal(n=3)]


def test_termination_of_a_level_ends_the_simulation() -> None:
    listener = Listener()
    context = listener.CreateDefaultContext()
    listener.GetInputPort("goal").FixValue(context, Goal())
    status = Simulator(listener, context).AdvanceTo(1.0)
    assert "goal seen" in status.FormatMessage()


def test_messages_are_shared_and_their_arrays_frozen() -> None:
    writable = np.eye(4)
    panorama = Panorama(X_WB=writable)
    writable[0, 3] = 7.0
    assert panorama.position == (0.0, 0.0, 0.0)
    assert copy.deepcopy(panorama) is panorama
    with pytest.raises(ValueError, match="read-only"):
        panorama.X_WB[0, 3] = 1.0
