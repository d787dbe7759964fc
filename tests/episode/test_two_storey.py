"""Episodes on two floors, decided by ``rules``."""

from __future__ import annotations

from typing import Any

import pytest

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction, NavigationStatus, OccupancyMap, Panorama
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.rules.model import RulesModel


class Log:
    """Floors, stairs and maps of an episode."""

    def __init__(self) -> None:
        self.floors: list[float] = []
        self.stairs: list[str] = []
        self.outcomes: list[str] = []
        self.maps: list[OccupancyMap] = []

    def __call__(self, t: float, system: str, event: str, message: Any) -> None:
        if isinstance(message, Panorama):
            self.floors.append(round(message.position[2], 1) + 0.0)
        elif isinstance(message, LanguageAction) and message.tool == "go_stair":
            self.stairs.append(message.stair)
        elif isinstance(message, NavigationStatus) and message.terminal and message.reason:
            self.outcomes.append(message.reason)
        elif isinstance(message, OccupancyMap):
            self.maps.append(message)


@pytest.mark.parametrize(
    ("name", "stair", "floors"), [("bathtub", "up", (0.0, 2.8)), ("sofa", "down", (2.8, 0.0))]
)
def test_over_the_stairs_to_the_goal(name: str, stair: str, floors: tuple[float, float]) -> None:
    log = Log()
    scenario = load_scenario("two_storey", f"task: {{text: '@{name}'}}")
    result = run_episode(scenario, on_event=log)
    assert result.success
    assert result.metrics.collisions == 0
    assert log.stairs == [stair]
    assert log.outcomes[0] == f"one floor {stair}"
    assert (log.floors[0], log.floors[-1]) == floors
    assert result.metrics.spl > 0.5


BARRED = "There are stairs here, but this robot cannot take them"


def systems_of(scenario: str, overlay: str, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Returns the rules that the language model read in an episode, of which there is one text."""
    systems: set[str] = set()
    answer = RulesModel.complete

    def complete(self: RulesModel, request: MllmRequest) -> Completion:
        if request.role == "language":
            systems.add(compose_prompt(request).system)
        return answer(self, request)

    monkeypatch.setattr(RulesModel, "complete", complete)
    run_episode(load_scenario(scenario, overlay))
    return systems


@pytest.mark.parametrize(
    ("scenario", "robot", "barred"),
    [
        ("two_storey", "!CobotMagic {}", True),
        ("two_storey", "!CobotMagic {can_climb: true}", False),
        ("two_storey", "!Quadrotor {}", True),
        ("flat", "!CobotMagic {}", False),
    ],
)
def test_only_a_robot_that_stairs_keep_on_its_floor_is_told(
    scenario: str, robot: str, barred: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    overlay = f"{{robot: {robot}, budgets: {{decisions: 1}}}}"
    (system,) = systems_of(scenario, overlay, monkeypatch)
    assert (BARRED in system) == barred


@pytest.mark.parametrize(
    ("text", "end", "longest"),
    [
        ("@bathtub", "The next step is to go upstairs, and this robot cannot take stairs.", 3),
        ("Find a toilet.", "No toilet was seen so far,", 35),
    ],
)
def test_a_robot_that_takes_no_stairs_ends_where_its_floor_ends(
    text: str, end: str, longest: int
) -> None:
    actions: list[LanguageAction] = []

    def keep(t: float, system: str, event: str, message: Any) -> None:
        if isinstance(message, LanguageAction):
            actions.append(message)

    overlay = f"robot: !CobotMagic {{}}\ntask: {{text: '{text}', goal: toilet_1}}"
    result = run_episode(load_scenario("two_storey", overlay), on_event=keep)
    assert not result.success
    assert result.cause == "stopped"
    assert actions[-1].tool == "stop"
    assert actions[-1].reason.startswith(f"Not done, given up: {end}")
    assert actions[-1].n <= longest
