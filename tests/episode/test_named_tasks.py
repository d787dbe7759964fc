"""The named tasks of each scenario: what each model makes of them, and on what evidence."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import pytest

from unilavira_drake import EpisodeResult, load_scenario, run_episode
from unilavira_drake.messages import LanguageAction
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.sensors.detections import GroundTruthDetector, permuted_labels
from unilavira_drake.worlds.load import load_world

SCENARIOS = ("apartment", "flat", "office")
TASKS = [(scenario, name) for scenario in SCENARIOS for name in load_scenario(scenario).tasks]
NAMES = sorted(load_scenario("flat").tasks)
BACKTRACKS = (
    ("flat", "nightstand"),
    ("flat", "washing_machine"),
    ("apartment", "armchair"),
    ("apartment", "nightstand"),
)


@dataclass
class Evidence:
    """What each call was shown, and what each action said."""

    shown: dict[int, set[str]] = field(default_factory=dict)
    actions: dict[int, LanguageAction] = field(default_factory=dict)

    def listen(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a message of the ring."""
        if isinstance(message, MllmRequest) and message.role == "language":
            assert message.evidence is not None
            self.shown[message.n] = {d.id for view in message.evidence for d in view.detections}
        elif isinstance(message, LanguageAction):
            self.actions[message.n] = message


def run(
    name: str,
    model: str = "rules",
    decisions: int = 40,
    scenario: str = "flat",
    **options: Any,
) -> EpisodeResult:
    """Runs a named task to its end."""
    overlay = (
        f"task: {{text: '@{name}'}}\nlanguage_model: {model}\nvision_model: {model}\n"
        f"budgets: {{decisions: {decisions}}}"
    )
    return run_episode(load_scenario(scenario, overlay), **options)


@pytest.mark.parametrize(("scenario", "name"), TASKS)
def test_rules_succeeds_and_cites_what_it_saw(scenario: str, name: str) -> None:
    evidence = Evidence()
    result = run(name, scenario=scenario, on_event=evidence.listen)
    assert result.cause == "stopped"
    assert result.success
    assert result.metrics.collisions == 0
    completions = [
        (n, update.result)
        for n, action in evidence.actions.items()
        for update in action.todo_updates
        if update.status == "completed"
    ]
    assert completions
    for n, text in completions:
        cited = re.findall(r"\b(?:front|left|right|back)#\d+", text)
        assert cited, f"call {n} completed an item without evidence: {text!r}"
        assert set(cited) <= evidence.shown[n]
    if (scenario, name) in BACKTRACKS:
        assert result.counts.backtracks >= 1
        assert any(action.call == "recover" for action in evidence.actions.values())


def test_goals_are_far_away_and_in_another_room() -> None:
    scenario = load_scenario("flat")
    world = load_world("flat")
    assert len(NAMES) >= 8
    for name in NAMES:
        task = scenario.tasks[name]
        x, y = (float(number) for number in task.start.split(",")[:2])
        start, thing = world.room_at(x, y), world.object(task.goal)
        assert start is not None
        assert thing is not None
        assert start.name != thing.room


@pytest.mark.parametrize(
    ("scenario", "model", "most"),
    [
        ("flat", "random", 1),
        ("flat", "frontier", 3),
        ("apartment", "random", 1),
        ("apartment", "frontier", 4),
    ],
)
def test_lower_bounds_stay_low(scenario: str, model: str, most: int) -> None:
    names = load_scenario(scenario).tasks
    results = [run(name, model, scenario=scenario) for name in names]
    assert sum(bool(result.success) for result in results) <= most


def test_rules_depends_on_what_it_sees() -> None:
    labels = permuted_labels(load_world("flat").labels, seed=1)
    detector = GroundTruthDetector(labels)
    results = [run(name, decisions=20, detector=detector) for name in NAMES]
    assert sum(bool(result.success) for result in results) <= 2
