"""How far a rectangular base may go before its leading edge meets an occupied cell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.messages import read_only
from unilavira_drake.robots import drive_limits


class Footprint(NamedTuple):
    """Rectangle of the base about its centre, metres."""

    half_length: float = 0.345
    half_width: float = 0.285
    standoff: float = 0.05
    """Distance that stays free before the leading edge; at least half a cell."""


@kernel
def _distance_to_cell(
    px: float, py: float, curvature: float, footprint: Footprint, half_cell: float
) -> float:
    """Travel until the front edge meets a point given in the base frame; inf if it never does."""
    length = footprint.half_length + footprint.standoff
    width = footprint.half_width + half_cell
    if abs(px) < footprint.half_length and abs(py) < width:
        return math.inf
    if footprint.half_length <= px <= length and abs(py) < width:
        return 0.0
    if abs(curvature) < 1e-4:
        return px - length if px > length and abs(py) < width else math.inf
    # Seen from the base, the point circles about the centre of rotation (0, radius).
    radius = 1.0 / curvature
    reach = px * px + (py - radius) ** 2 - length * length
    if reach < 0.0:
        return math.inf
    best = math.inf
    for side in (-1.0, 1.0):
        qy = radius + side * math.sqrt(reach)
        if abs(qy) < width:
            turn = math.atan2(py - radius, px) - math.atan2(qy - radius, length)
            turn = math.copysign(1.0, curvature) * turn
            turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi))
            best = min(best, turn * abs(radius))
    return best


@kernel
def free_distance(
    log_odds: NDArray[np.int8],
    origin: tuple[float, float],
    resolution: float,
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    backwards: bool,
    horizon: float,
    footprint: Footprint,
    first: tuple[int, int] = (0, 0),
) -> float:
    """Returns the travel along an arc until the leading edge meets an occupied cell, metres.

    Cells that the base itself covers are ignored: the base stands there.  Cells outside the map
    and unknown ones count as free; the planner keeps away from what was never seen.

    Args:
        log_odds: (rows, columns) int8; positive is occupied.
        origin: world (x, y) of the corner of cell (0, 0), metres.
        resolution: side of a cell, metres.
        x: position of the base, metres.
        y: position of the base, metres.
        yaw: heading of the base, radians.
        curvature: yaw rate by speed of the motion, 1/m; positive turns left when going forwards.
        backwards: whether the base goes backwards.
        horizon: cells farther ahead than this are not looked at, metres.
        footprint: of the base.
        first: row and column of ``log_odds[0, 0]`` in the map.

    Returns:
        ``horizon`` when nothing is met within it.
    """
    row_first, column_first = first
    rows, columns = row_first + log_odds.shape[0], column_first + log_odds.shape[1]
    reach = math.hypot(footprint.half_length + footprint.standoff, footprint.half_width) + horizon
    row_0 = max(math.floor((y - reach - origin[1]) / resolution), row_first)
    row_1 = min(math.floor((y + reach - origin[1]) / resolution) + 1, rows)
    column_0 = max(math.floor((x - reach - origin[0]) / resolution), column_first)
    column_1 = min(math.floor((x + reach - origin[0]) / resolution) + 1, columns)
    # Going backwards is going forwards with the base seen from behind: x and y change sign.
    sign = -1.0 if backwards else 1.0
    c, s = sign * math.cos(yaw), sign * math.sin(yaw)
    best = horizon
    for row in range(row_0, row_1):
        for column in range(column_0, column_1):
            if log_odds[row - row_first, column - column_first] > 0:
                dx = origin[0] + (column + 0.5) * resolution - x
                dy = origin[1] + (row + 0.5) * resolution - y
                px, py = c * dx + s * dy, c * dy - s * dx
                distance = _distance_to_cell(px, py, sign * curvature, footprint, resolution / 2.0)
                best = min(best, distance)
    return best


@kernel
def free_travel(
    log_odds: NDArray[np.int8],
    origin: tuple[float, float],
    resolution: float,
    pose: tuple[float, float, float],
    twist: tuple[float, float, float],
    horizon: float,
    footprint: Footprint,
    first: tuple[int, int] = (0, 0),
) -> float:
    """Returns the travel with a constant twist, sideways too, until a cell is met, metres.

    What the base covers at the start is ignored, as in :func:`free_distance`; what lies within the
    standoff at the start counts only if the base comes nearer.

    Args:
        log_odds: as in :func:`free_distance`, like what is not named here.
        origin: world (x, y) of the corner of cell (0, 0), metres.
        resolution: side of a cell, metres.
        pose: x, y (metres) and yaw (radians) of the base.
        twist: vx, vy (m/s) and wz (rad/s) in the base; not at rest.
        horizon: metres.
        footprint: of the base.
        first: row and column of ``log_odds[0, 0]`` in the map.
    """
    x, y, yaw = pose
    vx, vy, wz = twist
    speed = math.hypot(vx, vy)
    half_cell = resolution / 2.0
    length, width = footprint.half_length + footprint.standoff, footprint.half_width + half_cell
    reach = math.hypot(length, width) + horizon
    c, s = math.cos(yaw), math.sin(yaw)
    # No corner moves more than a quarter of a cell in a step.
    step = resolution / 4.0 / (1.0 + abs(wz) * math.hypot(length, width) / speed)
    best = horizon
    rows, columns = log_odds.shape
    for row in range(rows):
        for column in range(columns):
            if log_odds[row, column] <= 0:
                continue
            dx = origin[0] + (column + first[1] + 0.5) * resolution - x
            dy = origin[1] + (row + first[0] + 0.5) * resolution - y
            if dx * dx + dy * dy > reach * reach:
                continue
            px, py = c * dx + s * dy, c * dy - s * dx
            if abs(px) < length and abs(py) < width:
                inside = abs(px) < footprint.half_length
                if not inside and vx * px > 0.0:
                    return 0.0
                continue
            travel = step
            while travel < best:
                time = travel / speed
                turned = wz * time
                # The chord of the arc points half the turn aside.
                cm, sm = math.cos(turned / 2.0), math.sin(turned / 2.0)
                chord = time if abs(turned) < 1e-6 else time * sm / (turned / 2.0)
                qx = px - (cm * vx - sm * vy) * chord
                qy = py - (sm * vx + cm * vy) * chord
                ct, st = math.cos(turned), math.sin(turned)
                if abs(ct * qx + st * qy) < length and abs(ct * qy - st * qx) < width:
                    best = travel - step
                    break
                travel += step
    return best


@kernel
def stoppable_speed(free: float, deceleration: float, period: float) -> float:
    """Returns the largest v with v^2 / (2 deceleration) + period v <= free; 0 when free <= 0."""
    if free <= 0.0:
        return 0.0
    step = deceleration * period
    return math.sqrt(step * step + 2.0 * deceleration * free) - step


@kernel
def stoppable_speed_from(previous: float, free: float, deceleration: float, period: float) -> float:
    """Returns the largest next speed of a body that slows down by itself, as fast as it can.

    A body told to go slower than ``previous`` still covers (previous - v)^2 / (2 deceleration)
    more than ``period v``; that counts too.

    Args:
        previous: speed told before, m/s, not negative.
        free: metres ahead.
        deceleration: of the body, m/s^2.
        period: for which it holds what it is told, seconds.
    """
    faster = stoppable_speed(free, deceleration, period)
    if faster >= previous:
        return faster
    linear = period - previous / deceleration
    over = free - previous * previous / (2.0 * deceleration)
    root = linear * linear + 4.0 * over / deceleration
    if root <= 0.0:
        return 0.0
    return min(max(0.5 * deceleration * (math.sqrt(root) - linear), 0.0), previous)


def warm_up() -> None:
    """Compiles the kernels of this module and of the limits."""
    drive_limits.warm_up()
    free_distance(
        read_only(np.zeros((1, 1), np.int8)),
        (0.0, 0.0),
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        False,
        1.0,
        Footprint(),
        (0, 0),
    )
    stoppable_speed(1.0, 1.0, 1.0)
    free_travel(
        read_only(np.zeros((1, 1), np.int8)),
        (0.0, 0.0),
        1.0,
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        1.0,
        Footprint(),
        (0, 0),
    )
    stoppable_speed_from(1.0, 1.0, 1.0, 1.0)
