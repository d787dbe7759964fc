"""The ground controller: follows the path, or turns to the heading of the sweep."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.messages import Path, Sweep
from unilavira_drake.ports import message_input, pose_input, pose_numbers, vector_input
from unilavira_drake.robots.drive_limits import DriveLimits, Reaction, approach
from unilavira_drake.robots.ground_tracking import (
    back_off,
    lateral_speed,
    track_path,
    turn_rate,
    warm_up,
)

DEFAULT_REACTION = Reaction()


class GroundTrackingController(LeafSystem):
    """Tracks with a differential or a holonomic base; its state is the previous command.

    It follows ``path`` iff path.n >= sweep.n and the path is not empty, else it turns in place to
    the heading of an active ``sweep``, else it slows down to rest.  Sweep n + 1 begins after goal
    n is done, whose path is empty, so the two never ask for different things.

    .. pydrake_system::

        name: GroundTrackingController
        input_ports:
        - path
        - sweep
        - pose_estimate
        - twist
        output_ports:
        - desired_command

    ``desired_command`` is (4,) float64: vx, vy, wz of the base frame B relative to the world,
    expressed in B (m/s, rad/s; vy is 0 on a differential base), and the time at which it was
    issued (s).

    Args:
        limits: limits of the base; the update period is among them.
        reaction: how fast the base obeys.
        max_lateral_speed: m/s; 0 for a differential base.
    """

    def __init__(
        self,
        *,
        limits: DriveLimits,
        reaction: Reaction = DEFAULT_REACTION,
        max_lateral_speed: float = 0.0,
    ) -> None:
        super().__init__()
        warm_up()
        self._limits = limits
        self._reaction = reaction
        self._max_lateral_speed = max_lateral_speed
        self._path = message_input(self, "path", Path())
        self._sweep = message_input(self, "sweep", Sweep())
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        index = self.DeclareDiscreteState(4)
        self._command_index = int(index)
        self.DeclareStateOutputPort("desired_command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        limits = self._limits
        previous: Any = context.get_discrete_state(self._command_index).value()
        speed, lateral, rate, _ = previous.tolist()
        # A holonomic base that goes on sideways would leave the place where it turns or stops.
        sideways = 0.0
        path = self._path(context)
        sweep = self._sweep(context)
        follow = len(path.p_WP) > 0 and path.n >= sweep.n
        if follow or sweep.active:
            X_WB = pose_numbers(self._pose(context))
            x, y, yaw = X_WB[3], X_WB[7], math.atan2(X_WB[4], X_WB[0])
            yaw_rate = float(self._twist(context)[2])
        if follow and path.backwards:
            left = math.hypot(path.p_WP[-1, 0] - x, path.p_WP[-1, 1] - y)
            speed, rate = back_off(left, speed, rate, limits)
        elif follow:
            if path.max_speed < limits.max_speed:
                limits = limits._replace(max_speed=path.max_speed)
            speed, rate = track_path(
                path.p_WP, x, y, yaw, yaw_rate, speed, rate, self._reaction, limits
            )
            if self._max_lateral_speed:
                sideways = lateral_speed(
                    path.p_WP, x, y, yaw, speed, lateral, self._max_lateral_speed, limits
                )
        else:
            speed = approach(speed, 0.0, limits.max_acceleration * limits.period)
            if sweep.active:
                rate = turn_rate(sweep.heading - yaw, yaw_rate, rate, self._reaction, limits)
            else:
                rate = approach(rate, 0.0, limits.max_yaw_acceleration * limits.period)
        command = np.array([speed, sideways, rate, context.get_time()])
        discrete_state.set_value(self._command_index, command)  # type: ignore[arg-type]
