"""Where a flight of stairs begins, seen in one depth image: the edge where the floor ends.

In each column of the picture the floor is followed from below until it ends.  Where steps begin it
goes on rising, or falling away, at the slope of stairs; a wall rises at once, furniture ends.  The
edge over the columns around the marked place is a straight line, and stairs run square to it.
"""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Frame, Message

FLOOR = 0.06
"""Readings this near to the level of the feet are floor, metres."""
HIGHEST_RISER = 0.30
"""What rises higher at the edge is no step, metres."""
SLOPES = (0.30, 1.25)
"""Rise over run of stairs."""
LOOK = (0.30, 1.30)
"""The slope is measured between these distances beyond the edge, metres."""
DROP = 0.12
"""Beyond the edge of stairs that lead down nothing higher than this below the floor is seen."""
BARRED = 0.30
"""A railing stands within this of an edge, metres."""
RAILING = (0.15, 1.20)
"""Heights of what bars an edge, metres."""
NARROWEST = 0.45
"""Of a flight's edge at least so much is seen, metres."""
STRAIGHT = 0.06
"""Deviation of an edge from a straight line at most, metres."""
GAP = 16
"""Columns without an edge within one flight at most."""
SIDE = 0.8
"""Steps are looked for so far beyond the ends of the edge, metres."""
LEAST_WIDTH = 0.8
"""Nobody builds narrower stairs, metres: where less is seen, its middle is not theirs."""
FROM_FRONT = "look at them from their front, 1.5 to 4 metres away"
FEWEST = 12
"""Columns."""

Points = NDArray[np.float64]


@dc.dataclass(frozen=True)
class Flight(Message):
    """Where stairs begin, or why none were found."""

    foot: tuple[float, float] | None = None
    """Middle of the edge where the floor ends, metres in the world."""
    heading: float = 0.0
    """World yaw of the way over them, radians."""
    width: float = 0.0
    """Of what was seen of the edge, metres."""
    reason: str = ""


def find_flight(frame: Frame, columns: tuple[float, float], stair: str, floor: float) -> Flight:
    """Returns the flight that begins where a picture was marked.

    Args:
        frame: depth, intrinsics and pose of the view.
        columns: first and last image column of the mark.
        stair: ``up`` or ``down``.
        floor: height of the floor under the robot, metres in the world.
    """
    p_W, valid = _points(frame)
    up = stair == "up"
    edges: list[tuple[int, float, float]] = []
    for u in range(0, frame.depth.shape[1], 2):
        found = _edge(p_W[:, u], valid[:, u], frame.X_WC[:2, 3], floor, up)
        if found is not None:
            edges.append((u, *found))
    group = _group(edges, columns)
    if len(group) < FEWEST:
        where = "rise" if up else "fall away"
        return Flight(reason=f"no steps that {where} from the floor are seen there; {FROM_FRONT}")
    flight = _fitted(np.array([edge[1:] for edge in group]), frame.X_WC[:2, 3])
    flight = flight if flight.reason else _centred(flight, p_W[valid], floor, up)
    if not flight.reason and flight.width < LEAST_WIDTH:
        return Flight(
            reason=f"only {flight.width:.1f} m of the steps are seen across; {FROM_FRONT}"
        )
    return flight


def _points(frame: Frame) -> tuple[Points, NDArray[np.bool_]]:
    """Returns (H, W, 3) points in the world and whether each one is a reading."""
    depth = np.asarray(frame.depth, np.float64)
    lens, (rows, columns) = frame.intrinsics, depth.shape
    valid = (depth > 0.0) & np.isfinite(depth)
    d = np.where(valid, depth, 1.0)
    rays = np.empty((rows, columns, 3))
    rays[:, :, 0] = (np.arange(columns)[None, :] - lens.cx) / lens.fx
    rays[:, :, 1] = (np.arange(rows)[:, None] - lens.cy) / lens.fy
    rays[:, :, 2] = 1.0
    p_W: Points = (rays * d[:, :, None]) @ frame.X_WC[:3, :3].T + frame.X_WC[:3, 3]
    return p_W, valid


def _edge(
    p_W: Points, valid: NDArray[np.bool_], camera: Points, floor: float, up: bool
) -> tuple[float, float] | None:
    """Returns where the floor of one column ends at steps, or None."""
    height = np.where(valid, p_W[:, 2] - floor, np.inf)
    is_floor = np.abs(height) <= FLOOR
    reach = np.hypot(*(p_W[:, :2] - camera).T)
    rows = np.flatnonzero(is_floor)
    if not len(rows):
        return _below_view(p_W, valid, height, reach, camera) if up else None
    # From the lowest floor in view upwards, over single bad readings.
    breaks = np.flatnonzero(np.diff(rows[::-1]) < -3)
    last = int(rows[::-1][breaks[0]]) if len(breaks) else int(rows[0])
    spot = p_W[last, :2]
    beyond = valid & (np.arange(len(height)) < last)
    s, h = reach[beyond] - reach[last], height[beyond]
    found = _rises(s, h) if up else _falls(s, h)
    return (float(spot[0]), float(spot[1])) if found else None


def _below_view(
    p_W: Points, valid: NDArray[np.bool_], height: Points, reach: Points, camera: Points
) -> tuple[float, float] | None:
    """Returns where steps that fill a column to its lower edge begin, further down."""
    seen = np.flatnonzero(valid)
    if not len(seen) or not FLOOR < height[seen[-1]] < 2 * HIGHEST_RISER:
        return None
    low = int(seen[-1])
    s, h = reach[seen] - reach[low], height[seen] - height[low]
    part = (s >= LOOK[0]) & (s <= LOOK[1]) & (h < 1.6)
    if np.count_nonzero(part) < 6 or h[s < 0.5 * LOOK[0]].max() > HIGHEST_RISER:
        return None
    slope = float(np.median(h[part] / s[part]))
    if not SLOPES[0] <= slope <= SLOPES[1]:
        return None
    share = 1.0 - height[low] / slope / reach[low]
    spot = camera + share * (p_W[low, :2] - camera)
    return float(spot[0]), float(spot[1])


def _rises(s: Points, h: Points) -> bool:
    first = h[(s < 0.5 * LOOK[0]) & (s > -0.1)]
    part = (s >= LOOK[0]) & (s <= LOOK[1]) & (h < 1.6)
    if np.count_nonzero(part) < 6 or first.max(initial=0.0) > HIGHEST_RISER:
        return False
    slope = float(np.median(h[part] / s[part]))
    return SLOPES[0] <= slope <= SLOPES[1]


def _falls(s: Points, h: Points) -> bool:
    if len(h) < 6 or not (h[-6:] < -DROP).all():
        return False
    barred = (np.abs(s) < BARRED) & (h > RAILING[0]) & (h < RAILING[1])
    return not barred.any()


def _group(
    edges: list[tuple[int, float, float]], columns: tuple[float, float]
) -> list[tuple[int, float, float]]:
    """Returns the run of neighbouring edges that holds most of the marked columns."""
    runs: list[list[tuple[int, float, float]]] = []
    for edge in edges:
        near = runs and edge[0] - runs[-1][-1][0] <= GAP
        if near and math.dist(edge[1:], runs[-1][-1][1:]) < 0.4:
            runs[-1].append(edge)
        else:
            runs.append([edge])
    low, high = columns[0] - GAP, columns[1] + GAP
    inside = [sum(low <= edge[0] <= high for edge in run) for run in runs]
    best = max(inside, default=0)
    return runs[inside.index(best)] if best else []


def _fitted(points: Points, camera: Points) -> Flight:
    """Returns the flight whose first edge runs through points, but for a few that do not fit."""
    kept = points
    for _ in range(4):
        middle = kept.mean(axis=0)
        direction = np.linalg.svd(kept - middle, full_matrices=False)[2][0]
        normal = np.array([-direction[1], direction[0]])
        off = np.abs((points - middle) @ normal)
        kept = points[off <= max(2.0 * float(np.median(off)), 0.02)]
    deviation = float(np.sqrt(np.mean(((kept - middle) @ normal) ** 2)))
    along = (kept - middle) @ direction
    low, high = float(along.min()), float(along.max())
    if high - low < NARROWEST:
        return Flight(reason=f"only {high - low:.1f} m of the steps' edge are seen; {FROM_FRONT}")
    if deviation > STRAIGHT:
        return Flight(reason=f"the edge of the steps is not seen clearly; {FROM_FRONT}")
    if normal @ (middle - camera) < 0.0:
        normal = -normal
    foot = middle + direction * (low + high) / 2
    heading = math.atan2(normal[1], normal[0])
    return Flight((float(foot[0]), float(foot[1])), heading, high - low)


def _centred(flight: Flight, p_W: Points, floor: float, up: bool) -> Flight:
    """Returns the flight in the middle of what is seen of its first steps, or of the opening.

    Looking aslant, a part of the edge is hidden; the steps above it are not.
    """
    assert flight.foot is not None
    c, q = math.cos(flight.heading), math.sin(flight.heading)
    offset = p_W[:, :2] - np.array(flight.foot)
    along, across = offset @ np.array([c, q]), offset @ np.array([-q, c])
    h = p_W[:, 2] - floor
    near = (along > 0.05) & (along < 1.5) & (np.abs(across) < flight.width / 2 + SIDE)
    if up:
        ahead = near & (along > LOOK[0]) & (np.abs(across) < flight.width / 3)
        slope = float(np.median(h[ahead] / along[ahead])) if ahead.any() else 0.7
        part = near & (np.abs(h - slope * along) < 0.2) & (h > FLOOR)
    else:
        part = near & (h > -0.3) & (h < -FLOOR)
    if np.count_nonzero(part) < 200:
        return flight
    low, high = np.percentile(across[part], (1.0, 99.0))
    low, high = min(float(low), -flight.width / 2), max(float(high), flight.width / 2)
    middle = (low + high) / 2
    foot = (flight.foot[0] - q * middle, flight.foot[1] + c * middle)
    return dc.replace(flight, foot=foot, width=high - low)
