"""The way back of an aircraft that is stuck: places it came by, which were free."""

from __future__ import annotations

import itertools
import math

import numpy as np

from unilavira_drake.messages import Path
from unilavira_drake.planning.visibility import Point

BACK_OFF = 6.0
"""An aircraft that is stuck goes back at most so many tolerances of its goals, ..."""

BACK_OFF_TIME = 8.0
"""... or for as long, seconds."""

MOST_RECOVERIES = 1


def came_by(came: tuple[Point, ...], position: Point, tolerance: float) -> tuple[Point, ...]:
    """Returns the places that an aircraft came by on the latest stretch of its way, latest first.

    A place is new when it is as far as the tolerance from the latest: wavering makes none.

    Args:
        came: the ones before.
        position: where it is, metres.
        tolerance: of its goals, metres.
    """
    if came and math.dist(came[0], position) < tolerance:
        return came
    places = (position, *came)
    ways = itertools.accumulate(math.dist(a, b) for a, b in itertools.pairwise(places))
    return places[: 1 + sum(way <= BACK_OFF * tolerance for way in ways)]


def way_back(path: Path, came: tuple[Point, ...], position: Point) -> Path:
    """Returns the way by which an aircraft came, to be gone backwards, in place of a path.

    It ends where the aircraft would come nearer again: who turned about goes back to the turn.
    """
    back = [position]
    for place in came:
        if math.dist(place, position) < math.dist(back[-1], position):
            break
        if place != position:
            back.append(place)
    return Path(path.n, path.version + 1, np.array(back), backwards=True)
