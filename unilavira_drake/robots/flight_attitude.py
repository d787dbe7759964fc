"""Attitudes as quaternions (w, x, y, z): from a thrust direction, and the way there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel


@kernel
def product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the quaternion that turns by b and then by a."""
    out = np.empty(4)
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return out


@kernel
def inverse(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the inverse of a unit quaternion."""
    out = -q
    out[0] = q[0]
    return out


@kernel
def quaternion_of(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the unit quaternion of a (3, 3) rotation matrix, by its largest component."""
    q = np.empty(4)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        q[0] = 1.0 + trace
        q[1] = R[2, 1] - R[1, 2]
        q[2] = R[0, 2] - R[2, 0]
        q[3] = R[1, 0] - R[0, 1]
    else:
        i = 0
        if R[1, 1] > R[i, i]:
            i = 1
        if R[2, 2] > R[i, i]:
            i = 2
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = R[k, j] - R[j, k]
        q[1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + k] = R[k, i] + R[i, k]
    return q / math.sqrt(np.sum(q * q))


@kernel
def attitude_of(up: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Returns the attitude whose z axis is ``up`` (a unit vector) and that heads to ``yaw``."""
    # Across the heading, as PX4 has it: well defined up to a tilt of 90 degrees.
    cross = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    R = np.empty((3, 3))
    R[0, 0] = cross[1] * up[2] - cross[2] * up[1]
    R[1, 0] = cross[2] * up[0] - cross[0] * up[2]
    R[2, 0] = cross[0] * up[1] - cross[1] * up[0]
    length = math.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2 + R[2, 0] ** 2)
    for i in range(3):
        R[i, 0] /= length
        R[i, 2] = up[i]
    R[0, 1] = up[1] * R[2, 0] - up[2] * R[1, 0]
    R[1, 1] = up[2] * R[0, 0] - up[0] * R[2, 0]
    R[2, 1] = up[0] * R[1, 0] - up[1] * R[0, 0]
    return quaternion_of(R)


@kernel
def attitude_error(
    q: NDArray[np.float64], desired: NDArray[np.float64], yaw_weight: float
) -> NDArray[np.float64]:
    """Returns the rotation vector in the body frame that leads to an attitude, radians.

    Tilt comes before heading (Brescianini, Hehn and D'Andrea, "Nonlinear quadrocopter attitude
    control", 2013, as in PX4): of the turn that is left once the z axes agree, only the share
    ``yaw_weight`` is asked for.
    """
    error = product(inverse(q), desired)
    # The z axis of the desired attitude, seen from the body.
    zx = 2.0 * (error[1] * error[3] + error[0] * error[2])
    zy = 2.0 * (error[2] * error[3] - error[0] * error[1])
    zz = 1.0 - 2.0 * (error[1] ** 2 + error[2] ** 2)
    tilt = np.array([1.0 + zz, -zy, zx, 0.0])
    length = math.sqrt(np.sum(tilt * tilt))
    if length < 1e-6:
        tilt[0], tilt[1], tilt[2], length = 0.0, 1.0, 0.0, 1.0
    tilt /= length
    turn = product(inverse(tilt), error)
    angle = 2.0 * math.atan2(turn[3], turn[0])
    angle = 0.5 * yaw_weight * math.atan2(math.sin(angle), math.cos(angle))
    whole = product(tilt, np.array([math.cos(angle), 0.0, 0.0, math.sin(angle)]))
    if whole[0] < 0.0:
        whole = -whole
    sine = math.sqrt(whole[1] ** 2 + whole[2] ** 2 + whole[3] ** 2)
    factor = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, whole[0]) / sine
    return factor * whole[1:]
