"""A reference that flies along a path in the air: where it is next, how fast, and its heading.

The reference stays on the path and never outruns the aircraft: it slows down for corners, for the
end, for climbs, while the aircraft lags behind, and while the nose does not yet point ahead.

Through a gap in which there is no room to turn it goes slowly, with the nose along the way until
the aircraft is out of it.  Before one it waits until the aircraft is in line with it.  Who is in
one when the path begins leaves it nose or tail first, as it points.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.messages import read_only
from unilavira_drake.robots.drive_limits import approach, braking_speed
from unilavira_drake.robots.flight_limits import FlightLimits

SHARE = 0.8
"""Share of the acceleration that the reference uses; the rest is the governor's."""
CRUISE = 0.9
"""Share of the greatest speed at which the reference flies; what comes after it can catch up."""
CORNER = 0.08
"""A corner is flown so slowly that the turn fits into this deviation, metres."""
SLOWEST = 0.05
"""Even a turn on the spot is passed at this speed, m/s."""
LAG = 0.5
"""The reference slows down when the aircraft is farther behind than this and waits at twice as
much, metres."""
FREE_ANGLE = 0.4
STOP_ANGLE = 1.2
"""It slows down when the nose is farther off the way ahead than the one, and waits at the other,
radians."""
LOOKAHEAD_TIME = 1.0
MIN_LOOKAHEAD = 0.5
"""The nose points to where the reference will be after that time, at least so many metres on."""

NARROW_SPEED = 0.3
"""In a gap it is no faster than this, m/s."""
GATE = 0.05
"""It waits at most this far before a gap, metres, ..."""
IN_LINE = 0.03
NOSE_IN_LINE = 0.05
"""... until the aircraft is no farther off the line, metres, nor its nose, radians."""
ROOM = 0.15
"""In a gap an aircraft cannot be farther off its line than this, metres."""


@kernel
def project(p_WP: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    """Returns how far along a (k, 3) polyline its point nearest to p is, metres."""
    nearest, best, before = 0.0, np.inf, 0.0
    for i in range(max(len(p_WP) - 1, 1)):
        step = p_WP[min(i + 1, len(p_WP) - 1)] - p_WP[i]
        length = math.sqrt(np.sum(step * step))
        s = min(max(np.sum((p - p_WP[i]) * step) / max(length, 1e-9), 0.0), length)
        off = p - p_WP[i] - step * (s / max(length, 1e-9))
        distance = math.sqrt(np.sum(off * off))
        if distance < best - 1e-9:
            nearest, best = before + s, distance
        before += length
    return nearest


@kernel
def locate(p_WP: NDArray[np.float64], travelled: float) -> tuple[int, float]:
    """Returns the segment of a polyline that lies so far along it, and the metres along that."""
    along = travelled
    for i in range(len(p_WP) - 1):
        step = p_WP[i + 1] - p_WP[i]
        length = math.sqrt(np.sum(step * step))
        if along < length:
            return i, along
        along -= length
    return len(p_WP) - 1, 0.0


@kernel
def advance(
    p_WP: NDArray[np.float64], segment: int, along: float, distance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the point of a polyline so far beyond another, and the direction there.

    Past the end it is the end, and the direction zero.
    """
    s = along + distance
    for i in range(segment, len(p_WP) - 1):
        step = p_WP[i + 1] - p_WP[i]
        length = math.sqrt(np.sum(step * step))
        if s < length:
            return p_WP[i] + step * (s / length), step / length
        s -= length
    return p_WP[-1].copy(), np.zeros(3)


@kernel
def speed_along(direction: NDArray[np.float64], limits: FlightLimits) -> float:
    """Returns the speed at which to cruise in a direction (a unit vector), m/s."""
    level = math.hypot(direction[0], direction[1])
    speed: float = limits.max_speed / max(level, 1e-6)
    vertical = limits.max_climb_speed if direction[2] > 0.0 else limits.max_descent_speed
    return CRUISE * min(speed, float(vertical / max(abs(direction[2]), 1e-6)))


@kernel
def corner_speed(
    before: NDArray[np.float64], after: NDArray[np.float64], acceleration: float
) -> float:
    """Returns the speed at which the turn between two directions fits into the deviation, m/s."""
    cosine = min(max(-np.sum(before * after), -1.0), 1.0)
    half = math.sqrt(0.5 * (1.0 - cosine))
    return max(math.sqrt(acceleration * CORNER * half / max(1.0 - half, 1e-9)), SLOWEST)


@kernel
def off_line(p_WP: NDArray[np.float64], segment: int, p_WB: NDArray[np.float64]) -> float:
    """Returns how far a point is from the line of a segment, metres."""
    step = p_WP[segment + 1] - p_WP[segment]
    off = p_WB - p_WP[segment]
    off = off - step * (np.sum(off * step) / max(np.sum(step * step), 1e-12))
    return math.sqrt(np.sum(off * off))


@kernel
def gap_at(
    p_WP: NDArray[np.float64],
    narrow: NDArray[np.bool_],
    segment: int,
    along: float,
    p_WB: NDArray[np.float64],
) -> int:
    """Returns the narrow segment in or before which aircraft or reference are; -1: none.

    One that the aircraft has not left counts, though the reference may wait before the next.

    Args:
        p_WP: (k, 3) the path, metres.
        narrow: (k,) which of its segments are.
        segment: on which the reference is, ...
        along: ... so far, metres.
        p_WB: (3,) where the aircraft is.
    """
    gap, gate, last, beyond = -1, False, segment - 1, along
    if segment + 1 < len(p_WP) and narrow[segment + 1]:
        step = p_WP[segment + 1] - p_WP[segment]
        gate = math.sqrt(np.sum(step * step)) - along < GATE
    if gate:
        gap, last, beyond = segment + 1, segment, 0.0
    elif narrow[segment]:
        if along >= GATE:
            # It went on because the aircraft was in line with it, and so out of the one before.
            return segment
        gap, gate = segment, True
    # The reference leaves a gap before the aircraft does.  Where it waits for the aircraft, that
    # may never come wholly to where the gap ends.
    slack = GATE if gate else 0.0
    for i in range(last, -1, -1):
        if beyond > 2.0 * LAG:
            break
        step = p_WP[i + 1] - p_WP[i]
        length = math.sqrt(np.sum(step * step))
        if narrow[i] and np.sum((p_WB - p_WP[i + 1]) * step) < -slack * length:
            if off_line(p_WP, i, p_WB) < ROOM:
                gap = i
        beyond += length
    return gap


@kernel
def _speed_ahead(
    p_WP: NDArray[np.float64],
    narrow: NDArray[np.bool_],
    segment: int,
    along: float,
    closed: int,
    acceleration: float,
    limits: FlightLimits,
) -> float:
    """Returns the speed from which every corner, slope, gap and the end can still be met, m/s.

    It stops before the gaps from the segment ``closed`` on.
    """
    speed, distance = np.inf, -along
    before = np.zeros(3)
    for i in range(segment, len(p_WP) - 1):
        step = p_WP[i + 1] - p_WP[i]
        length = math.sqrt(np.sum(step * step))
        if length < 1e-9:
            continue
        direction = step / length
        bound = speed_along(direction, limits)
        if narrow[i]:
            bound = min(bound, NARROW_SPEED)
            if i >= closed and distance > -GATE:
                stop = braking_speed(max(distance, 0.0), acceleration, limits.period)
                return min(speed, stop)
        if distance > 0.0:
            bound = min(bound, corner_speed(before, direction, acceleration))
            bound = math.sqrt(bound**2 + 2.0 * acceleration * distance)
        speed = min(speed, bound)
        before = direction
        distance += length
        if acceleration * distance > 0.5 * speed**2 + speed:
            return speed
    return min(speed, braking_speed(max(distance, 0.0), acceleration, limits.period))


@kernel
def turned(yaw: float, heading: float, max_yaw_acceleration: float, limits: FlightLimits) -> float:
    """Returns the yaw one period later on the way to a heading, where it comes to rest."""
    error = math.atan2(math.sin(heading - yaw), math.cos(heading - yaw))
    rate = min(braking_speed(abs(error), max_yaw_acceleration, limits.period), limits.max_yaw_rate)
    return yaw + math.copysign(rate * limits.period, error)


@kernel
def _heading(way: NDArray[np.float64]) -> float:
    """Returns where a way leads, radians."""
    return math.atan2(way[1], way[0])


@kernel
def _off(heading: float, yaw: float) -> float:
    """Returns the angle between two headings, radians."""
    return abs(math.atan2(math.sin(heading - yaw), math.cos(heading - yaw)))


@kernel
def follow(
    p_WP: NDArray[np.float64],
    narrow: NDArray[np.bool_],
    reference: NDArray[np.float64],
    p_WB: NDArray[np.float64],
    yaw: float,
    travelled: float,
    backwards: bool,
    max_yaw_acceleration: float,
    limits: FlightLimits,
) -> NDArray[np.float64]:
    """Returns the next reference on a path: x, y, z, yaw, vx, vy, vz, and metres travelled; (8,).

    Args:
        p_WP: (k, 3) float64, k >= 1, metres in the world.
        narrow: (k,) bool, for each of its segments whether there is no room to turn.
        reference: (7,) the one before.
        p_WB: (3,) where the aircraft is, metres.
        yaw: of the aircraft, radians.
        travelled: how far along this path the one before is, metres; NaN: where it is nearest.
        backwards: whether the nose stays where it points.
        max_yaw_acceleration: rad/s^2.
        limits: of the aircraft.
    """
    acceleration = SHARE * limits.max_acceleration
    if math.isnan(travelled):
        travelled = project(p_WP, reference[:3])
    segment, along = locate(p_WP, travelled)
    previous = math.sqrt(np.sum(reference[4:7] ** 2))
    gap = gap_at(p_WP, narrow, segment, along, p_WB)
    heading = reference[3] if gap < 0 else _heading(p_WP[gap + 1] - p_WP[gap])
    if gap == 0 and _off(heading, yaw) > 0.5 * math.pi:
        # It is in there already and cannot turn about.
        heading = _heading(p_WP[0] - p_WP[1])
    in_line = gap >= 0 and _off(heading, yaw) < NOSE_IN_LINE
    in_line = in_line and off_line(p_WP, gap, p_WB) < IN_LINE
    # In line with one gap is not in line with the next.
    closed = gap + 1 if in_line else gap
    speed = _speed_ahead(p_WP, narrow, segment, along, closed, acceleration, limits)
    behind = math.sqrt(np.sum((reference[:3] - p_WB) ** 2))
    speed = min(speed, limits.max_speed * min(max(2.0 - behind / LAG, 0.0), 1.0))
    ahead, _ = advance(p_WP, segment, along, max(previous * LOOKAHEAD_TIME, MIN_LOOKAHEAD))
    way = ahead - reference[:3]
    if gap < 0 and not backwards and math.hypot(way[0], way[1]) > max(0.3 * abs(way[2]), 0.05):
        heading = _heading(way)
        share = (STOP_ANGLE - _off(heading, yaw)) / (STOP_ANGLE - FREE_ANGLE)
        speed = min(speed, limits.max_speed * min(max(share, 0.0), 1.0))
    slower = limits.max_acceleration * limits.period
    speed = min(max(speed, previous - slower), previous + SHARE * slower)
    point, direction = advance(p_WP, segment, along, speed * limits.period)
    out = np.empty(8)
    out[:3] = point
    out[3] = turned(reference[3], heading, max_yaw_acceleration, limits)
    out[4:7] = min(speed, speed_along(direction, limits)) * direction
    out[7] = travelled + speed * limits.period
    return out


@kernel
def hold(
    reference: NDArray[np.float64],
    heading: float,
    max_yaw_acceleration: float,
    limits: FlightLimits,
) -> NDArray[np.float64]:
    """Returns the next reference of an aircraft that comes to rest and turns to a heading; (7,)."""
    out = np.empty(7)
    speed = math.sqrt(np.sum(reference[4:7] ** 2))
    slower = approach(speed, 0.0, SHARE * limits.max_acceleration * limits.period)
    out[4:7] = reference[4:7] * (slower / speed if speed > 0.0 else 0.0)
    out[:3] = reference[:3] + limits.period * out[4:7]
    out[3] = turned(reference[3], heading, max_yaw_acceleration, limits)
    return out


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    limits, reference = FlightLimits(), np.zeros(7)
    narrow = read_only(np.zeros(2, np.bool_))
    follow(
        read_only(np.zeros((2, 3))), narrow, reference, np.zeros(3), 0.0, np.nan, False, 1.0, limits
    )
    hold(reference, 0.0, 1.0, limits)
