"""What a detector could tell about one view; only models declared ``ground_truth`` get it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.messages import Message


@dataclass(frozen=True)
class Detection(Message):
    """One visible thing in one view: no identity across views, no pose in the world."""

    id: str = ""
    """Unique within one panorama only, e.g. ``left#3``."""
    category: str = ""
    """Class name: furniture, ``door``, ``floor``, ``wall``, ..."""
    color: str = ""
    """Colour word from the pixels."""
    room: str = ""
    """Kind of room, for ``floor`` only: known where that floor is visible."""
    score: float = 1.0
    box: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """(u_min, v_min, u_max, v_max), pixels."""
    point: tuple[float, float] = (0.0, 0.0)
    """(u, v) of a pixel well inside the visible region."""
    pixels: int = 0
    """How many pixels are visible."""
    distance: float = 0.0
    """Median range along the floor from the camera, metres."""
    point_distance: float = 0.0
    """Range along the floor from the camera to ``point``, metres."""


@dataclass(frozen=True)
class ViewEvidence(Message):
    """The detections of one view of the panorama."""

    direction: str = "front"
    width: int = 640
    height: int = 480
    horizontal_fov: float = math.radians(79.0)
    """Radians."""
    detections: tuple[Detection, ...] = ()

    def bearing(self, u: float) -> float:
        """Returns the angle of an image column to the left of this view's axis, radians."""
        focal = self.width / (2.0 * math.tan(self.horizontal_fov / 2.0))
        return math.atan2(self.width / 2.0 - u, focal)
