"""The whole system: same seed, same bytes; a cloned Context is the whole truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, LeafSystem, System

from unilavira_drake import load_scenario, make_navigation_diagram, run_episode
from unilavira_drake.recording.transcript import transcript_line

LATENCY = "language_latency: !LognormalLatency {median: 8.0}\n"
SHORT = LATENCY + "budgets: {decisions: 3}\n"


def files(folder: Path) -> dict[str, bytes]:
    """Returns what a run folder holds, by name, without what measures wall time."""
    timed = ("timings.json", "ledger.jsonl")
    paths = [p for p in folder.rglob("*") if p.is_file() and p.name not in timed]
    return {str(p.relative_to(folder)): p.read_bytes() for p in paths}


def test_same_scenario_and_seed_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("first", "second"):
        run_episode(load_scenario("flat", SHORT), out=tmp_path / name)
    first, second = files(tmp_path / "first"), files(tmp_path / "second")
    assert first.keys() == second.keys()
    for name in ("transcript.jsonl", "result.json", "scenario.yaml"):
        assert first[name] == second[name]
    assert any(name.startswith("frames") for name in first)
    assert first == second


def leaves(system: System) -> list[LeafSystem]:
    """Returns all leaf Systems of ours below a System."""
    if isinstance(system, Diagram):
        return [leaf for child in system.GetSystems() for leaf in leaves(child)]
    ours = type(system).__module__.startswith("unilavira_drake")
    return [system] if ours else []


def test_nothing_on_a_system_changes_after_construction() -> None:
    diagram = make_navigation_diagram(load_scenario("flat", SHORT))
    systems = leaves(diagram)
    assert len(systems) >= 14
    before = [{name: id(value) for name, value in vars(s).items()} for s in systems]
    plain = [
        {k: v for k, v in vars(s).items() if isinstance(v, int | float | str | tuple)}
        for s in systems
    ]
    Simulator(diagram).AdvanceTo(25.0)
    assert [{name: id(value) for name, value in vars(s).items()} for s in systems] == before
    assert [
        {k: v for k, v in vars(s).items() if isinstance(v, int | float | str | tuple)}
        for s in systems
    ] == plain


def model_calls(diagram: Diagram) -> list[int]:
    """Returns how often each backend was really called."""
    agent = diagram.GetSubsystemByName("agent")
    return [agent.GetSubsystemByName(f"{r}_link")._broker.calls for r in ("language", "vision")]


# While it sweeps, while the model thinks, and while it drives.
@pytest.mark.parametrize("time", [2.0, 17.0, 31.0])
def test_a_cloned_context_has_the_same_future_without_extra_calls(time: float) -> None:
    seen: list[str] = []

    def listen(t: float, system: str, event: str, message: Any) -> None:
        if message is not None and getattr(message, "n", 0):
            seen.append(transcript_line(t, 0, system, event, message, {}))

    scenario = load_scenario("flat", LATENCY + "budgets: {decisions: 20}\n")
    diagram = make_navigation_diagram(scenario, on_message=listen)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(time)
    clone = simulator.get_context().Clone()
    seen.clear()
    simulator.AdvanceTo(time + 30.0)
    first_future = list(seen)
    seen.clear()
    calls = model_calls(diagram)
    assert calls[0] > 0
    branch = Simulator(diagram, clone)
    branch.AdvanceTo(time + 30.0)
    # At every tick: the same messages, to the last digit.
    assert len(first_future) > 100
    assert seen == first_future
    assert model_calls(diagram) == calls
    first, second = (
        [
            s.get_context().get_discrete_state(i).value().tolist()
            for i in range(s.get_context().num_discrete_state_groups())
        ]
        for s in (simulator, branch)
    )
    assert first == second
