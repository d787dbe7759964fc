"""Uni-LaViRA as a Drake diagram: an agent that thinks with a pretrained multimodal model.

The names below are loaded on first use, so importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unilavira_drake.diagram import make_navigation_diagram
    from unilavira_drake.episode import run_episode
    from unilavira_drake.recording.result import EpisodeResult
    from unilavira_drake.scenario import Scenario
    from unilavira_drake.scenario_loading import dump_scenario, load_scenario
    from unilavira_drake.station import add_navigation_station

__all__ = [
    "EpisodeResult",
    "Scenario",
    "add_navigation_station",
    "dump_scenario",
    "load_scenario",
    "make_navigation_diagram",
    "run_episode",
]

_HOMES = {
    "EpisodeResult": "unilavira_drake.recording.result",
    "Scenario": "unilavira_drake.scenario",
    "add_navigation_station": "unilavira_drake.station",
    "dump_scenario": "unilavira_drake.scenario_loading",
    "load_scenario": "unilavira_drake.scenario_loading",
    "make_navigation_diagram": "unilavira_drake.diagram",
    "run_episode": "unilavira_drake.episode",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
