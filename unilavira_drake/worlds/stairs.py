"""Flights of stairs: where they lie, how high each point of them is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from unilavira_drake.messages import Message

HEADINGS = {"east": 0.0, "north": math.pi / 2, "west": math.pi, "south": -math.pi / 2}
"""Yaw of the way up, radians."""

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True)
class Stairs(Message):
    """A straight flight, with or without a level landing halfway, between two storeys.

    ``s`` is the distance along the way up from its first riser.  The last tread is level with the
    floor above.
    """

    name: str = ""
    rooms: tuple[str, str] = ("", "")
    """Names of the rooms below and above."""
    rectangle: Rectangle = (0.0, 0.0, 1.0, 1.0)
    """(x_min, y_min, x_max, y_max), metres; the floor above is open there."""
    heading: float = 0.0
    """Yaw of the way up, radians; a multiple of a quarter turn."""
    bottom: float = 0.0
    """Height of the floor below, metres."""
    top: float = 2.8
    """Height of the floor above, metres."""
    steps: int = 15
    """Risers."""
    landing: float = 0.0
    """Length of the landing halfway, metres."""
    material: str = "oak"
    color: str = "white"

    @property
    def length(self) -> float:
        """Along the way up, metres."""
        x_min, y_min, x_max, y_max = self.rectangle
        return x_max - x_min if self._along_x else y_max - y_min

    @property
    def width(self) -> float:
        """Across the way up, metres."""
        x_min, y_min, x_max, y_max = self.rectangle
        return y_max - y_min if self._along_x else x_max - x_min

    @property
    def tread(self) -> float:
        """Depth of a tread, metres."""
        return (self.length - self.landing) / self.steps

    @property
    def foot(self) -> tuple[float, float]:
        """Middle of the first riser, metres."""
        return self.point(0.0)

    @property
    def head(self) -> tuple[float, float]:
        """Middle of the edge where the last tread ends, metres."""
        return self.point(self.length)

    @property
    def profile(self) -> tuple[tuple[float, float], ...]:
        """(s, height) of the corners of the line along which a robot climbs, metres.

        It rises evenly from the first riser to the last tread, but for the landing.
        """
        rise, middle = self.top - self.bottom, self.steps // 2
        last = (self.length - self.tread, self.top)
        if not self.landing:
            return ((0.0, self.bottom), last)
        halfway = self.bottom + rise * middle / self.steps
        return (
            (0.0, self.bottom),
            ((middle - 1) * self.tread, halfway),
            (middle * self.tread + self.landing, halfway),
            last,
        )

    def point(self, s: float, across: float = 0.0) -> tuple[float, float]:
        """Returns (x, y) at a distance along the way up and to the left of its middle, metres."""
        x_min, y_min, x_max, y_max = self.rectangle
        c, q = round(math.cos(self.heading)), round(math.sin(self.heading))
        along = s - self.length / 2
        return (
            (x_min + x_max) / 2 + c * along - q * across,
            (y_min + y_max) / 2 + q * along + c * across,
        )

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies over the flight."""
        x_min, y_min, x_max, y_max = self.rectangle
        return x_min <= x < x_max and y_min <= y < y_max

    def along(self, x: float, y: float) -> float:
        """Returns ``s`` of a point, metres."""
        x_foot, y_foot = self.foot
        c, q = round(math.cos(self.heading)), round(math.sin(self.heading))
        return c * (x - x_foot) + q * (y - y_foot)

    def height(self, x: float, y: float) -> float:
        """Returns the height at which a robot stands there, metres."""
        corners = self.profile
        s = self.along(x, y)
        return float(np.interp(s, [s for s, _ in corners], [z for _, z in corners]))

    def treads(self) -> tuple[tuple[float, float, float], ...]:
        """Returns (begin, end, height) of each tread, from the lowest up, metres."""
        found, s = [], 0.0
        for index in range(1, self.steps + 1):
            halfway = self.landing if index == self.steps // 2 else 0.0
            end = s + self.tread + halfway
            height = self.bottom + (self.top - self.bottom) * index / self.steps
            found.append((s, end, height))
            s = end
        return tuple(found)

    @property
    def _along_x(self) -> bool:
        return abs(math.cos(self.heading)) > 0.5
