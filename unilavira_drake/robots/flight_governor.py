"""The flight governor: the last word before the autopilot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.kernels import frozen_view
from unilavira_drake.messages import VoxelMap
from unilavira_drake.messages.voxels import TILE, tiles_between
from unilavira_drake.ports import message_input, pose_input, vector_input
from unilavira_drake.robots.awaited_replies import AwaitedReplies
from unilavira_drake.robots.flight_footprint import Size, half_width, turn_meets
from unilavira_drake.robots.flight_footprint import warm_up as warm_up_footprint
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.flight_stopping import (
    braked,
    free_flight,
    next_yaw,
    voxels_ahead,
    warm_up,
    wished,
)
from unilavira_drake.robots.stopping import stoppable_speed

LEAST_BESIDE = 0.01
"""Without so much free beside the aircraft, metres, the setpoint does not move on."""
LEASH = 1.5
"""The setpoint is never farther from the aircraft than this, metres."""
BRAKING_SHARE = 0.8
"""Share of the braking on which the governor counts; the rest is for what turns up late."""
MOVING = 0.05
"""An aircraft that measures a higher speed must see its pose change, m/s."""


class FlightGovernor(LeafSystem):
    """Lets an aircraft fly only to what is finite, fresh, within its limits, fenced and free ahead.

    * The setpoint moves after the desired one within the limits of speed, acceleration and yaw
      rate, and never leaves the fence; an aircraft that is outside may come back.
    * A desired setpoint that is not finite, or older than ``command_timeout``, and a map older
      than ``map_timeout``, end in hovering: the setpoint brakes and stays.  So does any while a
      model's reply is awaited for longer than ``reply_timeout``.
    * An aircraft that does not know how it moves (a twist that is not finite, or a pose that stays
      the same for ``pose_timeout`` though the twist says otherwise) slows down, and the setpoint
      comes back to where it was seen last.
    * The setpoint moves only so fast that it still stops, after v^2 / 2a and one period, with the
      standoff left before the aircraft around it meets an occupied voxel.  Unknown space counts
      as free: no camera looks up, so a climb is checked only against what was mapped before.
      Beside its way so much is free as the aircraft is wide for its yaw: less in a gap through
      which it flies straight than where it turns.
    * Neither in flight nor on the spot does it turn where its corners would meet an occupied voxel
      that they do not meet yet.  It keeps its yaw until they would not: it tries only the short
      way round, even where the long one is free.

    The state is the setpoint, NaN until pose and command are known and finite ever after, and when
    the pose last changed.

    .. pydrake_system::

        name: FlightGovernor
        input_ports:
        - desired_command
        - map
        - pose_estimate
        - twist
        - language_awaited (optional)
        - vision_awaited (optional)
        output_ports:
        - base_command

    ``base_command`` is (7,) float64: x, y, z, yaw, vx, vy, vz in the world, metres, radians, m/s.

    Args:
        limits: of the aircraft; the update period is among them.
        size: length along the nose and width of the aircraft, metres.
        fence: (2, 3), lowest and highest x, y, z of the setpoint, metres.
        offset: time of the first update, seconds; a little after the controller's.
        standoff: that stays free before the setpoint's aircraft, metres: the true one comes to
            rest behind it, by up to 0.15 m in still air and 0.22 m in strong gusts.
        command_timeout: seconds.
        map_timeout: seconds; longer than a mapper's period at rest.
        reply_timeout: seconds.
        pose_timeout: for which a moving aircraft's pose may stay the same, seconds.
    """

    def __init__(
        self,
        *,
        limits: FlightLimits,
        size: Size,
        fence: NDArray[np.float64],
        offset: float = 0.005,
        standoff: float = 0.25,
        command_timeout: float = 0.3,
        map_timeout: float = 3.0,
        reply_timeout: float = 150.0,
        pose_timeout: float = 0.3,
    ) -> None:
        super().__init__()
        warm_up()
        warm_up_footprint()
        self._limits = limits
        self._size = size
        self._radius = 0.5 * math.hypot(*size)
        self._fence = np.array(fence, np.float64)
        self._standoff = standoff
        self._command_timeout = command_timeout
        self._map_timeout = map_timeout
        self._pose_timeout = max(pose_timeout, 1.5 * limits.period)
        self._desired = vector_input(self, "desired_command", 8)
        self._map = message_input(self, "map", VoxelMap())
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        self._replies = AwaitedReplies(self, reply_timeout)
        unknown: Any = np.full(7, np.nan)
        index = self.DeclareDiscreteState(unknown)
        self._setpoint_index = int(index)
        # The pose (3 x 4) that was seen last, and the time at which it was new.
        unseen: Any = np.full(13, -np.inf)
        self._seen_index = int(self.DeclareDiscreteState(unseen))
        self.DeclareStateOutputPort("base_command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, offset, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        desired: Any = self._desired(context)
        wish: list[float] = desired.tolist()
        old: Any = context.get_discrete_state(self._setpoint_index).value()
        valid = self._obeyed(context, wish)
        X_WB: Any = self._pose(context).GetAsMatrix34()
        p_WB = X_WB[:, 3]
        seen = all(map(math.isfinite, p_WB.tolist()))
        lost = self._lost(context, discrete_state, X_WB.ravel().tolist())
        if math.isnan(old[0]):
            if not (valid and seen):
                return
            old = np.array([*p_WB, wish[3], 0.0, 0.0, 0.0])
        elif valid and not lost and old.tolist() == wish[:7] and not any(wish[4:7]):
            return
        setpoint = np.array(old)
        if seen:
            behind = setpoint[:3] - p_WB
            distance = math.sqrt(float(behind @ behind))
            back = self._limits.max_speed * self._limits.period
            leash = max(distance - back, 0.0) if lost else LEASH
            if distance > leash:
                setpoint[:3] = p_WB + behind * (min(leash, LEASH) / distance)
        followed = valid and not lost
        # The setpoint's aircraft is as wide as any between it and the true one, which comes after.
        yaws = (float(setpoint[3]), math.atan2(X_WB[1, 0], X_WB[0, 0]) if seen else math.nan)
        v = self._velocity(context, setpoint, yaws, np.array(desired[:7]) if followed else None)
        setpoint[4:] = v
        setpoint[:3] += self._limits.period * v
        if valid:
            yaw = next_yaw(setpoint[3], wish[3], self._limits)
            if self._may_turn(self._map(context), setpoint, yaw):
                setpoint[3] = yaw
        discrete_state.set_value(self._setpoint_index, setpoint)  # type: ignore[arg-type]

    def _obeyed(self, context: Context, desired: list[float]) -> bool:
        """Whether a command is finite and fresh, and no reply is overdue."""
        fresh = abs(context.get_time() - desired[7]) <= self._command_timeout
        return fresh and all(map(math.isfinite, desired)) and not self._replies.overdue(context)

    def _lost(self, context: Context, discrete_state: DiscreteValues, pose: list[float]) -> bool:
        """Whether nobody knows how the aircraft moves."""
        time = context.get_time()
        twist: list[float] = self._twist(context).tolist()
        speed = math.hypot(*twist[3:]) if all(map(math.isfinite, twist)) else math.nan
        seen: Any = context.get_discrete_state(self._seen_index).value()
        *before, since = seen.tolist()
        if before != pose:
            now: Any = np.array([*pose, time])
            discrete_state.set_value(self._seen_index, now)
            return not (math.isfinite(speed) and all(map(math.isfinite, pose)))
        return math.isnan(speed) or (speed > MOVING and time - since > self._pose_timeout)

    def _velocity(
        self,
        context: Context,
        setpoint: NDArray[np.float64],
        yaws: tuple[float, float],
        desired: NDArray[np.float64] | None,
    ) -> NDArray[np.float64]:
        """Returns how the setpoint may move for one period, m/s."""
        limits = self._limits
        slower = braked(setpoint[4:], limits.max_braking, limits.period)
        if desired is None:
            return slower
        v = wished(setpoint, desired, self._fence, limits)
        speed = math.sqrt(float(v @ v))
        if speed == 0.0:
            return v
        map_ = self._map(context)
        if context.get_time() - map_.time > self._map_timeout:
            return slower
        direction = v / speed
        beside = width_between(self._size, yaws, direction)
        allowed = self._allowed_speed(map_, setpoint[:3], direction, speed, beside + LEAST_BESIDE)
        if allowed >= speed:
            return v
        v = v * (allowed / speed)
        change = v - setpoint[4:]
        # What cannot be had by braking within the limits is not worth a jump: brake straight on.
        possible = float(change @ change) <= (limits.max_braking * limits.period) ** 2 + 1e-12
        return v if possible else slower

    def _allowed_speed(
        self,
        map_: VoxelMap,
        p: NDArray[np.float64],
        direction: NDArray[np.float64],
        speed: float,
        beside: float,
    ) -> float:
        period, braking = self._limits.period, BRAKING_SHARE * self._limits.max_braking
        stopping = speed**2 / (2.0 * braking) + speed * period
        horizon = stopping + self._standoff
        bounds = voxels_ahead(p, direction, horizon, self._radius, map_.resolution)
        way = (p, direction, horizon, self._radius, beside)
        free = horizon
        for voxels, corner in _tiles(map_, bounds):
            free = min(free, free_flight(voxels, corner, bounds, map_.resolution, *way))
        if free >= horizon:
            return speed
        return float(stoppable_speed(free - self._standoff, braking, period))

    def _may_turn(self, map_: VoxelMap, setpoint: NDArray[np.float64], yaw: float) -> bool:
        """Whether the aircraft at the setpoint meets nothing new when it turns."""
        if abs(yaw - setpoint[3]) < 1e-9:
            return True
        p = setpoint[:3].copy()
        bounds = voxels_ahead(p, np.zeros(3), 0.0, self._radius, map_.resolution)
        turn = (p, float(setpoint[3]), float(yaw), self._size)
        return not any(
            turn_meets(voxels, corner, bounds, map_.resolution, *turn)
            for voxels, corner in _tiles(map_, bounds)
        )


def width_between(size: Size, yaws: tuple[float, float], direction: NDArray[np.float64]) -> float:
    """Returns how far a rectangle reaches beside a way at most while it turns, metres.

    Args:
        size: of the rectangle, metres.
        yaws: between which it turns, the short way round, radians; the second may be NaN.
        direction: (3,) of the way.
    """
    first, second = yaws
    width = half_width(size, first, direction)
    if math.isnan(second):
        return width
    turn = math.atan2(math.sin(second - first), math.cos(second - first))
    width = max(width, half_width(size, second, direction))
    # It is widest where a diagonal is across the way.
    begin = first - math.atan2(direction[1], direction[0])
    low, high = min(begin, begin + turn), max(begin, begin + turn)
    diagonal = math.atan2(size[0], size[1])
    for widest in (diagonal, -diagonal):
        if widest + math.pi * math.ceil((low - widest) / math.pi) < high:
            return 0.5 * math.hypot(*size)
    return width


def _tiles(
    map_: VoxelMap, bounds: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int8], tuple[int, int, int]]]:
    """Yields the tiles of a box of voxels, each with its lowest voxel."""
    i, j, k, *beyond = bounds.tolist()
    for key in tiles_between((i, j, k), (beyond[0], beyond[1], beyond[2])):
        tile = map_.tiles.get(key)
        if tile is not None:
            yield frozen_view(tile, np.int8), (TILE * key[0], TILE * key[1], TILE * key[2])
