"""Tracking laws of a differential base: turn to a heading, follow a polyline.

The path law is regulated pure pursuit (Macenski et al., "Regulated Pure Pursuit for Robot Path
Tracking", 2023) with a lookahead that shrinks where its chord would cut a corner.  Both laws are
odd under mirroring: a mirrored scene gives the mirrored command, bit by bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.messages import read_only
from unilavira_drake.robots import drive_limits
from unilavira_drake.robots.drive_limits import DriveLimits, Reaction, approach, braking_speed

MIN_LOOKAHEAD = 0.20
MAX_LOOKAHEAD = 0.50
CORNER_CUT = 0.04
"""The chord to the lookahead point cuts a corner by at most this much, metres, ..."""
LOOKAHEAD_TIME = 0.5
"""... and the base takes at least this long to reach that point, seconds, ..."""
LOOKAHEAD_PERIODS = 1.5
"""... and this many of its periods."""
LATERAL_ACCELERATION = 0.5
"""Bound on v^2 times curvature, m/s^2."""
STOP_ANGLE = 1.0
"""A moving base stops and turns when the lookahead point is farther off than this, radians;"""
START_ANGLE = 0.2
"""a standing base sets off when it is nearer than this."""
BACK_SPEED = 0.2
"""A base that is stuck backs off this slowly, m/s."""
LATERAL_GAIN = 0.8
"""Sideways speed by distance from the path, 1/s."""
END_DISTANCE = 0.03
"""The path is done within this distance of its end, metres."""
HEADING_DEAD_ZONE = 0.003
"""A heading error below this asks for no turn, radians."""
OPPOSITE = 2.6
"""Beyond this angle a base that already turns goes on in the same sense, radians."""


@kernel
def turn_rate(
    error: float, yaw_rate: float, previous: float, reaction: Reaction, limits: DriveLimits
) -> float:
    """Returns the yaw rate that ends a heading error in nearly the least time, at rest.

    Args:
        error: heading minus yaw, up to a multiple of a turn, radians.
        yaw_rate: measured yaw rate, rad/s.
        previous: previous command, rad/s.
        reaction: of the base; what it still turns before it obeys is taken off the error.
        limits: limits of the base.
    """
    error = math.atan2(math.sin(error), math.cos(error))
    if abs(error) > OPPOSITE and error * previous < 0.0:
        error -= math.copysign(2.0 * math.pi, error)
    left = error - yaw_rate * reaction.lag - previous * reaction.delay
    target = 0.0
    if abs(left) > HEADING_DEAD_ZONE:
        fastest = braking_speed(abs(left), 0.9 * limits.max_yaw_acceleration, limits.period)
        # The last step is under-run: a delayed base would jump to and fro across the heading.
        if abs(left) < limits.max_yaw_acceleration * limits.period**2:
            fastest *= 0.5
        target = math.copysign(min(fastest, limits.max_yaw_rate), left)
    return approach(previous, target, limits.max_yaw_acceleration * limits.period)


@kernel
def project(p_WP: NDArray[np.float64], x: float, y: float) -> tuple[int, float, float]:
    """Returns (segment, metres along it, distance) of the point of a polyline nearest to (x, y).

    Args:
        p_WP: (k, 2) float64, k >= 1, metres; of one point the segment is 0.
        x: of the point, metres.
        y: of the point, metres.
    """
    segment, along = 0, 0.0
    best = math.hypot(p_WP[0, 0] - x, p_WP[0, 1] - y)
    for i in range(len(p_WP) - 1):
        dx, dy = p_WP[i + 1, 0] - p_WP[i, 0], p_WP[i + 1, 1] - p_WP[i, 1]
        length = math.hypot(dx, dy)
        if length < 1e-9:
            continue
        s = ((x - p_WP[i, 0]) * dx + (y - p_WP[i, 1]) * dy) / length
        s = min(max(s, 0.0), length)
        distance = math.hypot(p_WP[i, 0] + s * dx / length - x, p_WP[i, 1] + s * dy / length - y)
        if distance < best:
            segment, along, best = i, s, distance
    return segment, along, best


@kernel
def remaining_length(p_WP: NDArray[np.float64], segment: int, along: float) -> float:
    """Returns the length of a polyline beyond a point given as by :func:`project`, metres."""
    length = -along
    for i in range(segment, len(p_WP) - 1):
        length += math.hypot(p_WP[i + 1, 0] - p_WP[i, 0], p_WP[i + 1, 1] - p_WP[i, 1])
    return max(length, 0.0)


@kernel
def _advance(
    p_WP: NDArray[np.float64], segment: int, along: float, distance: float
) -> tuple[float, float, int]:
    """Point ``distance`` beyond a point of the path, and its segment; past the end: straight on."""
    s = along + distance
    i = segment
    x, y = p_WP[-1, 0], p_WP[-1, 1]
    while i < len(p_WP) - 1:
        dx, dy = p_WP[i + 1, 0] - p_WP[i, 0], p_WP[i + 1, 1] - p_WP[i, 1]
        length = math.hypot(dx, dy)
        if length > 1e-9 and (s <= length or i == len(p_WP) - 2):
            return p_WP[i, 0] + s * dx / length, p_WP[i, 1] + s * dy / length, i
        s -= length
        i += 1
    return x, y, i


@kernel
def _lookahead(p_WP: NDArray[np.float64], segment: int, along: float, yaw: float) -> float:
    """The longest lookahead that neither cuts a corner nor swings wide, metres.

    The arc to a point ahead leaves a straight path by distance / 2 tan(heading error / 2).
    """
    ax, ay, _ = _advance(p_WP, segment, along, 0.0)
    bx, by, _ = _advance(p_WP, segment, along, MIN_LOOKAHEAD)
    turn = math.atan2(by - ay, bx - ax) - yaw
    swing = abs(math.atan2(math.sin(turn), math.cos(turn))) / 2.0
    distance = MAX_LOOKAHEAD
    if MAX_LOOKAHEAD * math.tan(swing) > 2.0 * CORNER_CUT:
        distance = 2.0 * CORNER_CUT / math.tan(swing)
    while distance > MIN_LOOKAHEAD:
        bx, by, last = _advance(p_WP, segment, along, distance)
        chord = max(math.hypot(bx - ax, by - ay), 1e-9)
        cut = 0.0
        for i in range(segment + 1, last + 1):
            cross = (bx - ax) * (p_WP[i, 1] - ay) - (by - ay) * (p_WP[i, 0] - ax)
            cut = max(cut, abs(cross) / chord)
        if cut <= CORNER_CUT:
            return distance
        distance -= 0.05
    return MIN_LOOKAHEAD


@kernel
def _speed_limit(
    lookahead: float, curvature: float, angle: float, way: float, limits: DriveLimits
) -> float:
    """The speed at which the base can still turn as the path does and stop at its end, m/s."""
    bend = max(abs(curvature), 1e-6)
    reach_time = max(LOOKAHEAD_TIME, LOOKAHEAD_PERIODS * limits.period)
    speed = min(limits.max_speed, lookahead / reach_time, 0.8 * limits.max_yaw_rate / bend)
    speed = min(speed, math.sqrt(LATERAL_ACCELERATION / bend)) * max(math.cos(angle), 0.3)
    return min(speed, braking_speed(way, 0.8 * limits.max_acceleration, limits.period))


@kernel
def track_path(
    p_WP: NDArray[np.float64],
    x: float,
    y: float,
    yaw: float,
    yaw_rate: float,
    previous_speed: float,
    previous_rate: float,
    reaction: Reaction,
    limits: DriveLimits,
) -> tuple[float, float]:
    """Returns (speed, yaw rate) that follow a polyline and come to rest at its end.

    Args:
        p_WP: (k, 2) float64, k >= 1, metres in the world.
        x: position of the base, metres.
        y: position of the base, metres.
        yaw: heading of the base, radians.
        yaw_rate: measured, rad/s.
        previous_speed: previous command, m/s.
        previous_rate: previous command, rad/s.
        reaction: of the base.
        limits: limits of the base.
    """
    slower = limits.max_acceleration * limits.period
    turn_step = limits.max_yaw_acceleration * limits.period
    segment, along, offset = project(p_WP, x, y)
    rest = remaining_length(p_WP, segment, along)
    to_end = math.hypot(p_WP[-1, 0] - x, p_WP[-1, 1] - y)
    if to_end <= END_DISTANCE or (rest <= 0.0 and to_end <= 2.0 * END_DISTANCE):
        return approach(previous_speed, 0.0, slower), approach(previous_rate, 0.0, turn_step)
    lookahead = _lookahead(p_WP, segment, along, yaw)
    if rest < lookahead and offset > 2.0 * END_DISTANCE:
        target_x, target_y = p_WP[-1, 0], p_WP[-1, 1]
    else:
        target_x, target_y, _ = _advance(p_WP, segment, along, lookahead)
    distance = math.hypot(target_x - x, target_y - y)
    bearing = math.atan2(target_y - y, target_x - x) - yaw
    angle = math.atan2(math.sin(bearing), math.cos(bearing))
    if abs(angle) > (STOP_ANGLE if previous_speed > 2.0 * slower else START_ANGLE):
        rate = turn_rate(angle, yaw_rate, previous_rate, reaction, limits)
        return approach(previous_speed, 0.0, slower), rate
    curvature = 2.0 * math.sin(angle) / max(distance, MIN_LOOKAHEAD)
    way = max(rest, to_end) - previous_speed * (reaction.delay + reaction.lag)
    speed = _speed_limit(lookahead, curvature, angle, max(way, 0.2 * END_DISTANCE), limits)
    speed = approach(previous_speed, speed, slower)
    return speed, approach(previous_rate, curvature * speed, turn_step)


@kernel
def back_off(
    left: float, previous_speed: float, previous_rate: float, limits: DriveLimits
) -> tuple[float, float]:
    """Returns (speed, yaw rate) with which a base goes straight back to a point behind it.

    Args:
        left: distance to the point, metres.
        previous_speed: previous command, m/s.
        previous_rate: previous command, rad/s.
        limits: limits of the base.
    """
    speed = min(BACK_SPEED, braking_speed(left, 0.8 * limits.max_acceleration, limits.period))
    if left <= END_DISTANCE:
        speed = 0.0
    return (
        approach(previous_speed, -speed, limits.max_acceleration * limits.period),
        approach(previous_rate, 0.0, limits.max_yaw_acceleration * limits.period),
    )


@kernel
def lateral_speed(
    p_WP: NDArray[np.float64],
    x: float,
    y: float,
    yaw: float,
    speed: float,
    previous: float,
    fastest: float,
    limits: DriveLimits,
) -> float:
    """Returns the sideways speed with which a holonomic base closes its distance to the path, m/s.

    A base that does not go forward does not go sideways: it turns first, and sees where it goes.

    Args:
        p_WP: (k, 2) float64, k >= 1, metres in the world.
        x: position of the base, metres.
        y: position of the base, metres.
        yaw: heading of the base, radians.
        speed: forward command, m/s.
        previous: previous sideways command, m/s.
        fastest: m/s.
        limits: limits of the base.
    """
    target = 0.0
    if speed > 0.0:
        segment, along, _ = project(p_WP, x, y)
        near_x, near_y, _ = _advance(p_WP, segment, along, 0.0)
        beside = math.cos(yaw) * (near_y - y) - math.sin(yaw) * (near_x - x)
        fastest = min(fastest, 0.5 * speed)
        target = min(max(LATERAL_GAIN * beside, -fastest), fastest)
    return approach(previous, target, limits.max_acceleration * limits.period)


def warm_up() -> None:
    """Compiles the kernels of this module and of the limits."""
    drive_limits.warm_up()
    limits, reaction = DriveLimits(), Reaction()
    turn_rate(0.0, 0.0, 0.0, reaction, limits)
    p_WP = read_only(np.zeros((2, 2)))
    track_path(p_WP, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, reaction, limits)
    back_off(0.0, 0.0, 0.0, limits)
    lateral_speed(p_WP, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, limits)
