"""How far an aircraft may fly before it is too near to something, and how it comes to rest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.robots.drive_limits import approach, braking_speed
from unilavira_drake.robots.flight_limits import FlightLimits

TOUCH = 1e-3
"""A ball touches what is nearer to it than this, metres."""
MOST_STEPS = 32
"""A ball that only grazes a voxel needs many steps; so many are enough to be nearly there."""


@kernel
def voxels_ahead(
    p: NDArray[np.float64],
    direction: NDArray[np.float64],
    horizon: float,
    reach: float,
    resolution: float,
) -> NDArray[np.int64]:
    """Returns the voxels within ``reach`` of a straight way; (6,): lowest, one beyond highest.

    Args:
        p: (3,) where it begins, metres.
        direction: (3,) unit vector.
        horizon: its length, metres.
        reach: metres.
        resolution: side of a voxel, metres.
    """
    bounds = np.empty(6, np.int64)
    for axis in range(3):
        end = p[axis] + horizon * direction[axis]
        bounds[axis] = math.floor((min(p[axis], end) - reach) / resolution)
        bounds[3 + axis] = math.floor((max(p[axis], end) + reach) / resolution) + 1
    return bounds


@kernel
def way_to_voxel(
    q: tuple[float, float, float],
    half: float,
    direction: NDArray[np.float64],
    horizon: float,
    radius: float,
) -> float:
    """Returns how far a ball may fly straight before it meets a cube, metres.

    It goes on by what is free until it touches.  The cube is convex: once it recedes it is never
    met, nor is one that the ball already touches and leaves.

    Args:
        q: the cube's centre as seen from the ball's, metres.
        half: half a side of the cube, metres.
        direction: (3,) unit vector.
        horizon: metres; returned when the cube is not met within it.
        radius: of the ball, metres.
    """
    travelled = 0.0
    for _ in range(MOST_STEPS):
        square, towards, centre = 0.0, 0.0, 0.0
        for axis in range(3):
            way = q[axis] - travelled * direction[axis]
            gap = math.copysign(max(abs(way) - half, 0.0), way)
            square += gap * gap
            towards += gap * direction[axis]
            centre += way * direction[axis]
        if (towards if square > 0.0 else centre) <= 0.0:
            return horizon
        free = math.sqrt(square) - radius
        if free < TOUCH:
            return travelled
        travelled += free
        if travelled >= horizon:
            return horizon
    return travelled


@kernel
def free_flight(
    log_odds: NDArray[np.int8],
    corner: tuple[int, int, int],
    bounds: NDArray[np.int64],
    resolution: float,
    p: NDArray[np.float64],
    direction: NDArray[np.float64],
    horizon: float,
    radius: float,
    beside: float,
) -> float:
    """Returns how far a ball may fly straight before it meets an occupied voxel, metres.

    What lies beside its way farther than ``beside`` does not count: what is in the ball reaches no
    farther.  What lies behind is no hindrance, nor is what the ball already touches and leaves.
    Unknown voxels count as free: the planner keeps to what was seen.

    Args:
        log_odds: int8 of some voxels; positive is occupied.
        corner: the voxel of ``log_odds[0, 0, 0]``.
        bounds: (6,) lowest voxel that counts, and one beyond the highest.
        resolution: side of a voxel, metres.
        p: (3,) where the ball is, metres.
        direction: (3,) unit vector.
        horizon: metres; returned when nothing is met within it.
        radius: of the ball, metres.
        beside: horizontally, metres.
    """
    best = horizon
    nx, ny, nz = log_odds.shape
    level = math.hypot(direction[0], direction[1])
    c, s = 1.0, 0.0
    if level > 1e-9:
        c, s = direction[0] / level, direction[1] / level
    beside += 0.5 * resolution * (abs(c) + abs(s))
    for x in range(max(bounds[0] - corner[0], 0), min(bounds[3] - corner[0], nx)):
        for y in range(max(bounds[1] - corner[1], 0), min(bounds[4] - corner[1], ny)):
            for z in range(max(bounds[2] - corner[2], 0), min(bounds[5] - corner[2], nz)):
                if log_odds[x, y, z] <= 0:
                    continue
                q = (
                    (corner[0] + x + 0.5) * resolution - p[0],
                    (corner[1] + y + 0.5) * resolution - p[1],
                    (corner[2] + z + 0.5) * resolution - p[2],
                )
                if abs(c * q[1] - s * q[0]) >= beside:
                    continue
                best = way_to_voxel(q, 0.5 * resolution, direction, best, radius)
    return best


@kernel
def braked(v: NDArray[np.float64], deceleration: float, period: float) -> NDArray[np.float64]:
    """Returns a velocity one period of braking later, in its own direction; (3,) m/s."""
    speed = math.sqrt(np.sum(v * v))
    if speed <= 0.0:
        return np.zeros(3)
    return v * (max(speed - deceleration * period, 0.0) / speed)


@kernel
def wished(
    setpoint: NDArray[np.float64],
    desired: NDArray[np.float64],
    fence: NDArray[np.float64],
    limits: FlightLimits,
) -> NDArray[np.float64]:
    """Returns the velocity that takes a setpoint after the desired one; (3,) m/s.

    It is within the limits of speed and acceleration, and such that the setpoint comes to rest
    before it leaves the fence; outside it only comes back.

    Args:
        setpoint: (7,) the latest.
        desired: (7,) what the controller wants.
        fence: (2, 3) lowest and highest x, y, z, metres.
        limits: of the aircraft.
    """
    period, acceleration = limits.period, limits.max_braking
    v = desired[4:7].copy()
    error = desired[:3] - period * v - setpoint[:3]
    distance = math.sqrt(np.sum(error * error))
    if distance > 1e-9:
        v += error * (braking_speed(distance, 0.8 * acceleration, period) / distance)
    level = math.hypot(v[0], v[1])
    if level > limits.max_speed:
        v[0] *= limits.max_speed / level
        v[1] *= limits.max_speed / level
    v[2] = min(max(v[2], -limits.max_descent_speed), limits.max_climb_speed)
    change = v - setpoint[4:7]
    size = math.sqrt(np.sum(change * change))
    if size > acceleration * period:
        v = setpoint[4:7] + change * (acceleration * period / size)
    for axis in range(3):
        down = braking_speed(setpoint[axis] - fence[0, axis], 0.5 * acceleration, period)
        up = braking_speed(fence[1, axis] - setpoint[axis], 0.5 * acceleration, period)
        v[axis] = min(max(v[axis], -down), up)
    return v


@kernel
def next_yaw(yaw: float, desired: float, limits: FlightLimits) -> float:
    """Returns the yaw after the desired one, at most so much farther as the rate allows."""
    error = math.atan2(math.sin(desired - yaw), math.cos(desired - yaw))
    return yaw + approach(0.0, error, limits.max_yaw_rate * limits.period)


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    three, seven = np.zeros(3), np.zeros(7)
    window = frozen_view(np.zeros((1, 1, 1)), np.int8)
    bounds = voxels_ahead(three, three, 1.0, 1.0, 1.0)
    free_flight(window, (0, 0, 0), bounds, 1.0, three, three, 1.0, 0.3, 0.3)
    braked(three, 1.0, 0.1)
    wished(seven, seven, np.zeros((2, 3)), FlightLimits())
    next_yaw(0.0, 0.0, FlightLimits())
