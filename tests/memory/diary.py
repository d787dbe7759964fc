"""Random walks among a few places, and a diary of them that forgets nothing.

The diary is the oracle of the waypoint memory: it holds every leg of the walk with its pictures
and knows nothing of buffers, eviction or how edges are kept.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass, field

import numpy as np

from unilavira_drake.memory.waypoints import (
    MemoryBounds,
    Sight,
    WaypointState,
    remember,
    with_picture,
)
from unilavira_drake.messages import (
    DIRECTIONS,
    VIEW_YAW,
    LanguageAction,
    Outcome,
    Panorama,
    VisionAction,
    Waypoint,
)

PLACES = ((0.0, 0.0), (3.0, 0.0), (3.0, 2.5), (0.0, 3.0), (-2.5, 0.5), (6.0, -1.0), (1.0, -3.0))
"""Metres; each two are farther apart than waypoints that are merged."""


@dataclass
class Leg:
    """What happened after one ``turn``."""

    n: int
    waypoint: int
    """Where it was decided."""
    bearing: float
    """World yaw, radians."""
    outcome: str
    left: bool
    """Whether the robot was elsewhere when it was over."""
    back: int = 0
    """The panorama with which it first was at the waypoint again; 0: not yet."""
    given_up: bool = False
    """Whether a backtrack brought it back although the leg had arrived."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the waypoint, metres."""

    @property
    def failed(self) -> bool:
        return self.given_up or self.outcome.startswith("failed")


@dataclass
class Walk:
    """A robot among places, its memory, and the diary."""

    bounds: MemoryBounds
    state: WaypointState = field(default_factory=WaypointState)
    legs: list[Leg] = field(default_factory=list)
    pictures: dict[bytes, float] = field(default_factory=dict)
    """Every picture, and when it was taken: n is panorama n, n + 0.5 the way after action n."""
    panorama: Panorama = field(default_factory=Panorama)
    action: LanguageAction = field(default_factory=LanguageAction)
    place: int = 0

    def start(self, yaw: float = 0.0) -> None:
        """Captures the first panorama."""
        self._capture(PLACES[0], yaw, Outcome())

    def turn(
        self, direction: str, place: int, *, yaw: float = 0.0, shift: float = 0.0,
        reason: str = "", seen: int = 1,
    ) -> None:  # fmt: skip
        """Drives to another place; with a reason that is where it got stuck."""
        if place == self.place:
            place = (place + 1) % len(PLACES)
        self._decide("turn", direction=direction)
        for i in range(seen):
            words = f"way {self.action.n}.{i}".encode()
            self.pictures[words] = self.action.n + 0.5
            self.state = with_picture(
                self.state, sight(words), n=self.action.n,
                waypoint=self.state.history.current, direction=direction,
            )  # fmt: skip
        x, y = PLACES[place]
        self.place = place
        self._capture((x + shift, y - shift), yaw, outcome(reason))

    def turn_in_vain(self, direction: str) -> None:
        """Chooses a direction in which there is no way."""
        self._decide("turn", direction=direction)
        self._reissue(outcome("unreachable"))

    def turn_to_here(self, direction: str) -> None:
        """Chooses something beside which the robot already stands."""
        self._decide("turn", direction=direction)
        self._reissue(Outcome("arrived", "already there"))

    def back(self, waypoint: int, *, yaw: float = 0.0, shift: float = 0.0) -> None:
        """Drives back to a waypoint and arrives, not quite on its spot."""
        self._decide("backtrack", waypoint=waypoint)
        note = self.state.history.waypoint(waypoint)
        assert note is not None
        x, y, _ = note.position
        self.place = nearest_place(x, y)
        self._capture((x + shift, y + shift), yaw, Outcome())

    def back_in_vain(self, waypoint: int) -> None:
        """Cannot drive back: no way is known."""
        self._decide("backtrack", waypoint=waypoint)
        self._reissue(outcome("unreachable"))

    def back_stuck(self, waypoint: int, place: int, *, yaw: float = 0.0) -> None:
        """Gets stuck somewhere on the way back."""
        self._decide("backtrack", waypoint=waypoint)
        self.place = place
        self._capture(PLACES[place], yaw, outcome("stuck"))

    def wait(self) -> None:
        """Does something without a move, such as a rejected stop."""
        self._decide("double_check")
        self._reissue(Outcome())

    def _come_again(self) -> None:
        """What failed from a place that left the buffer is of its new waypoint, if it gets one."""
        remembered = {w.id: w.position for w in self.state.history.waypoints}
        for leg in self.legs:
            for number, position in remembered.items():
                if (
                    leg.failed
                    and leg.waypoint not in remembered
                    and math.dist(position, leg.position) < self.bounds.merge_distance
                ):
                    leg.waypoint = number

    def last_leg(self, waypoint: int) -> Leg | None:
        """Returns the leg by which the robot last left a waypoint."""
        return next((x for x in reversed(self.legs) if x.waypoint == waypoint and x.left), None)

    def pictures_of(self, leg: Leg) -> set[bytes]:
        """Returns what was seen between leaving a waypoint and being there again."""
        end = leg.back or math.inf
        return {jpeg for jpeg, time in self.pictures.items() if leg.n < time < end}

    def _decide(self, tool: str, direction: str = "", waypoint: int | None = None) -> None:
        n = self.panorama.n
        self.action = LanguageAction(n, "decide", tool, direction, waypoint, scene=f"place {n}")

    def _reissue(self, outcome: Outcome) -> None:
        self._remember(dataclasses.replace(self.panorama, n=self.panorama.n + 1, outcome=outcome))

    def _capture(self, position: tuple[float, float], yaw: float, outcome: Outcome) -> None:
        n = self.panorama.n + 1
        X_WB = np.eye(4)
        X_WB[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        X_WB[:2, 3] = position
        self._remember(Panorama(n=n, first=n, X_WB=X_WB, outcome=outcome))

    def _remember(self, panorama: Panorama) -> None:
        words = f"front {panorama.n}".encode()
        old, action = self.state, self.action
        vision = VisionAction(n=action.n, target_desc=f"target {action.n}")
        self.state = remember(old, panorama, action, vision, sight(words), self.bounds)
        self.panorama = panorama
        if any(picture.jpeg == words for picture in self.state.pictures):
            self.pictures[words] = panorama.n
        self._write(old.history.waypoint(old.history.current), old.yaw)

    def _write(self, before: Waypoint | None, yaw: float) -> None:
        now, told = self.state.history.current, self.panorama.outcome
        if self.action.tool == "turn":
            assert before is not None
            bearing = yaw + VIEW_YAW[self.action.direction]
            said = f"{told.state}: {told.reason}" if told.reason else told.state
            self.legs.append(
                Leg(
                    self.action.n, before.id, bearing, said,
                    left=now != before.id, position=before.position,
                )
            )  # fmt: skip
        self._come_again()
        if self.action.tool == "backtrack" and told.state == "arrived":
            leg = self.last_leg(now)
            if leg is not None and leg.outcome.startswith("arrived"):
                leg.given_up = True
        for leg in self.legs:
            if leg.waypoint == now and leg.left and not leg.back:
                leg.back = self.panorama.n


def outcome(reason: str) -> Outcome:
    return Outcome("failed", reason) if reason else Outcome()


def nearest_place(x: float, y: float) -> int:
    return min(range(len(PLACES)), key=lambda i: math.dist(PLACES[i], (x, y)))


@functools.lru_cache(maxsize=1024)
def sight(words: bytes) -> Sight:
    """Returns a picture that looks like no other: its look is noise drawn from its words."""
    generator = np.random.default_rng(list(words))
    return Sight(words, generator.integers(0, 256, 768, np.uint8).tobytes())


def word_of(bearing: float, yaw: float) -> str:
    """Returns the view of a panorama with this yaw in which a bearing lies."""
    angle = {d: math.remainder(bearing - yaw - VIEW_YAW[d], 2 * math.pi) for d in DIRECTIONS}
    return min(DIRECTIONS, key=lambda d: abs(angle[d]))
