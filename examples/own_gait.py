"""Walks with a locomotion of one's own: any System with these three ports fits the slot.

A gait policy or a whole-body controller reads the command and the joints and says where the
actuated joints shall be.  This one carries the trunk without a sway and paces: the legs of one side
swing together.
"""

import math

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem

from unilavira_drake import load_scenario, make_navigation_diagram

LEGS = ("front_left", "front_right", "rear_left", "rear_right")
JOINTS = 6 + 2 * len(LEGS)
"""base_x, base_y, base_yaw, trunk_z, trunk_roll, trunk_pitch; then hip and knee of each leg."""


class Pace(LeafSystem):
    """The ports of ``WalkingBase``; the phase of the gait is its state."""

    def __init__(self) -> None:
        super().__init__()
        self._command = self.DeclareVectorInputPort("base_command", 3)
        self._joints = self.DeclareVectorInputPort("joint_state", 2 * JOINTS)
        self.DeclareVectorOutputPort("desired_joint_state", 2 * JOINTS, self._calc)
        self._phase = self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(0.025, 0.0, self._step)

    def _step(self, context, state):
        moving = np.any(np.abs(self._command.Eval(context)) > 0.01)
        phase = context.get_discrete_state(self._phase).value()[0]
        state.set_value(self._phase, [(phase + 0.05) % 1.0 if moving else 0.0])

    def _calc(self, context, output):
        vx, vy, wz = self._command.Eval(context)
        yaw = self._joints.Eval(context)[2]
        phase = context.get_discrete_state(self._phase).value()[0]
        q, v = np.zeros(JOINTS), np.zeros(JOINTS)
        v[:3] = math.cos(yaw) * vx - math.sin(yaw) * vy, math.sin(yaw) * vx + math.cos(yaw) * vy, wz
        for leg, name in enumerate(LEGS):
            side = 1.0 if name.endswith("left") else -1.0
            q[6 + 2 * leg] = 0.3 * side * math.sin(2 * math.pi * phase)
        output.SetFromVector(np.concatenate([q, v]))


scenario = load_scenario("apartment", "robot: !UnitreeGo1 {}")
diagram = make_navigation_diagram(scenario, replace={"locomotion": Pace()})
simulator = Simulator(diagram)
simulator.AdvanceTo(12.0)
monitor = diagram.GetSubsystemByName("episode_monitor")
context = monitor.GetMyContextFromRoot(simulator.get_context())
metrics = monitor.GetOutputPort("metrics").Eval(context)
print(f"{metrics.path_length:.1f} m in {metrics.time:.0f} s, {metrics.collisions} collisions")
