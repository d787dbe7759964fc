"""What the messages of an episode say about its way: points, waypoints, backtracks, goals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Goal, LanguageAction, NavigationStatus, Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest


class EpisodeTrace:
    """A listener that keeps the way of the robot, for the picture of the map."""

    def __init__(self) -> None:
        self._points: list[tuple[float, float, float]] = []
        self._panoramas: dict[int, tuple[float, float]] = {}
        self._backtracks: dict[int, tuple[float, float]] = {}
        self._departures: dict[int, float] = {}
        self.waypoints: dict[int, tuple[float, float]] = {}
        """Waypoint -> (x, y), metres in the world."""
        self.goals: list[tuple[float, float]] = []
        """The points that the agent chose to go to, metres in the world."""

    @property
    def points(self) -> NDArray[np.float64]:
        """(k, 3) float64: simulated seconds, x and y in metres in the world."""
        return np.array(self._points, dtype=float).reshape(-1, 3)

    @property
    def backtracks(self) -> tuple[tuple[float, float], ...]:
        """Start and end of each backtrack, simulated seconds."""
        return tuple(self._backtracks[n] for n in sorted(self._backtracks))

    def record(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a new message at a time, simulated seconds."""
        if isinstance(message, EpisodeMetrics):
            self._points.append((t, message.x, message.y))
        elif isinstance(message, Panorama):
            self._panoramas[message.n] = message.position[:2]
        elif isinstance(message, MllmRequest):
            self._place_waypoint(message)
        elif isinstance(message, LanguageAction):
            if message.tool == "backtrack":
                self._departures[message.n] = t
        elif isinstance(message, Goal):
            if message.kind == "go" and message.p_WG is not None:
                self.goals.append(message.p_WG[:2])
        elif isinstance(message, NavigationStatus):
            if message.terminal and message.n in self._departures:
                self._backtracks[message.n] = (self._departures[message.n], t)

    def _place_waypoint(self, request: MllmRequest) -> None:
        if isinstance(request.variables, LanguageVariables) and request.n in self._panoramas:
            waypoint = request.variables.current_waypoint
            self.waypoints.setdefault(waypoint, self._panoramas[request.n])
