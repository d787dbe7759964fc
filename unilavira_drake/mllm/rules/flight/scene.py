"""What is around an aircraft now, in its own frame, from the detections of its five views.

The cameras are level, or look straight down with the top of the picture to the front; all the rest
is the pinhole's geometry and the measured free distances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import DOWN, VIEW_YAW
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import ViewNote
from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.words import (
    GROUND,
    landmark_class,
    landmark_match,
    looks,
)
from unilavira_drake.mllm.rules.vocabulary import color_name

BESIDE = 20.0
"""Two things nearer to each other than this stand side by side, metres."""
SURE = 35.0
"""Farther than this the depth camera's range may end: places are not compared, metres."""
_CENTER = 0.15
"""What reaches this share of the down view's middle is straight below."""
_OFF_CENTER = 30.0
"""Nearer to the middle of the down view a distance tells no depth, pixels."""


@dataclass(frozen=True)
class LandmarkSight:
    """One thing seen from the air."""

    id: str
    category: str
    color: str
    direction: str
    bearing: float
    """Degrees to the left of ``front``."""
    distance: float
    """Metres along the ground."""
    drop: float
    """Metres by which it lies below the aircraft; below zero: above it."""
    below: bool
    """Whether it is straight below."""
    detection: Detection

    @property
    def name(self) -> str:
        """The thing in words."""
        return f"{self.color} {self.category}".strip()

    @property
    def away(self) -> float:
        """Metres through the air."""
        return math.hypot(0.0 if self.below else self.distance, self.drop)

    @property
    def position(self) -> tuple[float, float]:
        """(x ahead, y to the left), metres."""
        angle = math.radians(self.bearing)
        return self.distance * math.cos(angle), self.distance * math.sin(angle)


@dataclass(frozen=True)
class AirScene:
    """The five views as the reasoner sees them."""

    sights: tuple[LandmarkSight, ...]
    free: dict[str, float]
    """Measured free distance along each view's axis, metres."""

    @property
    def height(self) -> float:
        """Metres above what is straight below."""
        return self.free.get(DOWN, 0.0)

    @property
    def ground(self) -> str:
        """What is straight below, in words."""
        below = [s for s in self.sights if s.below]
        return min(below, key=lambda s: (s.detection.pixels, s.id)).name if below else ""

    def matching(self, leg: Leg) -> list[LandmarkSight]:
        """Returns the things a leg means, best match of class and colour only, nearest first."""
        found = [
            ((-landmark_match(leg.landmark, s.category), -_looks(leg, s)), s.away, i)
            for i, s in enumerate(self.sights)
            if landmark_match(leg.landmark, s.category)
            and _looks(leg, s)
            and (not leg.beside or self._stands_beside(s, leg.beside))
        ]
        best = min((rank for rank, _, _ in found), default=(0, 0))
        return [self.sights[i] for rank, _, i in sorted(found) if rank == best]

    def _stands_beside(self, sight: LandmarkSight, landmark: str) -> bool:
        marks = [s for s in self.sights if landmark_match(landmark, s.category)]
        if sight.distance > SURE:
            return not marks or any(m.direction == sight.direction for m in marks)
        return any(
            math.dist(sight.position, m.position) <= BESIDE or m.category in GROUND for m in marks
        )


def _looks(leg: Leg, sight: LandmarkSight) -> int:
    return looks(leg.color, leg.roof, sight.color, above=sight.direction == DOWN)


def look_around(views: Sequence[ViewEvidence], notes: Sequence[ViewNote]) -> AirScene:
    """Returns the scene of one panorama."""
    free = {note.direction: note.free_distance for note in notes}
    sights = tuple(_sight(d, view, free) for view in views for d in view.detections)
    return AirScene(sights, free)


def _sight(d: Detection, view: ViewEvidence, free: dict[str, float]) -> LandmarkSight:
    focal = view.width / (2.0 * math.tan(view.horizontal_fov / 2.0))
    u, v = d.point
    right, low = u - view.width / 2.0, v - view.height / 2.0
    category = landmark_class(d.room if d.category == "floor" and d.room else d.category)
    below = False
    distance = d.point_distance
    if view.direction == DOWN:
        bearing = math.degrees(math.atan2(-right, -low))
        off = math.hypot(right, low)
        drop = focal * d.point_distance / off if off > _OFF_CENTER else free.get(DOWN, 0.0)
        below = _holds_center(d, view)
    else:
        bearing = math.degrees(VIEW_YAW[view.direction] + view.bearing(u))
        distance = d.distance if category not in GROUND else d.point_distance
        drop = distance * math.cos(math.atan2(right, focal)) * low / focal
    return LandmarkSight(
        id=d.id,
        category=category,
        color=color_name(d.color),
        direction=view.direction,
        bearing=math.remainder(bearing, 360.0),
        distance=distance,
        drop=drop,
        below=below,
        detection=d,
    )


def _holds_center(d: Detection, view: ViewEvidence) -> bool:
    u, v, margin = view.width / 2.0, view.height / 2.0, _CENTER * view.width
    u_min, v_min, u_max, v_max = d.box
    return u_min - margin <= u <= u_max + margin and v_min - margin <= v <= v_max + margin
