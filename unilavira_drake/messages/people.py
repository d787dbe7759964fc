"""People near the robot: the truth, and what a tracker makes of pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.messages.frozen import Message


@dataclass(frozen=True)
class PersonTruth(Message):
    """One person as they really are; for scoring only."""

    name: str = ""
    position: tuple[float, float] = (0.0, 0.0)
    """Of the body's middle in the world, metres."""
    yaw: float = 0.0
    """Radians."""
    gap: float = math.inf
    """Metres from the robot's footprint to the body; 0 when they touch or overlap,
    inf while it is on another storey or above their heads."""
    touched: bool = False
    """Whether robot and person press on each other just now."""


@dataclass(frozen=True)
class PeopleTruth(Message):
    """All people of the world at one moment."""

    people: tuple[PersonTruth, ...] = ()

    @property
    def gap(self) -> float | None:
        """The least of their gaps; None where there is nobody."""
        return min((person.gap for person in self.people), default=None)

    @property
    def touched(self) -> bool:
        """Whether the robot touches anybody."""
        return any(person.touched for person in self.people)


@dataclass(frozen=True)
class PersonTrack(Message):
    """What was made of the latest pictures of one person."""

    label: int = 0
    """Tells people apart, and nothing else."""
    color: str = ""
    """Colour word of the clothes."""
    position: tuple[float, float] = (0.0, 0.0)
    """In the world, metres."""
    velocity: tuple[float, float] | None = None
    """Metres a second in the world; None after a single look."""
    time: float = 0.0
    """Of the latest look, seconds."""


@dataclass(frozen=True)
class PeopleTracks(Message):
    """The people that were seen lately, in the order of their labels."""

    tracks: tuple[PersonTrack, ...] = ()
