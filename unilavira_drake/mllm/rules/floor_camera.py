"""How image rows and distances along the floor belong together, learned from the floor itself.

No calibration is told to a model, but every floor detection is one pair of pixel and distance.
Camera height and downward pitch are fitted to these pairs, so a bottom edge gives the distance
to the foot of a thing, and a distance gives a floor pixel.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from unilavira_drake.mllm.evidence import ViewEvidence

_USUAL_PITCH = 10
"""Degrees; what a lone pair is read with."""


@dataclass(frozen=True)
class FloorCamera:
    """A pinhole camera above a flat floor."""

    width: int
    height: int
    focal: float
    """Pixels."""
    above_floor: float = 1.0
    """Metres."""
    pitch: float = math.radians(_USUAL_PITCH)
    """Radians downward."""

    @classmethod
    def fit(cls, views: Iterable[ViewEvidence]) -> FloorCamera:
        """Returns the camera that explains the floor detections of some views best."""
        views = tuple(views)
        first = views[0] if views else ViewEvidence()
        focal = first.width / (2.0 * math.tan(first.horizontal_fov / 2.0))
        pairs = [
            (d.point, d.point_distance)
            for view in views
            for d in view.detections
            if d.category == "floor" and d.point_distance > 0.0
        ]
        best, best_error = cls(first.width, first.height, focal), math.inf
        for degrees in range(31):
            camera = cls(first.width, first.height, focal, 1.0, math.radians(degrees))
            ratios = sorted(
                distance / reach
                for (u, v), distance in pairs
                if math.isfinite(reach := camera.reach(u, v))
            )
            if not ratios:
                continue
            above = ratios[len(ratios) // 2]
            error = sum(abs(math.log(r / above)) for r in ratios) / len(ratios)
            error += 1e-3 * abs(degrees - _USUAL_PITCH)
            if error < best_error:
                best_error = error
                best = cls(first.width, first.height, focal, above, math.radians(degrees))
        return best

    def reach(self, u: float, v: float) -> float:
        """Returns the distance along the floor to where a pixel's ray meets it; inf if never."""
        right, down = (u - self.width / 2) / self.focal, (v - self.height / 2) / self.focal
        forward = math.cos(self.pitch) - down * math.sin(self.pitch)
        descent = math.sin(self.pitch) + down * math.cos(self.pitch)
        if descent <= 1e-3:
            return math.inf
        return self.above_floor * math.hypot(forward, right) / descent

    def row(self, u: float, distance: float) -> float:
        """Returns the image row of the floor at a distance in a column, clipped to the image."""
        low, high = 0.0, float(self.height - 1)
        for _ in range(20):
            middle = (low + high) / 2
            if self.reach(u, middle) > distance:
                low = middle
            else:
                high = middle
        return high
