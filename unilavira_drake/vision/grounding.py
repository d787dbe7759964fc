"""When the model's mark is doubted, and which candidate of a grounder takes its place.

The paper names an auxiliary grounder for uncertain marks as future work (ii).  A mark is doubted
for one of three reasons:

* ``low confidence``: the model gave one, and it is below the bound.
* ``large region`` ("the hallway"): the box covers much of the view and has no one depth.  A thing
  seen from near covers as much, but its box means one place.
* ``too close``: the marked spot is nearly under the robot, so going there changes nothing.  Whether
  the task ends there is not known here, but whether the described thing *is* there can be looked
  up: if a candidate lies under the mark and is as close, the mark is right and stays.

What a grounder finds is taken only if it is sure enough (the same bound), has a depth in range, is
not itself too close, lies in or near the mark (anywhere in the view if the mark is too close) and,
for a large region, is more definite than it.  In every other case the model's own mark stays.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.projection import Projection, project_box, project_point
from unilavira_drake.messages import Candidate, Frame, Grounding, Message, VisionAction
from unilavira_drake.messages.grounding import Box

Detect = Callable[[NDArray[np.uint8], NDArray[np.float32], str, Box], Sequence[Candidate]]
"""A detector on pictures: (H, W, 3) uint8 RGB, (H, W) float32 metres along the camera's z (0 = too
near, inf = too far), the target's description and where the model marked it -> candidates.  It must
be a pure function: the same pictures and words, the same candidates."""

Propose = Callable[[Frame, str, Box], Sequence[Candidate]]
"""A grounder: the chosen view, the target's description and the mark -> candidates."""

POINT_EXTENT = 0.25
"""A point stands for a square around it, this share of the view's width."""
REGION_DEPTH = 1.0
"""A box whose depths (20% to 80%) differ by more is a region and no thing, metres."""
CANDIDATES_KEPT = 8

NOTHING_FOUND = "the grounder found nothing"
NOTHING_BETTER = "nothing that the grounder found is surer, farther or more definite"
IT_IS_HERE = "the target is this close"


@dataclasses.dataclass(frozen=True)
class GroundingLimits(Message):
    """From where on a mark is doubted and a candidate taken."""

    confidence: float = 0.5
    """Bound for the model's confidence and for a candidate's score."""
    region: float = 0.4
    """Share of the view that a larger box covers as a region."""
    nearest: float = 0.6
    """From the middle of the robot along the floor, metres."""
    max_range: float = 10.0
    """Largest usable depth, metres."""


def from_pictures(detect: Detect) -> Propose:
    """Returns a grounder that shows a detector the pictures of the view and nothing else."""

    def propose(frame: Frame, target_desc: str, box: Box) -> Sequence[Candidate]:
        return detect(frame.color, frame.depth, target_desc, box)

    return propose


def ground(
    action: VisionAction,
    frame: Frame,
    position: tuple[float, float, float],
    propose: Propose,
    limits: GroundingLimits,
) -> Grounding:
    """Returns a vision action with what a grounder says about its mark.

    Args:
        action: of the model; one without a mark or a description passes as it is.
        frame: the view in which it marks.
        position: of the robot's base in the world, metres.
        propose: the grounder; asked only if the mark is doubted.
        limits: the bounds.
    """
    kept = Grounding(n=action.n, action=action)
    mark = _mark(action, frame)
    if mark is None or not action.target_desc:
        return kept
    spot = _spot(action.box, action.point, frame, limits)
    doubt = _doubt(action, _floor_distance(spot, position), frame, limits)
    if not doubt:
        return kept
    pixel = spot.pixel or ((mark[0] + mark[2]) / 2, (mark[1] + mark[3]) / 2)
    candidates = propose(frame, action.target_desc, mark)
    found = _found(candidates, frame, position, pixel, limits)
    best = tuple(one.candidate for one in found[:CANDIDATES_KEPT])
    kept = dataclasses.replace(kept, doubt=doubt, candidates=best, reason=NOTHING_FOUND)
    if not found:
        return kept
    if doubt == "too close" and any(one.is_here(limits) for one in found):
        return dataclasses.replace(kept, reason=IT_IS_HERE)
    for one in found:
        if one.is_better(doubt, mark, frame, limits):
            return _refined(kept, one.candidate)
    return dataclasses.replace(kept, reason=NOTHING_BETTER)


def _found(
    candidates: Sequence[Candidate],
    frame: Frame,
    position: tuple[float, float, float],
    marked: tuple[float, float],
    limits: GroundingLimits,
) -> list[_Found]:
    """Returns what lies in the view, best first."""
    found = []
    for candidate in candidates:
        seen = _clipped(candidate, frame)
        if seen is not None:
            place = _spot(None if seen.point else seen.box, seen.point, frame, limits)
            found.append(_Found(seen, _floor_distance(place, position), marked))
    return sorted(found, key=lambda one: one.rank)


@dataclasses.dataclass(frozen=True)
class _Found:
    """A candidate, its place and the pixel that stands for the model's mark."""

    candidate: Candidate
    distance: float
    """Metres along the floor from the robot; infinite without a usable depth."""
    marked: tuple[float, float]

    @property
    def middle(self) -> tuple[float, float]:
        u_min, v_min, u_max, v_max = self.candidate.box
        return self.candidate.point or ((u_min + u_max) / 2, (v_min + v_max) / 2)

    @property
    def rank(self) -> tuple[float, ...]:
        """The surer one first, then the one nearer to the mark."""
        off = math.dist(self.middle, self.marked)
        return (-self.candidate.score, off, *self.candidate.box)

    def is_here(self, limits: GroundingLimits) -> bool:
        """Whether it lies under the mark and is as close."""
        return self.distance < limits.nearest and _holds(self.candidate.box, self.marked)

    def is_better(self, doubt: str, mark: Box, frame: Frame, limits: GroundingLimits) -> bool:
        """Whether it may take the place of a mark that is doubted."""
        if self.candidate.score < limits.confidence:
            return False
        if not limits.nearest <= self.distance < math.inf:
            return False
        if doubt == "large region" and self.candidate.point is None:
            if _is_region(self.candidate.box, frame, limits):
                return False
        return doubt == "too close" or _holds(_grown(mark), self.middle)


def _doubt(action: VisionAction, distance: float, frame: Frame, limits: GroundingLimits) -> str:
    if action.confidence is not None and action.confidence < limits.confidence:
        return "low confidence"
    if action.box is not None and _is_region(action.box, frame, limits):
        return "large region"
    return "too close" if distance < limits.nearest else ""


def _is_region(box: Box, frame: Frame, limits: GroundingLimits) -> bool:
    u_min, v_min, u_max, v_max = (max(round(value), 0) for value in box)
    if (u_max - u_min) * (v_max - v_min) <= limits.region * frame.depth.size:
        return False
    depth = frame.depth[v_min:v_max, u_min:u_max]
    seen = np.sort(np.minimum(depth[depth > 0.0], limits.max_range))
    if not seen.size:
        return True
    low, high = seen[int(0.2 * (seen.size - 1))], seen[int(0.8 * (seen.size - 1))]
    return bool(high - low > REGION_DEPTH)


def _mark(action: VisionAction, frame: Frame) -> Box | None:
    if action.box is not None or action.point is None:
        return action.box
    half = POINT_EXTENT * frame.intrinsics.width / 2
    u, v = action.point
    return (u - half, v - half, u + half, v + half)


def _spot(
    box: Box | None, point: tuple[float, float] | None, frame: Frame, limits: GroundingLimits
) -> Projection:
    """Returns the place that a box or point means, exactly as the goal selector reads it."""
    place: dict[str, Any] = {
        "depth": frame.depth,
        "intrinsics": frame.intrinsics,
        "X_WC": frame.X_WC,
        "max_range": limits.max_range,
    }
    if point is not None:
        return project_point(point, **place)
    assert box is not None
    return project_box(box, **place)


def _floor_distance(spot: Projection, position: tuple[float, float, float]) -> float:
    """Returns metres along the floor; infinite where the depth image shows no place."""
    return math.inf if spot.p_WG is None else math.dist(spot.p_WG[:2], position[:2])


def _clipped(candidate: Candidate, frame: Frame) -> Candidate | None:
    """Returns the part of a candidate in the view, or None when there is none."""
    rows, columns = frame.depth.shape
    u_min, v_min, u_max, v_max = candidate.box
    box = (max(u_min, 0.0), max(v_min, 0.0), min(u_max, columns), min(v_max, rows))
    if box[0] >= box[2] or box[1] >= box[3]:
        return None
    return dataclasses.replace(candidate, box=box)


def _holds(box: Box, pixel: tuple[float, float]) -> bool:
    return box[0] <= pixel[0] <= box[2] and box[1] <= pixel[1] <= box[3]


def _grown(box: Box) -> Box:
    """Returns a box of twice the width and height around the same middle."""
    u, v = (box[2] - box[0]) / 2, (box[3] - box[1]) / 2
    return (box[0] - u, box[1] - v, box[2] + u, box[3] + v)


def _refined(kept: Grounding, candidate: Candidate) -> Grounding:
    others = [other for other in kept.candidates if other is not candidate]
    action = dataclasses.replace(
        kept.action,
        box=candidate.box if candidate.point is None else None,
        point=candidate.point,
        confidence=candidate.score,
    )
    best = (candidate, *others)[:CANDIDATES_KEPT]
    return dataclasses.replace(kept, action=action, candidates=best, refined=True, reason="")
