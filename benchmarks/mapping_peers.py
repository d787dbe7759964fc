"""The occupancy map's update in vectorised numpy: the same work by other means.

It gives the same map to the last bit, which ``benchmarks/mapping.py`` checks before it measures.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.depth_scan import (
    FLOOR_TOLERANCE,
    HIT_DEPTH,
    HIT_STEP,
    LIMIT,
    MIN_HITS,
    symmetric_columns,
)
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters
from unilavira_drake.messages import Intrinsics


class Splat:
    """A dense grid that is written in place; nothing is copied and nothing is frozen.

    Args:
        log_odds: (rows, columns) int8, large enough for all views.
        first: row and column of its corner, counted from the world's origin.
        parameters: of the map.
    """

    def __init__(
        self, log_odds: NDArray[np.int8], first: tuple[int, int], parameters: MappingParameters
    ) -> None:
        self.log_odds, self.first, self.parameters = log_odds, first, parameters

    def integrate(self, view: DepthView, floor_height: float) -> None:
        """Enters one view."""
        own, (x, y, z) = self.parameters, view.X_WC[:3, 3].tolist()
        R_WC = view.X_WC[:3, :3]
        forward = R_WC[:2, 2] / math.hypot(R_WC[0, 2], R_WC[1, 2])
        axes = np.array([[*forward, 0.0], [forward[1], -forward[0], 0.0], [0.0, 0.0, 1.0]])
        ahead, slope, obstacle, floor = readings(view, axes @ R_WC, z - floor_height, own)
        lens, width = view.intrinsics, view.depth.shape[1]
        bearing = (lens.fx / own.stride, (lens.cx + 0.5) / own.stride, -(-width // own.stride))
        near, far, seen = bearings(ahead, slope, obstacle, floor, bearing)
        i0, j0 = (math.floor((v - own.max_range) / own.resolution) for v in (y, x))
        i1, j1 = (math.floor((v + own.max_range) / own.resolution) + 1 for v in (y, x))
        window = self.log_odds[
            i0 - self.first[0] : i1 - self.first[0], j0 - self.first[1] : j1 - self.first[1]
        ]
        a, s = ahead[obstacle] + HIT_DEPTH * own.resolution, slope[obstacle]
        hit = hits(
            y + a * (forward[1] - s * forward[0]),
            x + a * (forward[0] + s * forward[1]),
            (i0, j0),
            window.shape,
            1.0 / own.resolution,
        )
        dy = ((np.arange(i0, i1) + 0.5) * own.resolution - y)[:, None]
        dx = (np.arange(j0, j1) + 0.5) * own.resolution - x
        row, column = free(dx, dy, forward, own, bearing, (near, far, seen), window)
        old = window[row, column].astype(np.int64)
        lowered = np.maximum(old - own.free_step, -LIMIT)
        lowered[lowered == 0] = -1
        raised = np.minimum(window[hit].astype(np.int64) + HIT_STEP, LIMIT)
        raised[raised == 0] = 1
        window[row, column] = lowered
        window[hit] = raised


@functools.lru_cache(8)
def beams(lens: Intrinsics, stride: int) -> tuple[Any, Any, Any, Any]:
    """Returns columns and rows that are read, and x and y of their rays; made once for a camera."""
    u, v = symmetric_columns(lens.width, stride), np.arange(stride // 2, lens.height, stride)
    return u, v, (u - lens.cx) * (1.0 / lens.fx), ((v - lens.cy) * (1.0 / lens.fy))[:, None]


def readings(
    view: DepthView, rays: NDArray[np.float64], height: float, own: MappingParameters
) -> tuple[NDArray[Any], ...]:
    """Returns how far ahead and at which slope the readings lie, and which are what."""
    u, v, x, y = beams(view.intrinsics, own.stride)
    sampled = view.depth if own.stride == 1 else view.depth[v[0] :: own.stride][:, u]
    forward = rays[0, 0] * x + (rays[0, 1] * y + rays[0, 2])
    keep = np.flatnonzero((sampled > 0) & (forward > 0))
    forward = forward.ravel()[keep]
    right = (rays[1, 0] * x + (rays[1, 1] * y + rays[1, 2])).ravel()[keep]
    up = (rays[2, 0] * x + (rays[2, 1] * y + rays[2, 2])).ravel()[keep]
    d = sampled.ravel()[keep].astype(np.float64)
    sideways = forward * forward + right * right
    endless = d == np.inf
    beyond = d * d * sideways > own.max_range * own.max_range
    d[beyond] = own.max_range / np.sqrt(sideways[beyond])
    h = height + d * up
    drop = h < -FLOOR_TOLERANCE
    if drop.any():
        d[drop] = d[drop] * height / (height - h[drop])
        h[drop] = own.min_height
        beyond &= ~drop
        h[drop & endless if height > 0.0 else drop] = np.inf
    kept = np.flatnonzero(h <= own.max_height)
    h, beyond = h[kept], beyond[kept]
    forward = forward[kept]
    slope = right[kept] / forward
    low = h < own.min_height
    return d[kept] * forward, slope, ~(low | beyond), low & ~beyond


def bearings(
    ahead: NDArray[np.float64],
    slope: NDArray[np.float64],
    obstacle: NDArray[np.bool_],
    floor: NDArray[np.bool_],
    bearing: tuple[float, float, int],
) -> tuple[NDArray[np.float64], ...]:
    """Returns nearest obstacle, farthest sight and nearest floor of each bearing."""
    scale, first, count = bearing
    slot = np.floor(slope * scale + first).astype(np.intp)
    inside = (slot >= 0) & (slot < count)
    near, far, seen = np.full(count, np.inf), np.zeros(count), np.full(count, np.inf)
    np.maximum.at(far, slot[inside], ahead[inside])
    for best, kind in ((near, obstacle), (seen, floor)):
        which = inside & kind
        np.minimum.at(best, slot[which], ahead[which])
    return near, far, seen


def hits(
    y: NDArray[np.float64],
    x: NDArray[np.float64],
    first: tuple[int, int],
    shape: tuple[int, ...],
    cells: float,
) -> NDArray[np.bool_]:
    """Returns the cells of the window with enough readings of an obstacle."""
    row = np.floor(y * cells).astype(np.intp) - first[0]
    column = np.floor(x * cells).astype(np.intp) - first[1]
    inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    places = row[inside] * shape[1] + column[inside]
    counts = np.bincount(places, minlength=shape[0] * shape[1])
    found: NDArray[np.bool_] = counts.reshape(shape) >= MIN_HITS
    return found


def free(
    dx: NDArray[np.float64],
    dy: NDArray[np.float64],
    forward: NDArray[np.float64],
    own: MappingParameters,
    bearing: tuple[float, float, int],
    seen: tuple[NDArray[np.float64], ...],
    window: NDArray[np.int8],
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Returns rows and columns of the cells that are seen free."""
    scale, first, count = bearing
    near, far, floor = seen
    ahead = dx * forward[0] + dy * forward[1]
    place = np.flatnonzero((ahead > 0) & (dx * dx + dy * dy <= own.max_range * own.max_range))
    ahead, right = ahead.ravel()[place], (dx * forward[1] - dy * forward[0]).ravel()[place]
    slot = np.floor(right / ahead * scale + first).astype(np.intp)
    inside = (slot >= 0) & (slot < count)
    slot, ahead, place = slot[inside], ahead[inside], place[inside]
    row, column = np.divmod(place, window.shape[1])
    good = (ahead <= far[slot]) & (ahead <= near[slot] - own.resolution)
    good &= (ahead >= floor[slot]) | (window[row, column] == 0)
    return row[good], column[good]
