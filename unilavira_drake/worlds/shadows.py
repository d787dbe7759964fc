"""Soft shadows where things meet, painted into the textures of floors and walls.

What a person reads as "this stands there" is the dark seam around its foot.  The renderer has no
such shadows, so they are computed once, from the distance to the footprints of things.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.world import Box

Shade = NDArray[np.float32]
"""(H, W) float32 factor in [0, 1]."""

LOW = 0.35
"""Things that begin below this height shade the floor, metres."""

NEAR = 0.15
"""Things that come nearer to a wall than this shade it, metres."""


def edge_shade(rows: int, columns: int, pixels_per_metre: float, *, depth: float) -> Shade:
    """Returns the shade along the four edges of a surface, where another surface begins."""
    v = np.minimum(np.arange(rows) + 0.5, rows - 0.5 - np.arange(rows)) / pixels_per_metre
    u = np.minimum(np.arange(columns) + 0.5, columns - 0.5 - np.arange(columns)) / pixels_per_metre
    fall = (1.0 - depth * np.exp(-v / 0.22))[:, None] * (1.0 - depth * np.exp(-u / 0.22))[None, :]
    return np.asarray(fall, np.float32)


def floor_shade(
    boxes: Iterable[Box],
    rectangle: tuple[float, float, float, float],
    rows: int,
    columns: int,
    pixels_per_metre: float,
) -> Shade:
    """Returns the shade of things on a floor; row 0 of the picture lies at the largest y."""
    x_min, _, _, y_max = rectangle
    mask = np.full((rows, columns), 255, np.uint8)
    for box in boxes:
        if box.center[2] - box.size[2] / 2 > LOW:
            continue
        corners = np.array(box.corners())
        points = np.stack((corners[:, 0] - x_min, y_max - corners[:, 1]), axis=1)
        _fill(mask, points * pixels_per_metre)
    return _contact(mask, pixels_per_metre)


def wall_shade(
    boxes: Iterable[Box],
    start: tuple[float, float],
    end: tuple[float, float],
    rows: int,
    columns: int,
    pixels_per_metre: float,
) -> Shade:
    """Returns the shade of things near a wall from ``start`` to ``end``; row 0 is its top."""
    length = math.dist(start, end)
    along = np.array([(end[0] - start[0]) / length, (end[1] - start[1]) / length])
    across = np.array([-along[1], along[0]])
    mask = np.full((rows, columns), 255, np.uint8)
    for box in boxes:
        offset = np.array(box.corners()) - np.array(start)
        s, d = offset @ along, np.abs(offset @ across)
        if d.min() > NEAR or s.max() < 0.0 or s.min() > length:
            continue
        top = rows - (box.center[2] + box.size[2] / 2) * pixels_per_metre
        bottom = rows - (box.center[2] - box.size[2] / 2) * pixels_per_metre
        left, right = s.min() * pixels_per_metre, s.max() * pixels_per_metre
        _fill(mask, np.array([[left, top], [right, top], [right, bottom], [left, bottom]]))
    if mask.all():
        return np.ones(mask.shape, np.float32)
    # Blurred, not by distance: few things fill their box, and a hard outline would show it.
    dark = (mask == 0).astype(np.float32)
    soft: Any = cv2.GaussianBlur(dark, (0, 0), 0.11 * pixels_per_metre)
    return np.asarray(1.0 - 0.20 * soft, np.float32)


def _fill(mask: NDArray[np.uint8], points: NDArray[np.float64]) -> None:
    polygon: Any = np.round(points).astype(np.int32)
    cv2.fillPoly(mask, [polygon], (0,))


def _contact(mask: NDArray[np.uint8], pixels_per_metre: float) -> Shade:
    if mask.all():
        return np.ones(mask.shape, np.float32)
    distance: Any = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
    return np.asarray(1.0 - 0.45 * np.exp(-distance / (0.12 * pixels_per_metre)), np.float32)
