from __future__ import annotations

from typing import Any

from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder

from unilavira_drake.messages import LanguageAction, NavigationStatus
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.ports import Level
from unilavira_drake.recording.message_log import MessageLog
from unilavira_drake.recording.recorder import PORTS, Recorder

Seen = list[tuple[float, str, str, Any]]


class Counter(Level):
    """Publishes a new action every 0.2 s."""

    def __init__(self) -> None:
        super().__init__(LanguageAction(), period=0.2)
        self.declare_output("language_action", lambda state: state, LanguageAction())

    def step(self, context: Any, state: LanguageAction) -> LanguageAction:
        return LanguageAction(n=state.n + 1)


def build(seen: Seen) -> Diagram:
    def listen(t: float, system: str, event: str, message: Any) -> None:
        seen.append((round(t, 6), system, event, message))

    builder = DiagramBuilder()
    counter = builder.AddSystem(Counter())
    recorder = builder.AddSystem(Recorder(MessageLog([listen]), period=0.1))
    builder.Connect(
        counter.GetOutputPort("language_action"), recorder.GetInputPort("language_action")
    )
    return builder.Build()


def test_each_message_is_shown_once_half_a_tick_after_it_came() -> None:
    seen: Seen = []
    Simulator(build(seen)).AdvanceTo(0.7)
    assert [(t, message.n) for t, _, _, message in seen] == [
        (0.05, 1),
        (0.25, 2),
        (0.45, 3),
        (0.65, 4),
    ]
    assert {(system, event) for _, system, event, _ in seen} == {("language", "language_action")}


def test_a_clone_that_replays_shows_nothing_twice() -> None:
    seen: Seen = []
    diagram = build(seen)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.3)
    clone = simulator.get_context().Clone()
    simulator.AdvanceTo(0.7)
    before = list(seen)
    Simulator(diagram, clone).AdvanceTo(0.7)
    assert seen == before


def own_attributes(recorder: Recorder) -> dict[str, Any]:
    # Drake's bindings keep books of their own there.
    return {key: value for key, value in vars(recorder).items() if "pydrake" not in key}


def test_the_recorder_keeps_nothing_of_its_own() -> None:
    recorder = Recorder(lambda *_: None, period=0.1)
    before = own_attributes(recorder)
    context = recorder.CreateDefaultContext()
    recorder.GetInputPort("language_action").FixValue(
        context, AbstractValue.Make(LanguageAction(n=1))
    )
    recorder.ForcedPublish(context)
    assert own_attributes(recorder) == before
    assert context.num_total_states() == 0
    assert {recorder.get_input_port(i).get_name() for i in range(len(PORTS))} == set(PORTS)


def test_what_makes_a_message_new() -> None:
    seen: Seen = []
    log = MessageLog([lambda *event: seen.append(event)])
    for message in (
        MllmRequest(),
        MllmRequest(n=1),
        MllmRequest(n=1),
        MllmRequest(n=1, attempt=1),
        NavigationStatus(),
        NavigationStatus(n=1, state="moving"),
        NavigationStatus(n=1, state="arrived"),
        EpisodeMetrics(),
        EpisodeMetrics(path_length=0.05),
        EpisodeMetrics(path_length=0.26),
        EpisodeMetrics(path_length=0.26, collisions=1),
        EpisodeMetrics(path_length=0.26, collisions=1, cause="stopped"),
    ):
        log(0.0, "a", type(message).__name__, message)
    assert [(kind, getattr(message, "n", None)) for _, _, kind, message in seen] == [
        ("MllmRequest", 1),
        ("MllmRequest", 1),
        ("NavigationStatus", 1),
        ("NavigationStatus", 1),
        *[("EpisodeMetrics", None)] * 4,
    ]
