"""What the messages of an episode say about its way: points, waypoints, backtracks, goals."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import (
    Goal,
    LanguageAction,
    NavigationStatus,
    OccupancyMap,
    Panorama,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest

Pose = tuple[float, float, float]
"""x and y in metres in the world, yaw in radians."""


class EpisodeTrace:
    """A listener that keeps the way of the robot, for the picture of the map."""

    def __init__(self) -> None:
        self._points: list[tuple[float, float, float, float]] = []
        self._lengths: list[float] = []
        self._waypoint_heights: dict[int, float] = {}
        self._goal_heights: list[float] = []
        self._heights: dict[int, float] = {}
        self._backtracks: list[int] = []
        self._departures: dict[int, float] = {}
        self.poses: dict[int, Pose] = {}
        """Panorama -> where it was taken, along its front."""
        self.legs: dict[int, tuple[float, float]] = {}
        """Language action -> when it was decided and when its goal was done, simulated seconds."""
        self.waypoints: dict[int, tuple[float, float]] = {}
        """Waypoint -> (x, y), metres in the world."""
        self.goals: list[tuple[float, float]] = []
        """The points that the agent chose to go to, metres in the world."""
        self.maps: dict[int, OccupancyMap] = {}
        """Panorama -> the first map that holds it."""
        self.away: tuple[tuple[float, float], ...] = ()
        """When it was not on the floor that is shown, from and to, simulated seconds."""

    @property
    def points(self) -> NDArray[np.float64]:
        """(k, 3) float64: simulated seconds, x and y in metres in the world."""
        return np.array(self._points, dtype=float).reshape(-1, 4)[:, :3]

    @property
    def heights(self) -> tuple[float, ...]:
        """The height of each point, metres in the world."""
        return tuple(z for _, _, _, z in self._points)

    @property
    def backtracks(self) -> tuple[tuple[float, float], ...]:
        """Start and end of each backtrack, simulated seconds."""
        legs = (self.legs[n] for n in sorted(self._backtracks) if n in self.legs)
        return tuple(
            leg for leg in legs if not any(a < leg[1] and leg[0] < b for a, b in self.away)
        )

    @property
    def ends(self) -> tuple[Pose | None, Pose | None]:
        """Where the way begins and ends, each along the front of the nearest panorama.

        None before the first panorama, and where it lies on a floor that is not shown.
        """
        if not self.poses:
            return None, None
        first, last = self.poses[min(self.poses)], self.poses[max(self.poses)]
        x, y = self._points[-1][1:3] if self._points else last[:2]
        begins_away = self.away and self.away[0][0] <= self._points[0][0]
        ends_away = self.away and self.away[-1][1] >= self._points[-1][0]
        return None if begins_away else first, None if ends_away else (x, y, last[2])

    def height(self, n: int) -> float:
        """Returns the height at panorama n, or at the latest one before it, metres."""
        seen = [m for m in self._heights if m <= n]
        return self._heights[max(seen)] if seen else 0.0

    def travel(self, begin: float, end: float) -> float:
        """Returns the metres of the run's path length between two times, heights included.

        Measured as the path length itself, so that the parts of a run sum to it; a corner of the
        drawn way is cut, as its points lie some travel apart.
        """
        if not self._points:
            return 0.0
        times = [point[0] for point in self._points]
        first, last = np.interp((begin, end), times, self._lengths)
        return float(last - first)

    def climb(self, n: int) -> float:
        """Returns how much higher the robot was after step n than at its panorama, metres.

        After it is the next panorama, or the end of the record.
        """
        if n not in self._heights:
            return 0.0
        later = [m for m in self._heights if m > n]
        if later:
            return self._heights[min(later)] - self._heights[n]
        return self._points[-1][3] - self._heights[n] if self._points else 0.0

    def on(self, shown: Callable[[float], bool]) -> EpisodeTrace:
        """Returns the trace for the picture of one floor: what lies elsewhere is ``away``.

        Args:
            shown: whether a height, metres in the world, belongs to the floor.
        """
        part = copy.copy(self)
        part.waypoints = {
            waypoint: place
            for waypoint, place in self.waypoints.items()
            if shown(self._waypoint_heights[waypoint])
        }
        aims = zip(self.goals, self._goal_heights, strict=True)
        part.goals = [goal for goal, height in aims if shown(height)]
        part.maps = {n: known for n, known in self.maps.items() if shown(self.height(n))}
        spans: list[tuple[float, float]] = []
        before = True
        for t, _, _, z in self._points:
            here = shown(z)
            if not here:
                spans.append((t, t) if before else (spans.pop()[0], t))
            before = here
        part.away = tuple(spans)
        return part

    def record(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a new message at a time, simulated seconds."""
        if isinstance(message, EpisodeMetrics):
            self._points.append((t, message.x, message.y, message.z))
            self._lengths.append(message.path_length)
        elif isinstance(message, Panorama):
            self.poses[message.n] = (*message.position[:2], message.yaw)
            self._heights[message.n] = message.position[2]
        elif isinstance(message, MllmRequest):
            self._place_waypoint(message)
        elif isinstance(message, LanguageAction):
            self._departures[message.n] = t
            if message.tool == "backtrack":
                self._backtracks.append(message.n)
        elif isinstance(message, OccupancyMap):
            self.maps[message.n] = message
        elif isinstance(message, Goal):
            self._keep_goal(message)
        elif isinstance(message, NavigationStatus):
            if message.terminal and message.n in self._departures:
                self.legs[message.n] = (self._departures[message.n], t)

    def _keep_goal(self, goal: Goal) -> None:
        if goal.kind == "go" and goal.p_WG is not None:
            self.goals.append(goal.p_WG[:2])
            self._goal_heights.append(goal.p_WG[2])

    def _place_waypoint(self, request: MllmRequest) -> None:
        if isinstance(request.variables, LanguageVariables) and request.n in self.poses:
            waypoint = request.variables.current_waypoint
            self.waypoints.setdefault(waypoint, self.poses[request.n][:2])
            self._waypoint_heights.setdefault(waypoint, self._heights[request.n])
