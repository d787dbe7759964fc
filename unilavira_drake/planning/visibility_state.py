"""What the flight planner remembers of one goal, and how it ends."""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np

from unilavira_drake.messages import Message, NavigationStatus, Path
from unilavira_drake.planning.visibility import Point
from unilavira_drake.planning.visibility_space import FlightSpace


@dc.dataclass(frozen=True, eq=False)
class VisibilityPlannerState(Message):
    """Status and path of one goal, and what it takes to watch its progress."""

    status: NavigationStatus = NavigationStatus()
    path: Path = dc.field(default_factory=Path)
    heading: float | None = None
    target: Point = (0.0, 0.0, 0.0)
    """The selected point before snapping, metres."""
    mark: Point | None = None
    """The point of the surface that was marked, metres; None where none is known."""
    reason: str = ""
    """Why an arrival is not the end of the way."""
    viewpoint: Point = (0.0, 0.0, 0.0)
    """Where the aircraft was when the goal was given, metres."""
    space: FlightSpace = dc.field(default_factory=FlightSpace)
    """Where it may fly, by the latest map that was looked at."""
    tight: FlightSpace = dc.field(default_factory=FlightSpace)
    """The same for the search for gaps, by the map in which gaps were looked for last."""
    map_version: int = 0
    """Version of the map of the latest plan."""
    plan_time: float = 0.0
    progress_time: float = 0.0
    least_remaining: float = math.inf
    position: Point = (0.0, 0.0, 0.0)
    """Where travel was last added up, metres."""
    travelled: float = 0.0
    budget: float = 0.0
    came: tuple[Point, ...] = ()
    """Places that the aircraft came by, the latest first, metres."""
    recoveries: int = 0
    """How often it has backed off on the way to this goal."""


def no_path(n: int) -> Path:
    """Returns the empty path of goal n."""
    return Path(n, p_WP=np.zeros((0, 3)))


def arrived(
    state: VisibilityPlannerState, position: Point, heading: float | None
) -> VisibilityPlannerState:
    """Returns the terminal state of an arrival, with how far the mark still is."""
    terminal = done(state, state.status.n, "arrived", state.reason, heading)
    if state.mark is None:
        return terminal
    away, height = math.dist(position, state.mark), state.mark[2] - position[2]
    status = dc.replace(terminal.status, remaining=away, height=height)
    return dc.replace(terminal, status=status)


def done(
    state: VisibilityPlannerState, n: int, outcome: str, reason: str, heading: float | None
) -> VisibilityPlannerState:
    """Returns the terminal state of goal n: its status and the empty path, in one message."""
    return VisibilityPlannerState(
        status=NavigationStatus(n, outcome, reason, heading),
        path=no_path(n),
        space=state.space,
        tight=state.tight,
        came=state.came,
    )
