"""Several storeys: one map for each floor, chosen by the height at which the robot stands.

A storey is recognized by the height of its floor.  On the way to a height where none is known yet,
up stairs or a ramp, a new storey begins whose height follows the robot; once the robot has driven
some way on level floor, that is the storey's height for good.  So a flight of stairs belongs to
the storey to which it led first.
"""

from __future__ import annotations

import dataclasses as dc
import math

from unilavira_drake.messages import Message, OccupancyMap

SAME_STOREY = 1.2
"""Floors whose heights differ by up to this belong to one storey, metres: steps, ramps and a
platform do, the next floor of a house does not."""

LEVEL = 0.05
"""A floor is level while its height changes no more than this, metres."""

SETTLING_TRAVEL = 1.0
"""A new storey has its height after so much of level floor, metres; no landing's length."""


@dc.dataclass(frozen=True)
class Storey(Message):
    """The map of one storey."""

    height: float = 0.0
    """z of its floor in the world, metres."""
    settled: bool = True
    """Whether its height is known, not just that of the robot on its way."""
    occupancy: OccupancyMap = OccupancyMap()


@dc.dataclass(frozen=True)
class Storeys(Message):
    """All storeys, in the order in which they were found."""

    known: tuple[Storey, ...] = ()
    current: int = 0
    """Index of the one where the robot is."""
    level_since: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """(x, y) where the floor has been level since, and its height, metres."""

    @property
    def occupancy(self) -> OccupancyMap:
        """The map of the storey where the robot is; an empty one before the first."""
        return self.known[self.current].occupancy if self.known else OccupancyMap()

    def level_travel(self, place: tuple[float, float, float]) -> float:
        """Returns how far the floor has been level up to a place of the feet, metres."""
        if abs(place[2] - self.level_since[2]) > LEVEL:
            return 0.0
        return math.dist(place[:2], self.level_since[:2])

    def mapped(self, occupancy: OccupancyMap) -> Storeys:
        """Returns the storeys with another map where the robot is."""
        here = dc.replace(self.known[self.current], occupancy=occupancy)
        return self._changed(self.current, here)

    def at(self, floor_height: float, position: tuple[float, float]) -> Storeys:
        """Returns the storeys when the robot stands at a place; a new one where none is known.

        Args:
            floor_height: z of the floor under the robot in the world, metres; if it is not
                finite, nothing changes.
            position: (x, y) of the robot, metres.
        """
        if not all(map(math.isfinite, (floor_height, *position))):
            return self
        if not self.known:
            first = Storey(floor_height)
            return dc.replace(self, known=(first,), level_since=(*position, floor_height))
        moved = self
        if abs(floor_height - self.level_since[2]) > LEVEL:
            moved = dc.replace(self, level_since=(*position, floor_height))
        return moved._entered(floor_height, position)

    def _entered(self, floor_height: float, position: tuple[float, float]) -> Storeys:
        index = self._nearest(floor_height, settled=True)
        if index is not None:
            return self if index == self.current else dc.replace(self, current=index)
        here = self.known[self.current]
        if not here.settled:
            travel = math.dist(position, self.level_since[:2])
            settled = travel >= SETTLING_TRAVEL
            return self._changed(
                self.current, dc.replace(here, height=floor_height, settled=settled)
            )
        index = self._nearest(floor_height, settled=False)
        if index is not None:
            return dc.replace(self, current=index)
        found = Storey(floor_height, settled=False)
        return dc.replace(self, known=(*self.known, found), current=len(self.known))

    def _nearest(self, floor_height: float, *, settled: bool) -> int | None:
        """Returns the storey of about this height, the present one first."""
        near = [
            (index != self.current, abs(storey.height - floor_height), index)
            for index, storey in enumerate(self.known)
            if storey.settled == settled and abs(storey.height - floor_height) <= SAME_STOREY
        ]
        return min(near)[2] if near else None

    def _changed(self, index: int, storey: Storey) -> Storeys:
        known = (*self.known[:index], storey, *self.known[index + 1 :])
        return dc.replace(self, known=known)
