"""The flight controller: follows the path through the air, or hovers and turns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.kernels import frozen_view
from unilavira_drake.messages import Path, Sweep
from unilavira_drake.ports import message_input, pose_input, vector_input
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.flight_path_following import follow, hold, warm_up


class FlightController(LeafSystem):
    """Moves a setpoint along the path; its state is the setpoint before.

    It follows ``path`` iff path.n >= sweep.n and the path is not empty, nose ahead unless it is
    one to go backwards, through gaps slowly and in line; else the setpoint comes to rest, and
    turns to the heading of an active ``sweep``.  Until a pose is finite there is no setpoint, and
    after a pose that is none the setpoint comes to rest.

    .. pydrake_system::

        name: FlightController
        input_ports:
        - path
        - sweep
        - pose_estimate
        - twist
        output_ports:
        - desired_command

    ``desired_command`` is (8,) float64: x, y, z, yaw, vx, vy, vz of the setpoint in the world
    (metres, radians, m/s), and the time at which it was issued (s).

    Args:
        limits: of the aircraft; the update period is among them.
        max_yaw_acceleration: rad/s^2.
    """

    def __init__(self, *, limits: FlightLimits, max_yaw_acceleration: float) -> None:
        super().__init__()
        warm_up()
        self._limits = limits
        self._max_yaw_acceleration = max_yaw_acceleration
        self._path = message_input(self, "path", Path())
        self._sweep = message_input(self, "sweep", Sweep())
        self._pose = pose_input(self, "pose_estimate")
        # The ports of a controller are the same on the ground and in the air.
        vector_input(self, "twist", 6)
        unknown: Any = np.full(8, np.nan)
        index = self.DeclareDiscreteState(unknown)
        # Number and version of the path that is followed, and how far along it the setpoint is.
        place = self.DeclareDiscreteState(unknown[:3])
        self._command_index, self._place_index = int(index), int(place)
        self.DeclareStateOutputPort("desired_command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        old: Any = context.get_discrete_state(self._command_index).value()
        X_WB: Any = self._pose(context).GetAsMatrix34()
        lost = not np.isfinite(X_WB).all()
        p_WB = np.ascontiguousarray(X_WB[:, 3])
        yaw = math.atan2(X_WB[1, 0], X_WB[0, 0])
        reference = np.array(old[:7])
        if math.isnan(reference[0]):
            if lost:
                return
            reference = np.array([*p_WB, yaw, 0.0, 0.0, 0.0])
        path, sweep = self._path(context), self._sweep(context)
        rates = (self._max_yaw_acceleration, self._limits)
        place: Any = np.full(3, np.nan)
        if not lost and len(path.p_WP) > 0 and path.n >= sweep.n:
            n, version, travelled = context.get_discrete_state(self._place_index).value()
            if (path.n, path.version) != (n, version):
                travelled = math.nan
            points = frozen_view(path.p_WP, np.float64)
            narrow = np.zeros(len(points), np.bool_)
            narrow[list(path.narrow)] = True
            way = (frozen_view(narrow, np.bool_), reference, p_WB, yaw, travelled, path.backwards)
            *moved, travelled = follow(points, *way, *rates).tolist()
            reference = np.array(moved)
            place = np.array([path.n, path.version, travelled])
        else:
            heading = sweep.heading if sweep.active and not lost else reference[3]
            reference = hold(reference, heading, *rates)
        command: Any = np.append(reference, context.get_time())
        discrete_state.set_value(self._command_index, command)
        discrete_state.set_value(self._place_index, place)
