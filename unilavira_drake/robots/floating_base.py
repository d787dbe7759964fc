"""A free-floating body: its state as pose and twist."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, LeafSystem

from unilavira_drake.ports import vector_input


class FloatingBase(LeafSystem):
    """Shows the state of a floating body as X_WB and as a twist in its own frame.

    .. pydrake_system::

        name: FloatingBase
        input_ports:
        - body_state
        output_ports:
        - pose
        - twist

    ``body_state`` is Drake's: quaternion (w, x, y, z), position, and [w; v] in the world.
    ``twist`` is [w; v] of B in W, expressed in B.
    """

    def __init__(self) -> None:
        super().__init__()
        self.set_name("floating_base")
        self._body_state = vector_input(self, "body_state", 13)
        self.DeclareAbstractOutputPort(
            "pose", lambda: AbstractValue.Make(RigidTransform()), self._calc_pose
        )
        self.DeclareVectorOutputPort("twist", BasicVector(6), self._calc_twist)

    def _calc_pose(self, context: Any, output: Any) -> None:
        state: Any = self._body_state(context)
        output.set_value(RigidTransform(_rotation(state[:4]), state[4:7]))

    def _calc_twist(self, context: Any, output: Any) -> None:
        state: Any = self._body_state(context)
        R_BW = _rotation(state[:4]).matrix().T
        output.SetFromVector(np.concatenate((R_BW @ state[7:10], R_BW @ state[10:13])))


def _rotation(wxyz: Any) -> RotationMatrix:
    # The integration of a discrete plant leaves the quaternion a little longer or shorter than 1.
    return RotationMatrix(Quaternion(wxyz / np.linalg.norm(wxyz)))
