"""One detection placed relative to the robot, and the exits made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.mllm.evidence import Detection


@dataclass(frozen=True)
class Sight:
    """One detection, placed relative to the robot: x ahead, y to the left, metres."""

    id: str
    category: str
    color: str
    room: str
    direction: str
    bearing: float
    """Degrees to the left of ``front``."""
    distance: float
    near: float
    """Distance to its nearest visible part on the floor, metres."""
    far: float
    """Distance to the farthest floor in view, for floors; metres."""
    pixels: int
    detection: Detection

    @property
    def position(self) -> tuple[float, float]:
        """(x ahead, y to the left), metres."""
        angle = math.radians(self.bearing)
        return self.distance * math.cos(angle), self.distance * math.sin(angle)

    @property
    def name(self) -> str:
        """The thing in words."""
        return f"{self.color} {self.category}".strip()


@dataclass(frozen=True)
class Exit:
    """A door, or the border to another room's floor where there is no door."""

    kind: str
    """Kind of the room behind; empty where its floor is not in view."""
    sight: Sight
    beyond: Sight | None = None
    """The floor behind."""


def angle_between(a: float, b: float) -> float:
    """Returns the unsigned angle between two bearings, degrees."""
    return abs(math.remainder(a - b, 360.0))


def inside(sight: Sight, door: Sight, margin: float = 12.0) -> bool:
    """Whether a sight lies in the columns of a door, as seen in the same view."""
    u_min, _, u_max, _ = door.detection.box
    u = sight.detection.point[0]
    return sight.direction == door.direction and u_min - margin <= u <= u_max + margin
