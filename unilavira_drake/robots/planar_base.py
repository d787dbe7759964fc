"""A base that moves in the plane: body twist in, desired joint velocities out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, LeafSystem

from unilavira_drake.ports import vector_input

BASE_JOINTS = ("base_x", "base_y", "base_yaw")
"""Joints of a model that move its base in the plane, in their order."""

HEIGHT_JOINT = "base_height"
"""Joint that a robot has beside these when it climbs; it carries its body ``base``."""


class PlanarBase(LeafSystem):
    """Translates between a body twist and the x, y, yaw joints of a planar base.

    The plant servoes the joints' velocities with bounded effort, so the base stalls at a wall.
    A differential base cannot move sideways: it ignores ``vy``, and its servo resists a push.

    .. pydrake_system::
        name: PlanarBase
        input_ports:
        - base_command
        - joint_state
        output_ports:
        - desired_joint_state

    ``base_command`` is [vx, vy, wz] in the body frame B, m/s and rad/s; ``joint_state`` and
    ``desired_joint_state`` are [x, y, yaw, x', y', yaw'] in the world W.

    Args:
        holonomic: whether ``vy`` is obeyed.
    """

    def __init__(self, *, holonomic: bool = False) -> None:
        super().__init__()
        self.set_name("planar_base")
        self._holonomic = holonomic
        self._command = vector_input(self, "base_command", 3)
        self._joint_state = vector_input(self, "joint_state", 6)
        self.DeclareVectorOutputPort("desired_joint_state", BasicVector(6), self._calc_desired)

    def _calc_desired(self, context: Any, output: Any) -> None:
        vx, vy, wz = self._command(context).tolist()
        yaw = float(self._joint_state(context)[2])
        if not self._holonomic:
            vy = 0.0
        c, s = math.cos(yaw), math.sin(yaw)
        output.SetFromVector([0.0, 0.0, 0.0, c * vx - s * vy, s * vx + c * vy, wz])


def planar_pose(x: float, y: float, yaw: float, z: float = 0.0) -> RigidTransform:
    """Returns X_WB of a base on a floor at height z."""
    p_WB: Any = np.array([x, y, z])
    return RigidTransform(RotationMatrix.MakeZRotation(yaw), p_WB)
