"""What an auxiliary grounder made of a vision action."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.messages.actions import VisionAction
from unilavira_drake.messages.frozen import Message

Box = tuple[float, float, float, float]
"""(u_min, v_min, u_max, v_max), pixels of a view."""


@dataclass(frozen=True)
class Candidate(Message):
    """One thing in a view that may be what a target's description means.

    Raises:
        ValueError: if a number is not finite, the box is empty or the score is not in [0, 1].
    """

    box: Box = (0.0, 0.0, 1.0, 1.0)
    score: float = 1.0
    """How surely it is the thing described, from 0 to 1."""
    point: tuple[float, float] | None = None
    """(u, v) of a pixel on the thing, for one that does not fill its box; None: the box."""

    def __post_init__(self) -> None:
        # A detector counts in numpy's numbers.
        u_min, v_min, u_max, v_max = (float(value) for value in self.box)
        object.__setattr__(self, "box", (u_min, v_min, u_max, v_max))
        object.__setattr__(self, "score", float(self.score))
        if self.point is not None:
            object.__setattr__(self, "point", (float(self.point[0]), float(self.point[1])))
        if not all(math.isfinite(value) for value in (*self.box, *(self.point or ()))):
            raise ValueError(f"candidate: {self.box}, {self.point} must be finite")
        if not (u_min < u_max and v_min < v_max):
            raise ValueError(f"candidate: {self.box} must be (u_min, v_min, u_max, v_max)")
        if not 0.0 <= self.score <= 1.0:
            raise ValueError(f"candidate: the score {self.score} must be from 0 to 1")


@dataclass(frozen=True)
class Grounding(Message):
    """Vision action ``n`` as the ring goes on with it, and how it came about."""

    n: int = 0
    action: VisionAction = VisionAction()
    """The model's own, or with another box or point in the same view."""
    doubt: str = ""
    """``low confidence``, ``large region`` or ``too close``; empty: the grounder was not asked."""
    candidates: tuple[Candidate, ...] = ()
    """What the grounder found, best first; only the first eight."""
    refined: bool = False
    """Whether the first candidate took the place of the model's mark."""
    reason: str = ""
    """Why the model's own mark stays although it was doubted; else empty."""
