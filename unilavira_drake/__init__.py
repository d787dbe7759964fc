"""Robots that follow a person's words, as a ring of Drake Systems.

``load_scenario`` reads an experiment, ``run_episode`` runs it, ``make_navigation_diagram`` builds
the Diagram for a Simulator of one's own, ``add_navigation_station`` adds only robot and world.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unilavira_drake.diagram import make_navigation_diagram
    from unilavira_drake.episode import run_episode
    from unilavira_drake.recording.result import EpisodeResult
    from unilavira_drake.scenario import Scenario
    from unilavira_drake.scenario_loading import load_scenario
    from unilavira_drake.station import add_navigation_station

__all__ = [
    "EpisodeResult",
    "Scenario",
    "add_navigation_station",
    "load_scenario",
    "make_navigation_diagram",
    "run_episode",
]

_MODULES = {
    "EpisodeResult": "recording.result",
    "Scenario": "scenario",
    "add_navigation_station": "station",
    "load_scenario": "scenario_loading",
    "make_navigation_diagram": "diagram",
    "run_episode": "episode",
}


def __getattr__(name: str) -> Any:
    # On first use: whoever needs one algorithm does not wait for the whole of Drake.
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
