"""What the robot sees: frames, panoramas and the sweep that captures them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages.frozen import Message, read_only
from unilavira_drake.messages.plans import ON_THE_WAY

DIRECTIONS = ("front", "left", "right", "back")
"""The four words of the language action, in the order in which they are offered."""

DOWN = "down"
"""The fifth view of an aircraft (paper V, OpenUAV): straight down, the top of its picture to the
front.  It has no bearing."""

VIEW_YAW = {"front": 0.0, "left": math.pi / 2, "back": math.pi, "right": -math.pi / 2}
"""Yaw of each view relative to ``front``, radians, counter-clockwise positive."""

SWEEP_ORDERS = {
    "left": ("front", "left", "back", "right"),
    "right": ("front", "right", "back", "left"),
}
"""The order in which a robot with one camera captures the views, by the side it turns to."""


def direction_of(bearing: float | None) -> str:
    """Returns the word nearest to a bearing to the left of ``front``, radians; None is ``down``."""
    if bearing is None:
        return DOWN
    return min(DIRECTIONS, key=lambda d: abs(math.remainder(bearing - VIEW_YAW[d], 2 * math.pi)))


@dataclass(frozen=True)
class Intrinsics(Message):
    """A pinhole camera: image size in pixels, focal lengths and principal point in pixels."""

    width: int = 1
    height: int = 1
    fx: float = 1.0
    fy: float = 1.0
    cx: float = 0.0
    cy: float = 0.0

    @property
    def horizontal_fov(self) -> float:
        """Horizontal field of view, radians."""
        return 2.0 * math.atan(self.width / (2.0 * self.fx))


@dataclass(frozen=True, eq=False)
class Frame(Message):
    """One RGB-D view.

    Camera frame C is Drake's: x right, y down, z forward.  ``label`` is the simulator's
    ground truth; only scoring and models that declare ``perception: ground_truth`` read it.
    """

    view: str = "front"
    time: float = 0.0
    color: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((1, 1, 3), np.uint8))
    """(H, W, 3) uint8 RGB."""
    depth: NDArray[np.float32] = field(default_factory=lambda: np.zeros((1, 1), np.float32))
    """(H, W) float32, metres along the camera's z; 0 = too near, inf = too far."""
    label: NDArray[np.int16] = field(default_factory=lambda: np.zeros((1, 1), np.int16))
    """(H, W) int16 render labels."""
    jpeg: bytes = b""
    """The colour image as JPEG, encoded once at capture."""
    intrinsics: Intrinsics = Intrinsics()
    X_WC: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    """(4, 4) float64 pose of the camera in the world, from the pose estimate at capture."""

    def __post_init__(self) -> None:
        for name in ("color", "depth", "label", "X_WC"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


@dataclass(frozen=True)
class Outcome(Message):
    """How the action of the previous number ended: ``arrived`` or ``failed`` and why."""

    state: str = "arrived"
    reason: str = ""
    remaining: float | None = None
    """Metres to what was aimed at after a drive; None without one."""
    height: float | None = None
    """In flight, of ``remaining``: how much higher than the robot it is, metres."""

    @property
    def words(self) -> str:
        """E.g. ``arrived``, ``failed: stuck``, or ``on the way`` for a part of a flight."""
        if self.reason == ON_THE_WAY:
            return ON_THE_WAY
        return f"{self.state}: {self.reason}" if self.reason else self.state


@dataclass(frozen=True, eq=False)
class Panorama(Message):
    """The views at one place, under the number ``n`` of the language call they serve.

    There are four; a panorama with a fifth one, ``down``, is an aircraft's.

    ``front`` is the heading at which the sweep started.  ``first`` is the number under which
    the same frames were first published: a robot that has not moved re-issues them.
    """

    n: int = 0
    first: int = 0
    time: float = 0.0
    X_WB: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    """(4, 4) float64 pose of the robot's base in the world; its yaw is that of ``front``."""
    frames: tuple[Frame, ...] = ()
    outcome: Outcome = Outcome()

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_WB", read_only(self.X_WB))

    @property
    def position(self) -> tuple[float, float, float]:
        """Position of the base in the world, metres."""
        return (float(self.X_WB[0, 3]), float(self.X_WB[1, 3]), float(self.X_WB[2, 3]))

    @property
    def yaw(self) -> float:
        """World yaw of ``front``, radians."""
        return math.atan2(self.X_WB[1, 0], self.X_WB[0, 0])

    @property
    def in_flight(self) -> bool:
        """Whether it has a view straight down."""
        return any(frame.view == DOWN for frame in self.frames)

    @property
    def directions(self) -> tuple[str, ...]:
        """The views that a language action may name here, in the order in which they are shown."""
        return (*DIRECTIONS, DOWN) if self.in_flight else DIRECTIONS

    def frame(self, view: str) -> Frame:
        """Returns the frame of a view.

        Raises:
            KeyError: if this panorama has no such view.
        """
        for frame in self.frames:
            if frame.view == view:
                return frame
        raise KeyError(f"panorama {self.n} has no view {view!r}")


@dataclass(frozen=True)
class Sweep(Message):
    """Turning in place to capture panorama ``n``: face ``heading`` (world yaw, radians)."""

    n: int = 0
    active: bool = False
    heading: float = 0.0
