"""How far things are on an occupancy map: distance field, nearest obstacle, room beside a path."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message, OccupancyMap


@dataclass(frozen=True)
class Obstacle(Message):
    """The nearest point of an occupied cell, and how far it is; metres."""

    point: tuple[float, float]
    distance: float


def distance_field(occupancy: OccupancyMap) -> NDArray[np.float32]:
    """Returns the distance from each cell's centre to that of the nearest occupied cell.

    The exact Euclidean distance transform (Felzenszwalb and Huttenlocher).

    Returns:
        (rows, columns) float32 metres; 0 in occupied cells, inf everywhere where there are none.
    """
    passable = (occupancy.log_odds <= 0).view(np.uint8)
    if passable.all():
        return np.full(passable.shape, np.inf, np.float32)
    cells: Any = cv2.distanceTransform(passable, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    cells *= np.float32(occupancy.resolution)
    found: NDArray[np.float32] = cells
    return found


def nearest_obstacle(
    occupancy: OccupancyMap, x: float, y: float, max_distance: float
) -> Obstacle | None:
    """Returns the nearest occupied cell's nearest point to a world point; 0 away inside one.

    Costs with the square of ``max_distance``, not with the map.

    Args:
        occupancy: the map.
        x: of the point, metres.
        y: of the point, metres.
        max_distance: cells farther away do not count, metres.
    """
    low, high = _occupied(occupancy, np.array([[x, y]]), max_distance)
    if len(low) == 0:
        return None
    point = np.array([x, y])
    nearest = np.clip(point, low, high)
    distances = np.hypot(*(nearest - point).T)
    best = int(np.argmin(distances))
    if distances[best] > max_distance:
        return None
    return Obstacle((float(nearest[best, 0]), float(nearest[best, 1])), float(distances[best]))


def path_clearance(
    occupancy: OccupancyMap, p_WP: NDArray[np.float64], max_distance: float
) -> float:
    """Returns the distance from a polyline to the nearest occupied cell, exactly; metres.

    Args:
        occupancy: the map.
        p_WP: (k, 2) float64, metres in the world; a point counts as a polyline.
        max_distance: cells farther away do not count, metres.

    Returns:
        0 where the polyline meets an occupied cell, inf where none is within ``max_distance``.
    """
    best = math.inf
    for a, b in itertools.pairwise(p_WP) if len(p_WP) > 1 else [(p_WP[0], p_WP[0])]:
        low, high = _occupied(occupancy, np.stack((a, b)), min(best, max_distance))
        if len(low):
            best = min(best, _segment_distance(a, b, low, high))
    return best if best <= max_distance else math.inf


def _occupied(
    occupancy: OccupancyMap, points: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the lower and upper corners of the occupied cells in a box around points."""
    low = occupancy.cell(*(points.min(axis=0) - reach).tolist())
    high = occupancy.cell(*(points.max(axis=0) + reach).tolist())
    rows, columns = np.nonzero(occupancy.window(low, (high[0] + 1, high[1] + 1)) > 0)
    cells = np.stack((columns + low[1], rows + low[0]), axis=1)
    corners = np.array(occupancy.origin) + cells * occupancy.resolution
    return corners, corners + occupancy.resolution


def _segment_distance(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> float:
    """Returns the least distance between a segment and axis-aligned squares."""
    along = b - a
    # What part of the segment each square covers, one axis after the other.
    flat = np.where(np.abs(along) < 1e-12, 1e-12, along)
    enter = np.minimum((low - a) / flat, (high - a) / flat).max(axis=1)
    leave = np.maximum((low - a) / flat, (high - a) / flat).min(axis=1)
    if np.any((enter <= leave) & (enter <= 1.0) & (leave >= 0.0)):
        return 0.0
    # Apart, the nearest pair has an end of the segment or a corner of the square.
    ends = [np.hypot(*(np.clip(end, low, high) - end).T).min() for end in (a, b)]
    length = max(float(along @ along), 1e-24)
    for x, y in ((low, low), (low, high), (high, low), (high, high)):
        corner = np.stack((x[:, 0], y[:, 1]), axis=1)
        share = np.clip((corner - a) @ along / length, 0.0, 1.0)
        ends.append(np.hypot(*(a + share[:, None] * along - corner).T).min())
    return float(min(ends))
