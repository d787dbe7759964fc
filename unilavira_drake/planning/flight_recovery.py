"""The way back of an aircraft that is stuck: places it came by, which were free."""

from __future__ import annotations

import math

import numpy as np

from unilavira_drake.messages import Path
from unilavira_drake.planning.visibility import Point

BACK_OFF = 3.0
"""An aircraft that is stuck goes back at least this many tolerances of its goals, and at most
twice as far, if it came from so far, ..."""

BACK_OFF_TIME = 8.0
"""... or for as long, seconds."""

MOST_RECOVERIES = 1


def came_by(came: tuple[Point, ...], position: Point, tolerance: float) -> tuple[Point, ...]:
    """Returns the two latest places that an aircraft came by, the latest first.

    Wavering on the spot forgets neither: a place is new when it is far enough from the latest.

    Args:
        came: the ones before.
        position: where it is, metres.
        tolerance: of its goals, metres.
    """
    if came and math.dist(came[0], position) < BACK_OFF * tolerance:
        return came
    return (position, *came[:1])


def way_back(path: Path, came: tuple[Point, ...], position: Point) -> Path:
    """Returns the way by which an aircraft came, to be gone backwards, in place of a path."""
    return Path(path.n, path.version + 1, np.array([position, *came]), backwards=True)
