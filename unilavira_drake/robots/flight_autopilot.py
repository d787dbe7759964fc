"""The autopilot: position setpoints in, rotor thrusts out."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.ports import pose_input, vector_input
from unilavira_drake.robots.flight_cascade import MEMORY, pilot, warm_up
from unilavira_drake.robots.flight_limits import Airframe, AutopilotGains


class FlightAutopilot(LeafSystem):
    """Flies to position setpoints as a PX4 does in offboard mode.

    The rotors stand until the first finite setpoint.  A setpoint that is not finite leaves the
    aircraft hovering where it was last told to be; while the measured state is not finite, the
    rotors carry the weight and nothing more.

    .. pydrake_system::

        name: FlightAutopilot
        input_ports:
        - base_command
        - pose_estimate
        - twist
        output_ports:
        - rotor_command

    ``base_command`` is [x, y, z, yaw, vx, vy, vz] in the world, metres, radians and m/s;
    ``twist`` is [w; v] of B in W, expressed in B; ``rotor_command`` is (4,) newtons, each within
    the rotor's limits.

    Args:
        airframe: what it flies.
        gains: of the cascade.
        period: seconds between two updates.
        offset: time of the first update, seconds.
    """

    def __init__(
        self, *, airframe: Airframe, gains: AutopilotGains, period: float, offset: float = 0.0
    ) -> None:
        super().__init__()
        warm_up()
        self._airframe = airframe
        self._gains = gains
        self._period = period
        self._command = vector_input(self, "base_command", 7)
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        rotors = self.DeclareDiscreteState(4)
        memory = self.DeclareDiscreteState(MEMORY + 5)
        self._rotors_index, self._memory_index = int(rotors), int(memory)
        self.DeclareStateOutputPort("rotor_command", rotors)
        self.DeclarePeriodicDiscreteUpdateEvent(period, offset, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        memory: Any = np.array(context.get_discrete_state(self._memory_index).value())
        rotors: Any = pilot(
            memory,
            self._command(context),
            np.ascontiguousarray(self._pose(context).GetAsMatrix34()),
            self._twist(context),
            self._period,
            self._airframe,
            self._gains,
        )
        discrete_state.set_value(self._rotors_index, rotors)
        discrete_state.set_value(self._memory_index, memory)
