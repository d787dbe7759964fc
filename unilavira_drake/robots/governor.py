"""The governor: the last word before the base."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.messages import OccupancyMap, read_only
from unilavira_drake.ports import message_input, pose_input, pose_numbers, vector_input
from unilavira_drake.robots.awaited_replies import AwaitedReplies
from unilavira_drake.robots.drive_limits import DriveLimits, approach
from unilavira_drake.robots.stopping import (
    Footprint,
    free_distance,
    free_travel,
    stoppable_speed,
    stoppable_speed_from,
    warm_up,
)

MOVING = 0.05
"""A base that measures a higher speed must see its pose change, m/s."""
SWEPT = 0.05
"""People nearer than this to what a base sweeps when it turns in place make it wait, metres."""


class Governor(LeafSystem):
    """Lets a ground robot do only what is finite, fresh, within its limits and free ahead.

    * Speeds, yaw rate and accelerations are clamped; vy is zero on a differential base.
    * A command that is not finite, or older than ``command_timeout``, counts as zero; so does any
      while a model's reply is awaited for longer than ``reply_timeout``.
    * The base translates only on a map not older than ``map_timeout``, with a pose and a twist that
      are finite and a pose that changes when the twist says so, and only so fast that it still
      stops (v^2 / 2a and one period) before its leading edge meets an occupied cell.  Backwards
      that is no more than what the cameras saw there before: one that looks to the front alone
      shows nothing of what has come behind the base since.
    * Turning in place is never blocked by things: it is how a base gets out of a corner.  People
      go away, so while one is seen within what it would sweep, it waits.
    * Zero is reached by braking, never by a jump.

    The state is the previous command, and when the pose last changed.  At rest under a zero
    command nothing is evaluated.

    .. pydrake_system::

        name: Governor
        input_ports:
        - desired_command
        - map
        - pose_estimate
        - twist
        - language_awaited (optional)
        - vision_awaited (optional)
        output_ports:
        - base_command

    ``base_command`` is (3,) float64: vx, vy, wz of the base frame B relative to the world,
    expressed in B (m/s, rad/s).

    Args:
        limits: limits of the base; the update period is among them.
        footprint: of the base.
        offset: time of the first update, seconds.  A little after the controller's, or the
            governor would see each command one period late.
        reaction_time: for which the base goes on at its measured speed before it obeys, seconds.
        command_timeout: seconds.
        map_timeout: seconds; longer than a mapper's period at rest.
        newest: cells of just these log-odds are people, see ``MappingParameters``; 0: none are.
        courtesy: what stays free before and beside the base to them, metres.
        reply_timeout: seconds.
        pose_timeout: for which a moving base's pose may stay the same, seconds.
        max_lateral_speed: m/s; 0 for a differential base.
        ramps: whether the body itself slows down by its acceleration, as a walking one does.
    """

    def __init__(
        self,
        *,
        limits: DriveLimits,
        footprint: Footprint,
        offset: float = 0.01,
        reaction_time: float = 0.03,
        command_timeout: float = 0.3,
        map_timeout: float = 3.0,
        newest: int = 0,
        courtesy: tuple[float, float] = (0.35, 0.10),
        reply_timeout: float = 150.0,
        pose_timeout: float = 0.3,
        max_lateral_speed: float = 0.0,
        ramps: bool = False,
    ) -> None:
        super().__init__()
        warm_up()
        self._limits = limits
        self._footprint = footprint
        self._reaction_time = reaction_time
        self._command_timeout = command_timeout
        self._map_timeout = map_timeout
        self._newest = newest
        self._shy = footprint._replace(
            standoff=courtesy[0], half_width=footprint.half_width + courtesy[1]
        )
        self._pose_timeout = max(pose_timeout, 1.5 * limits.period)
        self._max_lateral_speed = max_lateral_speed
        self._ramps = ramps
        self._desired = vector_input(self, "desired_command", 4)
        self._map = message_input(self, "map", OccupancyMap())
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        self._replies = AwaitedReplies(self, reply_timeout)
        index = self.DeclareDiscreteState(3)
        self._command_index = int(index)
        # x, y, yaw that were seen last, and the time at which they were new.
        unseen: Any = np.full(4, -math.inf)
        self._seen_index = int(self.DeclareDiscreteState(unseen))
        self.DeclareStateOutputPort("base_command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, offset, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        limits = self._limits
        desired_speed, desired_lateral, desired_rate = self._fresh_desire(context)
        old: Any = context.get_discrete_state(self._command_index).value()
        old_speed, old_lateral, old_rate = old.tolist()
        asked = desired_speed or desired_lateral or desired_rate
        if not (asked or old_speed or old_lateral or old_rate):
            return
        step = limits.max_acceleration * limits.period
        speed = approach(0.0, approach(old_speed, desired_speed, step), limits.max_speed)
        lateral = approach(old_lateral, desired_lateral, step)
        lateral = approach(0.0, lateral, self._max_lateral_speed)
        turn_step = limits.max_yaw_acceleration * limits.period
        rate = approach(old_rate, desired_rate, turn_step)
        rate = approach(0.0, rate, limits.max_yaw_rate)
        if speed != 0.0 or lateral != 0.0:
            before = math.hypot(old_speed, old_lateral)
            wanted = math.hypot(speed, lateral)
            allowed = self._allowed_speed(context, discrete_state, speed, lateral, rate, before)
            # Braking is limited too, so a late obstacle may leave more than is allowed.
            same_way = speed * old_speed + lateral * old_lateral > 0.0
            slowest = max(before - step, 0.0) if same_way else 0.0
            least = min(wanted, max(allowed, slowest))
            if lateral == 0.0:
                speed = math.copysign(least, speed)
            else:
                speed, lateral = speed * least / wanted, lateral * least / wanted
        if self._newest and rate != 0.0 and speed == lateral == 0.0 and self._sweeps(context):
            rate = approach(old_rate, 0.0, turn_step)
        command = np.array([speed, lateral, rate])
        discrete_state.set_value(self._command_index, command)  # type: ignore[arg-type]

    def _fresh_desire(self, context: Context) -> tuple[float, float, float]:
        """The desired vx, vy and wz, or zero where that is late or makes no sense."""
        speed, lateral, rate, t_issued = self._desired(context).tolist()
        # Not a number is not less, either.
        fresh = abs(context.get_time() - t_issued) <= self._command_timeout
        if not (fresh and math.isfinite(speed + lateral + rate)):
            return 0.0, 0.0, 0.0
        if (speed or lateral or rate) and self._replies.overdue(context):
            return 0.0, 0.0, 0.0
        return speed, lateral, rate

    def _sweeps(self, context: Context) -> bool:
        """Whether a person is seen within the disc that a turn in place would sweep."""
        map_ = self._map(context)
        x, y = self._pose(context).translation()[:2].tolist()
        if not math.isfinite(x + y):
            return False
        reach = math.hypot(self._footprint.half_length, self._footprint.half_width) + SWEPT
        log_odds, first = map_.around(x, y, reach)
        cells = np.argwhere(log_odds == self._newest) + first + 0.5
        rows, columns = cells.T * map_.resolution
        away = np.hypot(map_.origin[0] + columns - x, map_.origin[1] + rows - y)
        return bool((away < reach).any())

    def _allowed_speed(
        self,
        context: Context,
        discrete_state: DiscreteValues,
        speed: float,
        lateral: float,
        rate: float,
        before: float,
    ) -> float:
        """How fast the base may go along the arc of this command, m/s, never negative."""
        limits = self._limits
        map_ = self._map(context)
        X_WB = pose_numbers(self._pose(context))
        pose = (X_WB[3], X_WB[7], math.atan2(X_WB[4], X_WB[0]))
        vx, vy = self._twist(context)[3:5].tolist()
        measured = math.hypot(vx, vy) if self._max_lateral_speed else abs(vx)
        finite = all(map(math.isfinite, X_WB)) and math.isfinite(measured)
        late = context.get_time() - map_.time > self._map_timeout
        if late or not finite or self._stands_still(context, discrete_state, pose, measured):
            return 0.0
        overrun = measured * self._reaction_time
        top = math.hypot(speed, lateral)
        fastest = max(top, before) if self._ramps else top
        way = fastest**2 / (2.0 * limits.max_acceleration) + fastest * limits.period
        horizon = way + overrun
        free = self._free(map_, pose, (speed, lateral, rate), horizon)
        if free >= horizon:
            return top
        if self._ramps:
            return float(
                stoppable_speed_from(before, free - overrun, limits.max_acceleration, limits.period)
            )
        return float(stoppable_speed(free - overrun, limits.max_acceleration, limits.period))

    def _stands_still(
        self,
        context: Context,
        discrete_state: DiscreteValues,
        pose: tuple[float, float, float],
        measured: float,
    ) -> bool:
        """Whether the pose has stayed the same too long for a base that moves."""
        seen: Any = context.get_discrete_state(self._seen_index).value()
        time = context.get_time()
        *before, since = seen.tolist()
        if before != list(pose):
            now: Any = np.array([*pose, time])
            discrete_state.set_value(self._seen_index, now)
            return False
        return bool(measured > MOVING and time - since > self._pose_timeout)

    def _free(
        self,
        map_: OccupancyMap,
        pose: tuple[float, float, float],
        twist: tuple[float, float, float],
        horizon: float,
    ) -> float:
        """Travel along the arc of a twist until the base meets something, metres."""
        x, y, _ = pose
        widest = self._shy if self._newest else self._footprint
        size = math.hypot(widest.half_length + widest.standoff, widest.half_width)
        log_odds, first = map_.around(x, y, size + horizon)
        speed, lateral, rate = twist

        def met(cells: NDArray[np.int8], footprint: Footprint) -> float:
            grid = (cells, map_.origin, map_.resolution)
            if lateral != 0.0:
                return float(free_travel(*grid, pose, twist, horizon, footprint, first))
            arc = (rate / speed, speed < 0.0)
            return float(free_distance(*grid, *pose, *arc, horizon, footprint, first))

        free = met(log_odds, self._footprint)
        if self._newest:
            moving = np.where(log_odds == self._newest, log_odds, 0).astype(np.int8)
            free = min(free, met(read_only(moving), self._shy))
        return free
