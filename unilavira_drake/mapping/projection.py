"""From pixels to the world: which point of the scene a box or a pixel means.

Robot Action of the paper (section III-B.3): a representative pixel inside the selected box, a
robust depth d, and ``p_CG = d K^-1 [u, v, 1]`` moved to the world by the camera's pose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Intrinsics, Message

SURFACE_PERCENTILE = 20.0
"""The nearest solid surface in a box: nearer than what shows through or beside the thing, and
farther than a stray near reading."""

SURFACE_THICKNESS = 0.03
"""Depths within this share of the surface's depth count as the surface."""

POINT_RADIUS = 3
"""Half width of the window around a point, pixels."""

NO_DEPTH = "no valid depth"
OUTSIDE = "outside the image"
BEYOND = "beyond range"
EMPTY_BOX = "empty box"


@dataclass(frozen=True)
class Projection(Message):
    """A point of the world, or the reason why there is none."""

    p_WG: tuple[float, float, float] | None = None
    """Metres in the world."""
    pixel: tuple[float, float] | None = None
    """(u, v) that stands for the selection."""
    depth: float | None = None
    """Metres along the camera's z."""
    reason: str = ""


def project_to_pixel(
    p_W: tuple[float, float, float], *, intrinsics: Intrinsics, X_WC: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Returns (u, v, depth) of a world point; the depth is <= 0 behind the camera."""
    x, y, z = X_WC[:3, :3].T @ (np.asarray(p_W) - X_WC[:3, 3])
    if z <= 0.0:
        return (math.nan, math.nan, float(z))
    u = intrinsics.fx * x / z + intrinsics.cx
    return (float(u), float(intrinsics.fy * y / z + intrinsics.cy), float(z))


def project_to_world(
    pixel: tuple[float, float],
    depth: float,
    *,
    intrinsics: Intrinsics,
    X_WC: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Returns the world point at a depth behind a pixel: ``X_WC d K^-1 [u, v, 1]``."""
    x = (pixel[0] - intrinsics.cx) / intrinsics.fx
    y = (pixel[1] - intrinsics.cy) / intrinsics.fy
    p = X_WC[:3, :3] @ (depth * np.array([x, y, 1.0])) + X_WC[:3, 3]
    return (float(p[0]), float(p[1]), float(p[2]))


def project_box(
    box: tuple[float, float, float, float],
    *,
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    X_WC: NDArray[np.float64],
    max_range: float,
) -> Projection:
    """Returns the point of the nearest solid surface in the middle of a box.

    The middle half of the box in each direction is searched first, then the whole box.

    Args:
        box: (u_min, v_min, u_max, v_max), pixels; clipped to the image.
        depth: (H, W) float32, metres along the camera's z; 0, NaN and inf are no surface.
        intrinsics: the camera.
        X_WC: (4, 4) float64 pose of the camera in the world.
        max_range: surfaces beyond this depth are refused, metres.
    """
    u_min, v_min, u_max, v_max = (float(value) for value in box)
    if not all(math.isfinite(value) for value in (u_min, v_min, u_max, v_max)):
        return Projection(reason=OUTSIDE)
    if u_min >= u_max or v_min >= v_max:
        return Projection(reason=EMPTY_BOX)
    rows, columns = depth.shape
    if u_max <= 0 or v_max <= 0 or u_min >= columns or v_min >= rows:
        return Projection(reason=OUTSIDE)
    u_min, u_max = max(u_min, 0.0), min(u_max, float(columns))
    v_min, v_max = max(v_min, 0.0), min(v_max, float(rows))
    center = ((u_min + u_max - 1) / 2, (v_min + v_max - 1) / 2)
    quarter_u, quarter_v = (u_max - u_min) / 4, (v_max - v_min) / 4
    inner = (u_min + quarter_u, v_min + quarter_v, u_max - quarter_u, v_max - quarter_v)
    found = Projection(reason=NO_DEPTH)
    for window in (inner, (u_min, v_min, u_max, v_max)):
        found = _surface(_bounds(window), center, SURFACE_PERCENTILE, depth, max_range)
        if found.pixel is not None:
            break
    return _in_world(found, intrinsics, X_WC)


def project_point(
    point: tuple[float, float],
    *,
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    X_WC: NDArray[np.float64],
    max_range: float,
) -> Projection:
    """Returns the point of the scene behind a pixel, by the median depth of a small window.

    Arguments as for :func:`project_box`.
    """
    u, v = float(point[0]), float(point[1])
    rows, columns = depth.shape
    # Pixel centres have whole numbers: the image spans half a pixel more on each side.
    if not (-0.5 <= u <= columns - 0.5 and -0.5 <= v <= rows - 0.5):
        return Projection(reason=OUTSIDE)
    column, row = min(max(round(u), 0), columns - 1), min(max(round(v), 0), rows - 1)
    window = (
        max(column - POINT_RADIUS, 0),
        max(row - POINT_RADIUS, 0),
        min(column + POINT_RADIUS + 1, columns),
        min(row + POINT_RADIUS + 1, rows),
    )
    return _in_world(_surface(window, (u, v), 50.0, depth, max_range), intrinsics, X_WC)


def _bounds(window: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """Returns the pixels of a window, at least one in each direction."""
    u0, v0 = math.floor(window[0]), math.floor(window[1])
    return (u0, v0, max(math.ceil(window[2]), u0 + 1), max(math.ceil(window[3]), v0 + 1))


def _surface(
    window: tuple[int, int, int, int],
    center: tuple[float, float],
    percentile: float,
    depth: NDArray[np.float32],
    max_range: float,
) -> Projection:
    """Returns pixel and depth of the surface at a percentile of the depths in a window."""
    u0, v0, u1, v1 = window
    patch = depth[v0:v1, u0:u1].astype(np.float64)
    seen = patch > 0.0  # NaN compares false
    near = seen & (patch <= max_range)
    if not near.any():
        return Projection(reason=BEYOND if seen.any() else NO_DEPTH)
    # What is too far takes part in the statistics: a few near pixels are not the thing.
    ranked = np.sort(patch[seen])
    surface = float(ranked[int((ranked.size - 1) * percentile / 100.0)])
    if surface > max_range:
        return Projection(reason=BEYOND)
    rows, columns = np.nonzero(near & (np.abs(patch - surface) <= SURFACE_THICKNESS * surface))
    distance = (columns + u0 - center[0]) ** 2 + (rows + v0 - center[1]) ** 2
    best = int(np.argmin(distance))
    # The centre itself, where the surface is there: a box of even width has two middle pixels.
    on_surface = distance[best] <= 0.5
    pixel = (float(columns[best] + u0), float(rows[best] + v0))
    d = float(patch[rows[best], columns[best]])
    return Projection(pixel=center if on_surface else pixel, depth=d)


def _in_world(found: Projection, intrinsics: Intrinsics, X_WC: NDArray[np.float64]) -> Projection:
    if found.pixel is None or found.depth is None:
        return found
    p_WG = project_to_world(found.pixel, found.depth, intrinsics=intrinsics, X_WC=X_WC)
    return Projection(p_WG=p_WG, pixel=found.pixel, depth=found.depth)
