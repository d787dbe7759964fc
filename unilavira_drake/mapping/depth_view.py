"""A depth image with its camera, and whether it can be believed."""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Frame, Intrinsics, Message

FARTHEST = 1e6
"""What is farther than this from the world's origin along an axis is not believed, metres."""


@dc.dataclass(frozen=True, eq=False)
class DepthView(Message):
    """A depth image and where it was taken."""

    depth: NDArray[np.float32]
    """(H, W) float32, metres along the camera's z; 0, NaN and negative are no reading."""
    intrinsics: Intrinsics
    X_WC: NDArray[np.float64]
    """(4, 4) float64 pose of the camera in the world."""

    @staticmethod
    def of(frame: Frame) -> DepthView:
        """Returns the depth view of a captured frame."""
        return DepthView(frame.depth, frame.intrinsics, frame.X_WC)


def fault_of(view: DepthView) -> str:
    """Returns why a view cannot be integrated; empty if it can."""
    depth, lens = np.asarray(view.depth), view.intrinsics
    if depth.ndim != 2 or depth.size == 0 or depth.dtype.kind != "f":
        return f"a depth image is (H, W) of floats, not {depth.shape} of {depth.dtype}"
    if depth.shape != (lens.height, lens.width):
        shape = f"{depth.shape[1]} x {depth.shape[0]}"
        return f"the depth image is {shape}, its intrinsics {lens.width} x {lens.height}"
    numbers = (lens.fx, lens.fy, lens.cx, lens.cy)
    if not all(map(math.isfinite, numbers)) or min(lens.fx, lens.fy) <= 0.0:
        return f"impossible intrinsics: fx, fy, cx, cy = {numbers}"
    X_WC = np.asarray(view.X_WC)
    if X_WC.shape != (4, 4) or X_WC.dtype.kind != "f" or not np.isfinite(X_WC).all():
        return "the camera's pose is not a finite 4 x 4 matrix"
    rows = X_WC[:3].tolist()
    if not all(_orthonormal(rows[i], rows[k], i == k) for i in range(3) for k in range(i + 1)):
        return "the camera's rotation is not a rotation"
    if max(abs(row[3]) for row in rows) > FARTHEST:
        return f"the camera is farther than {FARTHEST:g} m from the world's origin"
    return ""


def _orthonormal(row: list[float], other: list[float], same: bool) -> bool:
    product = row[0] * other[0] + row[1] * other[1] + row[2] * other[2]
    return abs(product - same) <= 1e-3
