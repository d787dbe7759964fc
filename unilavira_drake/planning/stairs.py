"""Stairs as a way: straight over them, slowly, until the robot stands on the next floor."""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Goal, Message

APPROACH = 0.35
"""Room between the robot's edge and the first step where it sets off, metres."""
CLIMB_SPEED = 0.3
"""m/s."""
LEAST_RISE = 2.0
"""A storey is higher than this and a landing halfway lower, metres."""
LEVEL = 0.05
"""A floor is level while its height changes no more than this, metres."""
CLEAR = 1.05
"""The robot has left the stairs after so much of level floor, metres ..."""
SHORT_CLEAR = 0.3
"""... or after this much where it cannot go on."""
PATIENCE = 2.0
"""Seconds without progress that show that it cannot."""
PROGRESS = 0.05
"""Metres."""
LONGEST_LEVEL = 3.0
"""After so much of level floor, and not a storey higher or lower, there are no stairs, metres."""
REACH = 15.0
"""Length of the longest flight, metres."""


@dc.dataclass(frozen=True)
class Climb(Message):
    """A flight of stairs that is being climbed or descended."""

    foot: tuple[float, float] = (0.0, 0.0)
    """Where the floor ends at its first step, metres."""
    heading: float = 0.0
    """Yaw of the way over it, radians."""
    up: bool = True
    begun: bool = False
    """Whether the robot has set off; before, it drives to the foot."""
    start: float = 0.0
    """Height of the floor where it set off, metres."""
    level: tuple[float, float] = (0.0, 0.0)
    """(distance along the way, height) since which the floor has been level, metres."""
    farthest: float = -math.inf
    """Along the way from the foot, metres."""
    progress_time: float = 0.0

    @staticmethod
    def of(goal: Goal) -> Climb:
        """Returns the flight of a goal ``climb`` or ``descend``."""
        assert goal.p_WG is not None
        assert goal.heading is not None
        return Climb(goal.p_WG[:2], goal.heading, goal.kind == "climb", start=goal.p_WG[2])

    def approach(self, radius: float) -> tuple[float, float]:
        """Returns where a robot of a radius sets off, metres."""
        return self._point(-(radius + APPROACH))

    def path(self, position: tuple[float, float]) -> NDArray[np.float64]:
        """Returns the (k, 2) way from a place onto the flight's axis and far along it, metres."""
        s = self.along(position)
        return np.array([position, self._point(min(s + 0.3, -0.1)), self._point(REACH)])

    def along(self, position: tuple[float, float]) -> float:
        """Returns the distance along the way beyond the foot, metres."""
        dx, dy = position[0] - self.foot[0], position[1] - self.foot[1]
        return math.cos(self.heading) * dx + math.sin(self.heading) * dy

    def set_off(self, position: tuple[float, float], z: float, time: float) -> Climb:
        """Returns the climb that begins at a place."""
        s = self.along(position)
        return dc.replace(self, begun=True, start=z, level=(s, z), farthest=s, progress_time=time)

    def at(self, position: tuple[float, float], z: float, time: float) -> Climb:
        """Returns the climb when the robot has come to a place."""
        s, climb = self.along(position), self
        if abs(z - climb.level[1]) > LEVEL:
            climb = dc.replace(climb, level=(s, z))
        if s >= climb.farthest + PROGRESS:
            climb = dc.replace(climb, farthest=s, progress_time=time)
        return climb

    def verdict(self, stuck_time: float, time: float) -> tuple[str, str]:
        """Returns (state, reason): ``moving``, ``arrived`` or ``failed``."""
        waited = time - self.progress_time
        rise = self.level[1] - self.start
        level = self.farthest - self.level[0]
        done = (rise if self.up else -rise) >= LEAST_RISE
        way = "up" if self.up else "down"
        if done and (level >= CLEAR or (level >= SHORT_CLEAR and waited >= PATIENCE)):
            return "arrived", f"one floor {way}"
        if level > LONGEST_LEVEL or self.farthest > REACH - 1.0:
            return "failed", f"no stairs {way} there: the floor is {rise:+.1f} m from the last one"
        if waited > stuck_time:
            where = "at the foot of" if abs(rise) < 0.1 else f"{abs(rise):.1f} m {way}"
            return "failed", f"stuck {where} the stairs"
        return "moving", ""

    def _point(self, s: float) -> tuple[float, float]:
        return (
            self.foot[0] + math.cos(self.heading) * s,
            self.foot[1] + math.sin(self.heading) * s,
        )
