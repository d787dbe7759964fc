"""Where to go and how it goes: goal, path and navigation status."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages.frozen import Message, read_only

STAIR_KINDS = {"up": "climb", "down": "descend"}
"""Kind of goal by the argument of ``go_stair``."""

TERMINAL_STATES = ("arrived", "failed")
ALREADY_THERE = "already there"
"""Why an arrival was no drive: the robot stands beside the goal, or as near as it can get."""
NO_TARGET = "no target"
"""Begins the reason of a goal that no view gave: nothing was marked, or no place lies behind it."""
ON_THE_WAY = "on the way"
"""Why an arrival is not the end: what was marked lies farther on than one move goes."""


@dataclass(frozen=True)
class Goal(Message):
    """The one goal of language action ``n``: ``go`` to ``p_WG``, ``stay``, or ``none``.

    ``climb`` and ``descend`` are stairs that begin at ``p_WG`` and lead along ``heading``.
    ``none`` has a reason.  ``heading``, when given, is the world yaw at which the next sweep
    starts.
    """

    n: int = 0
    kind: str = "stay"
    p_WG: tuple[float, float, float] | None = None
    heading: float | None = None
    reason: str = ""
    pixel: tuple[float, float] | None = None
    """The representative pixel (u, v) of the selection, behind which ``p_WG`` lies; None for a
    goal that no view gave."""
    p_WT: tuple[float, float, float] | None = None
    """In flight: the point of the surface that was marked, which the aircraft does not fly into;
    None where ``p_WG`` is that point, or where it lies beyond the depth camera's range."""
    partial: bool = False
    """In flight: whether ``p_WG`` is only as far as one move goes, and the mark lies farther on."""


@dataclass(frozen=True)
class NavigationStatus(Message):
    """How goal ``n`` goes: ``moving``, ``arrived`` or ``failed``, and why.

    The initial value (0, arrived) starts the ring.
    """

    n: int = 0
    state: str = "arrived"
    reason: str = ""
    heading: float | None = None
    remaining: float | None = None
    """Metres straight from the robot to the goal's ``p_WG`` at the end of a drive; None without
    one.  What was marked may stand on a table: the robot arrives as near as there is room."""
    height: float | None = None
    """In flight, of ``remaining``: how much higher than the robot it is, metres."""

    @property
    def terminal(self) -> bool:
        """Whether goal ``n`` is done."""
        return self.state in TERMINAL_STATES


@dataclass(frozen=True, eq=False)
class Path(Message):
    """A polyline on the floor, or in the air, for goal ``n``; empty once the goal is done.

    Raises:
        ValueError: if a narrow segment is none of the path's.
    """

    n: int = 0
    version: int = 0
    """Counts the replans of this goal."""
    p_WP: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    """(k, 2) float64, in the air (k, 3), metres in the world, from the robot to the goal."""
    max_speed: float = math.inf
    """No faster than this, whatever the robot's limits, m/s: stairs are climbed slowly."""
    backwards: bool = False
    """Whether the robot goes it backwards, without turning, to get off where it is stuck."""
    narrow: tuple[int, ...] = ()
    """Segments, by the index of their first point, that lead straight through a gap in which an
    aircraft does not turn.  If the first one does, the aircraft is in that gap: it leaves it nose
    or tail first."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "p_WP", read_only(self.p_WP))
        for k in self.narrow:
            if not 0 <= k < len(self.p_WP) - 1:
                raise ValueError(f"narrow segment {k} is none of a path of {len(self.p_WP)} points")


@dataclass(frozen=True)
class Awaited(Message):
    """Since when a model's reply is awaited, simulated seconds; None: none is."""

    since: float | None = None
