"""The auxiliary grounder in the ring of dummy levels: numbers, joins, clones, and its absence."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from dummy_levels import (
    ScriptedModel,
    decide,
    language_action,
    make_ring,
    plan,
    run_until_stop,
    verdict,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram

from unilavira_drake.messages import (
    Candidate,
    Frame,
    Goal,
    Grounding,
    Intrinsics,
    Panorama,
    VisionAction,
)
from unilavira_drake.vision.grounder import Grounder

SCRIPT = {
    1: plan("go"),
    2: decide("turn", direction="front"),  # sure
    3: decide("turn", direction="left"),  # unsure: another pixel of the wall
    4: decide("turn", direction="right"),  # unsure, and nothing better is found
    5: decide("turn", direction="front"),  # marks nothing -> no target
    6: decide("double_check"),
    7: verdict(True),
}


def mark(confidence: float, target: str = "a wall") -> str:
    """Returns the reply of a vision call that marks the middle of the view."""
    reply = {"target_desc": target, "box": None, "point": [4, 3], "confidence": confidence}
    return json.dumps({**reply, "reason": ""})


NOTHING = {"target_desc": "", "box": None, "point": None, "confidence": None, "reason": "a void"}
MARKS = {2: mark(0.9), 3: mark(0.1), 4: mark(0.1, "a unicorn"), 5: json.dumps(NOTHING)}


class Proposer:
    """Finds a wall left of the middle; remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str]] = []

    def __call__(self, frame: Any, target: str, box: Any) -> list[Candidate]:
        self.asked.append((frame.view, target))
        return [Candidate((3.0, 2.0, 4.0, 4.0), 0.8)] if target == "a wall" else []


def ring(proposer: Proposer | None, period: float = 0.1, **options: Any) -> Diagram:
    replace = {}
    if proposer is not None:
        replace = {"grounder": Grounder(propose=proposer, period=period)}
    return make_ring(ScriptedModel(SCRIPT), ScriptedModel(MARKS), replace=replace, **options)


def output(diagram: Diagram, context: Context, port: str) -> Any:
    agent = diagram.GetSubsystemByName("agent")
    return agent.GetOutputPort(port).Eval(agent.GetMyContextFromRoot(context))


def followed(diagram: Diagram, ports: tuple[str, ...]) -> dict[str, dict[int, Any]]:
    """Returns the messages on the agent's ports by their numbers, from a run to the stop."""
    seen: dict[str, dict[int, Any]] = {port: {} for port in ports}

    def watch(context: Context) -> None:
        for port in ports:
            message = output(diagram, context, port)
            known = seen[port].setdefault(message.n, message)
            assert known == message, f"{port} {message.n} changed"

    simulator = Simulator(diagram)
    simulator.set_monitor(watch)
    while language_action(diagram, simulator.get_context()).tool != "stop":
        simulator.AdvanceTo(simulator.get_context().get_time() + 5.0)
        assert simulator.get_context().get_time() < 1000.0
    return seen


def test_each_vision_action_has_its_grounding_and_its_goal() -> None:
    proposer = Proposer()
    seen = followed(ring(proposer), ("vision_action", "grounding", "goal"))
    assert proposer.asked == [("left", "a wall"), ("right", "a unicorn")]
    groundings, visions = seen["grounding"], seen["vision_action"]
    assert list(groundings) == list(visions) == [0, 2, 3, 4, 5]
    assert [(g.doubt, g.refined) for g in groundings.values()] == [
        ("", False),
        ("", False),
        ("low confidence", True),
        ("low confidence", False),
        ("", False),
    ]
    for n in (2, 4, 5):
        assert groundings[n].action == visions[n]
    assert groundings[3].action.box == (3.0, 2.0, 4.0, 4.0)
    goals: dict[int, Goal] = seen["goal"]
    assert goals[2].pixel == goals[4].pixel == (4.0, 3.0)
    assert goals[3].pixel == (3.0, 2.5)
    assert goals[5].reason == "no target: a void"


def test_the_calls_are_those_of_a_ring_without_a_grounder() -> None:
    calls = []
    for proposer in (None, Proposer()):
        language = ScriptedModel(SCRIPT)
        own = {} if proposer is None else {"grounder": Grounder(propose=proposer, period=0.1)}
        run_until_stop(make_ring(language, ScriptedModel(MARKS), replace=own, latency=8.0))
        calls.append([(r.n, r.attempt, r.call, r.variables.outcome) for r in language.requests])
    assert calls[0] == calls[1]


def test_goals_do_not_depend_on_the_period_of_the_grounder() -> None:
    expected = followed(ring(Proposer()), ("goal",))["goal"]
    for period in (0.05, 0.15, 0.35, 1.0):
        goals = followed(ring(Proposer(), period), ("goal",))["goal"]
        assert [(g.n, g.kind, g.pixel, g.reason) for g in goals.values()] == [
            (g.n, g.kind, g.pixel, g.reason) for g in expected.values()
        ]


@pytest.mark.parametrize("time", [3.0, 12.3, 25.0])
def test_a_clone_has_the_same_future(time: float) -> None:
    diagram = ring(Proposer(), latency=8.0)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(time)
    clone = simulator.get_context().Clone()
    ends = []
    for branch in (simulator, Simulator(diagram, clone)):
        branch.AdvanceTo(200.0)
        context = branch.get_context()
        ends.append((output(diagram, context, "grounding"), language_action(diagram, context)))
    assert ends[0] == ends[1]
    assert ends[0][0].n == 5


def test_without_a_grounder_the_agent_is_what_it_was() -> None:
    agent = ring(None).GetSubsystemByName("agent")
    assert not agent.HasSubsystemNamed("grounder")
    assert not agent.HasOutputPort("grounding")
    with_one = ring(Proposer()).GetSubsystemByName("agent")
    names = [
        [a.get_input_port(i).get_name() for i in range(a.num_input_ports())]
        for a in (agent, with_one)
    ]
    assert names[0] == names[1]


def test_a_grounder_waits_for_the_panorama_of_its_number() -> None:
    grounder = Grounder(propose=Proposer(), period=0.1)
    context = grounder.CreateDefaultContext()
    action = VisionAction(n=2, direction="left", point=(4.0, 3.0), target_desc="x", confidence=0.1)
    vision, panorama = (grounder.GetInputPort(p) for p in ("vision_action", "panorama"))
    vision.FixValue(context, action)
    frame = Frame(
        view="left", depth=np.full((6, 8), 2.0, np.float32), intrinsics=Intrinsics(8, 6, 4, 4, 3, 2)
    )
    panorama.FixValue(context, Panorama(n=1, frames=(frame,)))
    simulator = Simulator(grounder, context)
    simulator.AdvanceTo(1.0)
    assert grounder.GetOutputPort("grounding").Eval(context) == Grounding()
    panorama.FixValue(context, Panorama(n=2, frames=(frame,)))
    simulator.AdvanceTo(2.0)
    assert grounder.GetOutputPort("vision_action").Eval(context) == action
    assert grounder.GetOutputPort("grounding").Eval(context).n == 2
