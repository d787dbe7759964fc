"""Episodes on two floors, decided by ``rules``."""

from __future__ import annotations

from typing import Any

import pytest

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction, NavigationStatus, OccupancyMap, Panorama


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
