"""A base that walks: the planar base with command hold, rate limits and the sway of a gait."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from unilavira_drake.ports import vector_input
from unilavira_drake.robots.drive_limits import approach
from unilavira_drake.robots.gait import next_amplitude, phase_rate, swing
from unilavira_drake.robots.gait_config import Gait
from unilavira_drake.robots.planar_base import BASE_JOINTS
from unilavira_drake.robots.robot import GroundRobot


class WalkingBase(LeafSystem):
    """Stands in for a legged robot's own locomotion: it takes a twist and walks.

    A command is taken once per ``command_period`` and held; the body follows it within its
    accelerations.  Trunk and legs swing the more, the faster it goes, and rest when it does.  What
    moves the body are the servos of the base joints: no foot carries it.  A gait policy or a
    whole-body controller is a System with these ports in its place.

    .. pydrake_system::

        name: WalkingBase
        input_ports:
        - base_command
        - joint_state
        output_ports:
        - desired_joint_state

    ``base_command`` is [vx, vy, wz] in the base frame B, m/s and rad/s; ``joint_state`` is [q; v]
    of the model's joints, ``desired_joint_state`` [q; v] of its actuators, in the plant's order.

    Args:
        robot: its limits, command period and gait.
        joints: names of the joints, in the order of the state; one coordinate each.
        actuated: names of the actuated joints, in the order of the actuators.
        time_step: of the plant, seconds.
    """

    def __init__(
        self,
        *,
        robot: GroundRobot,
        joints: Sequence[str],
        actuated: Sequence[str],
        time_step: float,
    ) -> None:
        super().__init__()
        self.set_name("locomotion")
        self._gait = robot.gait or Gait(heave=0.0)
        self._top = (robot.max_speed, robot.max_lateral_speed if robot.holonomic else 0.0)
        self._top_rate = robot.max_yaw_rate
        self._slower = robot.max_acceleration * time_step
        self._turn_slower = robot.max_yaw_acceleration * time_step
        self._time_step = time_step
        self._yaw = list(joints).index("base_yaw")
        self._actuated = tuple(actuated)
        self._base = [self._actuated.index(name) for name in BASE_JOINTS]
        self._command = vector_input(self, "base_command", 3)
        self._joint_state = vector_input(self, "joint_state", 2 * len(joints))
        self._held = int(self.DeclareDiscreteState(3))
        # vx, vy, wz as they are carried out, phase (cycles), amplitude.
        self._motion = int(self.DeclareDiscreteState(5))
        self.DeclareVectorOutputPort(
            "desired_joint_state", BasicVector(2 * len(actuated)), self._calc_desired
        )
        # A little after the governor, whose word would otherwise be a whole period old.
        period = robot.command_period or time_step
        offset = 2.0 * time_step if robot.command_period else 0.0
        self.DeclarePeriodicDiscreteUpdateEvent(period, offset, self._take)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._walk)

    def _take(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.set_value(self._held, self._command(context))  # type: ignore[arg-type]

    def _walk(self, context: Context, discrete_state: DiscreteValues) -> None:
        held: Any = context.get_discrete_state(self._held).value()
        motion: Any = context.get_discrete_state(self._motion).value()
        vx, vy, wz, phase, amplitude = motion.tolist()
        if not (held.any() or motion[[0, 1, 2, 4]].any()):
            return
        forward, lateral = self._top
        vx = approach(vx, approach(0.0, float(held[0]), forward), self._slower)
        vy = approach(vy, approach(0.0, float(held[1]), lateral), self._slower)
        wz = approach(wz, approach(0.0, float(held[2]), self._top_rate), self._turn_slower)
        effort = _effort(vx, vy, wz, forward, lateral, self._top_rate)
        amplitude = next_amplitude(amplitude, effort, self._time_step)
        phase = (phase + phase_rate(self._gait, effort) * self._time_step) % 1.0
        new = np.array([vx, vy, wz, phase, amplitude])
        discrete_state.set_value(self._motion, new)  # type: ignore[arg-type]

    def _calc_desired(self, context: Context, output: Any) -> None:
        motion: Any = context.get_discrete_state(self._motion).value()
        vx, vy, wz, phase, amplitude = motion.tolist()
        yaw = float(self._joint_state(context)[self._yaw])
        c, s = math.cos(yaw), math.sin(yaw)
        effort = _effort(vx, vy, wz, *self._top, self._top_rate)
        rate = phase_rate(self._gait, effort)
        positions, velocities = swing(self._gait, self._actuated, phase, amplitude, rate)
        for index, velocity in zip(self._base, (c * vx - s * vy, s * vx + c * vy, wz), strict=True):
            velocities[index] = velocity
        output.SetFromVector([*positions, *velocities])


def _effort(vx: float, vy: float, wz: float, forward: float, lateral: float, rate: float) -> float:
    sideways = abs(vy) / lateral if lateral else 0.0
    return min(max(abs(vx) / forward, sideways, abs(wz) / rate), 1.0)
