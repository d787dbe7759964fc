"""The pinhole as a clip matrix and as six planes, and which boxes it can see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import Message


@dataclass(frozen=True)
class Pinhole(Message):
    """A camera model; x right, y down, z forward, the upper left pixel's corner at (0, 0)."""

    width: int
    """Pixels."""
    height: int
    fx: float
    """Pixels."""
    fy: float
    cx: float
    """Pixels from the left edge of the image."""
    cy: float
    """Pixels from its upper edge."""
    near: float
    """Metres; nothing nearer is drawn."""
    far: float
    """Metres; nothing beyond is drawn."""
    min_depth: float
    """Metres; what is nearer reads 0."""
    max_depth: float
    """Metres; what is beyond reads inf."""


def clip_matrix(camera: Pinhole) -> NDArray[np.float64]:
    """Returns the (4, 4) matrix from the camera's frame to clip coordinates.

    The image's upper row is the lowest one of OpenGL, so that it is read first; the fourth clip
    coordinate is the metric depth.
    """
    near, far = camera.near, camera.far
    return np.array(
        [
            [2.0 * camera.fx / camera.width, 0.0, 2.0 * camera.cx / camera.width - 1.0, 0.0],
            [0.0, 2.0 * camera.fy / camera.height, 2.0 * camera.cy / camera.height - 1.0, 0.0],
            [0.0, 0.0, (far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )


def frustum(clip_from_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the (6, 4) planes of what a clip matrix shows; positive inside, not normalised."""
    w = clip_from_world[3]
    return np.concatenate((w + clip_from_world[:3], w - clip_from_world[:3]))


def visible(
    planes: NDArray[np.float64], centers: NDArray[np.float64], axes: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Returns which boxes are not outside one of the planes.

    Args:
        planes: (6, 4).
        centers: (n, 3) of the boxes.
        axes: (n, 3, 3); the columns are the half edges as vectors.
    """
    return _visible(
        frozen_view(planes, np.float64),
        frozen_view(centers, np.float64),
        frozen_view(axes, np.float64),
    )


def warm_up() -> None:
    """Compiles the kernel."""
    visible(np.zeros((6, 4)), np.zeros((1, 3)), np.zeros((1, 3, 3)))


@kernel
def _visible(
    planes: NDArray[np.float64], centers: NDArray[np.float64], axes: NDArray[np.float64]
) -> NDArray[np.bool_]:
    seen = np.ones(len(centers), np.bool_)
    for n in range(len(centers)):
        for plane in planes:
            reach = plane[3]
            for i in range(3):
                reach += plane[i] * centers[n, i]
            for j in range(3):
                reach += abs(
                    plane[0] * axes[n, 0, j] + plane[1] * axes[n, 1, j] + plane[2] * axes[n, 2, j]
                )
            if reach < 0.0:
                seen[n] = False
                break
    return seen
