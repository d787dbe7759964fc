"""The governor: the last word before the base."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.messages import OccupancyMap, read_only
from unilavira_drake.ports import message_input, pose_input, vector_input
from unilavira_drake.robots.drive_limits import DriveLimits, approach
from unilavira_drake.robots.stopping import Footprint, free_distance, stoppable_speed, warm_up


class Governor(LeafSystem):
    """Lets a differential base do only what is finite, fresh, within its limits and free ahead.

    * Speed, yaw rate and both accelerations are clamped; vy is zero.
    * A command that is not finite, or older than ``command_timeout``, counts as zero.
    * The base translates only on a map not older than ``map_timeout``, and only so fast that it
      still stops (v^2 / 2a and one period) before its leading edge meets an occupied cell.
    * Turning in place is never blocked: it is how a base gets out of a corner.
    * Zero is reached by braking, never by a jump.

    The state is the previous command.  At rest under a zero command nothing is evaluated.

    .. pydrake_system::

        name: Governor
        input_ports:
        - desired_command
        - map
        - pose_estimate
        - twist
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
        newest: cells of at most so much log-odds are things that move, see ``MappingParameters``.
        courtesy: what stays free before and beside the base to things that move, metres.
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
        self._desired = vector_input(self, "desired_command", 4)
        self._map = message_input(self, "map", OccupancyMap())
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        index = self.DeclareDiscreteState(3)
        self._command_index = int(index)
        self.DeclareStateOutputPort("base_command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, offset, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        limits = self._limits
        desired_speed, _, desired_rate, t_issued = self._desired(context).tolist()
        fresh = abs(context.get_time() - t_issued) <= self._command_timeout
        if not (fresh and math.isfinite(desired_speed) and math.isfinite(desired_rate)):
            desired_speed = desired_rate = 0.0
        old: Any = context.get_discrete_state(self._command_index).value()
        old_speed, _, old_rate = old.tolist()
        if desired_speed == desired_rate == old_speed == old_rate == 0.0:
            return
        step = limits.max_acceleration * limits.period
        speed = approach(old_speed, desired_speed, step)
        speed = approach(0.0, speed, limits.max_speed)
        turn_step = limits.max_yaw_acceleration * limits.period
        rate = approach(old_rate, desired_rate, turn_step)
        rate = approach(0.0, rate, limits.max_yaw_rate)
        if speed != 0.0:
            allowed = self._allowed_speed(context, speed, rate)
            # Braking is limited too, so a late obstacle may leave more than is allowed.
            slowest = max(abs(old_speed) - step, 0.0) if speed * old_speed > 0.0 else 0.0
            speed = math.copysign(min(abs(speed), max(allowed, slowest)), speed)
        command = np.array([speed, 0.0, rate])
        discrete_state.set_value(self._command_index, command)  # type: ignore[arg-type]

    def _allowed_speed(self, context: Context, speed: float, rate: float) -> float:
        """How fast the base may go along the arc of this command, m/s, never negative."""
        limits, footprint = self._limits, self._footprint
        map_ = self._map(context)
        X_WB = self._pose(context).GetAsMatrix34()
        if context.get_time() - map_.time > self._map_timeout or not np.isfinite(X_WB).all():
            return 0.0
        measured = self._twist(context)[3]
        overrun = abs(measured) * self._reaction_time if math.isfinite(measured) else 0.0
        horizon = speed**2 / (2.0 * limits.max_acceleration) + abs(speed) * limits.period + overrun
        x, y = float(X_WB[0, 3]), float(X_WB[1, 3])
        yaw = math.atan2(X_WB[1, 0], X_WB[0, 0])
        widest = self._shy if self._newest else footprint
        size = math.hypot(widest.half_length + widest.standoff, widest.half_width)
        log_odds, first = map_.around(x, y, size + horizon)

        def met(cells: NDArray[np.int8], footprint: Footprint) -> float:
            return float(
                free_distance(
                    cells,
                    map_.origin,
                    map_.resolution,
                    x,
                    y,
                    yaw,
                    rate / speed,
                    speed < 0.0,
                    horizon,
                    footprint,
                    first,
                )
            )

        free = met(log_odds, footprint)
        if self._newest:
            moving = np.where(log_odds <= self._newest, log_odds, 0).astype(np.int8)
            free = min(free, met(read_only(moving), self._shy))
        if free >= horizon:
            return abs(speed)
        return float(stoppable_speed(free - overrun, limits.max_acceleration, limits.period))
