"""How far a view is free along its axis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import Frame

CORRIDOR_WIDTH = 0.6
"""Metres across, about the width of a robot."""

STRIDE = 2
"""Every second row and column is read."""

LEAST_PIXELS = 5
"""An obstacle is believed once this many of the pixels read lie on it: noise is not one."""

BIN = 0.01
"""Resolution of the answer, metres."""

CONE = 0.03
"""Half width of what counts as ahead from far away, as a share of the distance: a corridor in the
distance is narrower than a pixel."""


def free_distance(
    frame: Frame, *, min_height: float, max_height: float, max_range: float = 10.0
) -> float:
    """Returns the metres from the camera to the nearest obstacle straight ahead.

    An obstacle is whatever the depth image shows within ``CORRIDOR_WIDTH`` of the vertical plane
    through the view's axis and between the two heights above the floor.  Distances are
    horizontal, along the axis; ``max_range`` when nothing is in the way.  A pinhole that looks
    down has a blind zone in front of the robot, of which this says nothing.
    """
    R_WC = np.ascontiguousarray(frame.X_WC[:3, :3], dtype=np.float64)
    forward = math.hypot(R_WC[0, 2], R_WC[1, 2])
    if forward < 1e-6:
        return max_range
    axis = R_WC[:2, 2] / forward
    rotation = np.array(
        [axis @ R_WC[:2], np.array([-axis[1], axis[0]]) @ R_WC[:2], R_WC[2]], dtype=np.float64
    )
    k = frame.intrinsics
    return float(
        _nearest(
            frozen_view(frame.depth, np.float32),
            rotation,
            np.array([k.fx, k.fy, k.cx, k.cy]),
            np.array([min_height, max_height]) - frame.X_WC[2, 3],
            max_range,
        )
    )


def axial_distance(frame: Frame, *, max_range: float) -> float:
    """Returns the metres from an aircraft's camera to the nearest obstacle along its axis.

    An obstacle is whatever the depth image shows within ``CORRIDOR_WIDTH`` of the axis, and far
    away within ``CONE`` of it, whether the axis is level or points straight down; ``max_range``
    when nothing is in the way.
    """
    k = frame.intrinsics
    pinhole = np.array([k.fx, k.fy, k.cx, k.cy])
    return float(_nearest_on_axis(frozen_view(frame.depth, np.float32), pinhole, max_range))


def warm_up() -> None:
    """Compiles the kernel, so that no control loop waits for the compiler."""
    level = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
    free_distance(Frame(X_WC=level), min_height=0.1, max_height=1.4)
    axial_distance(Frame(), max_range=1.0)


@kernel
def _nearest(
    depth: NDArray[np.float32],
    rotation: NDArray[np.float64],
    pinhole: NDArray[np.float64],
    heights: NDArray[np.float64],
    max_range: float,
) -> float:
    """Returns the distance ahead at which the least number of obstacle pixels is reached.

    The rows of ``rotation`` are forward, left and up in the camera frame.
    """
    fx, fy, cx, cy = pinhole
    bins = np.zeros(int(max_range / BIN) + 1, np.int32)
    for v in range(0, depth.shape[0], STRIDE):
        y = (v - cy) / fy
        for u in range(0, depth.shape[1], STRIDE):
            z = depth[v, u]
            if not 0.0 < z < np.inf:
                continue
            x = (u - cx) / fx
            height = z * (rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2])
            if height < heights[0] or height > heights[1]:
                continue
            across = z * (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2])
            if abs(across) > CORRIDOR_WIDTH / 2:
                continue
            ahead = z * (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2])
            if 0.0 < ahead < max_range:
                bins[int(ahead / BIN)] += 1
    count = 0
    for i in range(len(bins)):
        count += bins[i]
        if count >= LEAST_PIXELS:
            return i * BIN
    return max_range


@kernel
def _nearest_on_axis(
    depth: NDArray[np.float32], pinhole: NDArray[np.float64], max_range: float
) -> float:
    """Returns the depth at which the least number of pixels around the axis is reached."""
    fx, fy, cx, cy = pinhole
    bins = np.zeros(int(max_range / BIN) + 1, np.int32)
    for v in range(depth.shape[0]):
        y = abs((v - cy) / fy)
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not 0.0 < z < max_range:
                continue
            if max(abs((u - cx) / fx), y) * z <= max(CORRIDOR_WIDTH / 2, CONE * z):
                bins[int(z / BIN)] += 1
    count = 0
    for i in range(len(bins)):
        count += bins[i]
        if count >= LEAST_PIXELS:
            return i * BIN
    return max_range
