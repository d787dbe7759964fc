"""Where a base in the plane is and how it moves, from its joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, LeafSystem

from unilavira_drake.ports import vector_input
from unilavira_drake.robots.planar_base import BASE_JOINTS, HEIGHT_JOINT, planar_pose


class PlanarPose(LeafSystem):
    """Reads pose and twist of the base out of the state of the joints.

    .. pydrake_system::

        name: PlanarPose
        input_ports:
        - joint_state
        output_ports:
        - X_WB
        - twist

    ``joint_state`` is [q; v] of the model; ``X_WB`` is the true pose of the base frame B, level and
    on the floor, or at the height of the joint ``base_height`` if there is one; ``twist`` is [w; v]
    of B in the world W, expressed in B (rad/s, m/s).

    Args:
        joints: names of the model's joints in the order of the state; one coordinate each.
    """

    def __init__(self, *, joints: Sequence[str] = BASE_JOINTS) -> None:
        super().__init__()
        self.set_name("planar_pose")
        self._base = [list(joints).index(name) for name in BASE_JOINTS]
        self._height = list(joints).index(HEIGHT_JOINT) if HEIGHT_JOINT in joints else None
        self._count = len(joints)
        self._joint_state = vector_input(self, "joint_state", 2 * self._count)
        # Without it time itself would count, which changes at every tick of anything.
        ticket = {self.input_port_ticket(self.GetInputPort("joint_state").get_index())}
        self.DeclareAbstractOutputPort("X_WB", Value[RigidTransform], self._calc_pose, ticket)
        self.DeclareVectorOutputPort("twist", BasicVector(6), self._calc_twist, ticket)

    def _calc_pose(self, context: Any, output: Any) -> None:
        state = self._joint_state(context).tolist()
        x, y, yaw = (state[index] for index in self._base)
        z = 0.0 if self._height is None else state[self._height]
        output.set_value(planar_pose(x, y, yaw, z))

    def _calc_twist(self, context: Any, output: Any) -> None:
        state = self._joint_state(context).tolist()
        yaw = state[self._base[2]]
        vx, vy, wz = (state[self._count + index] for index in self._base)
        vz = 0.0 if self._height is None else state[self._count + self._height]
        c, s = math.cos(yaw), math.sin(yaw)
        output.SetFromVector([0.0, 0.0, wz, c * vx + s * vy, c * vy - s * vx, vz])
