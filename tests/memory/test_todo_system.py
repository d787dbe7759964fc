from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator

from unilavira_drake.memory.todo_system import TodoMemory
from unilavira_drake.messages import LanguageAction, TodoItem, TodoList, TodoUpdate

PLAN = LanguageAction(
    n=1,
    call="plan_todo",
    tool="stay",
    todo_updates=(TodoUpdate("add", None, "leave room"), TodoUpdate("add", None, "find sofa")),
)
DECIDE = LanguageAction(
    n=2,
    call="decide",
    tool="turn",
    todo_updates=(TodoUpdate("update", 2, "", "completed", "a red sofa"), TodoUpdate("remove", 9)),
)


def test_each_action_is_applied_once() -> None:
    memory = TodoMemory(period=0.1)
    simulator = Simulator(memory)
    context = simulator.get_mutable_context()
    action_port = memory.GetInputPort("language_action")
    list_port = memory.GetOutputPort("todo_list")
    status_port = memory.GetOutputPort("todo_status")

    action_port.FixValue(context, AbstractValue.Make(LanguageAction()))
    simulator.AdvanceTo(0.5)
    assert list_port.Eval(context) == TodoList()
    assert np.array_equal(status_port.Eval(context), np.full(32, -1.0))

    action_port.FixValue(context, AbstractValue.Make(PLAN))
    simulator.AdvanceTo(1.0)
    shown = list_port.Eval(context)
    assert shown == TodoList(1, (TodoItem("leave room"), TodoItem("find sofa")))
    simulator.AdvanceTo(1.5)
    assert list_port.Eval(context) is shown

    action_port.FixValue(context, AbstractValue.Make(DECIDE))
    simulator.AdvanceTo(2.0)
    shown = list_port.Eval(context)
    assert shown.n == 2
    assert shown.items == (TodoItem("leave room"), TodoItem("find sofa", "completed", "a red sofa"))
    assert len(shown.feedback) == 1
    status = status_port.Eval(context)
    assert status.shape == (32,)
    assert list(status[:3]) == [0.0, 1.0, -1.0]
    assert np.all(status[2:] == -1.0)


def test_a_clone_has_the_same_future() -> None:
    memory = TodoMemory(period=0.1)
    context = memory.CreateDefaultContext()
    memory.GetInputPort("language_action").FixValue(context, AbstractValue.Make(PLAN))
    first = Simulator(memory, context)
    first.AdvanceTo(0.3)
    clone = context.Clone()
    for simulator in (first, Simulator(memory, clone)):
        mine = simulator.get_mutable_context()
        memory.GetInputPort("language_action").FixValue(mine, AbstractValue.Make(DECIDE))
        simulator.AdvanceTo(1.0)
    port = memory.GetOutputPort("todo_list")
    assert port.Eval(context) == port.Eval(clone)
    assert port.Eval(context).n == 2
