"""A free-floating body: its state as pose and twist."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, LeafSystem

from unilavira_drake.kernels import kernel
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
        rotation_in_world(np.eye(13)[0])
        twist_in_body(np.eye(13)[0])
        self._body_state = vector_input(self, "body_state", 13)
        # Without a word Drake would take both to change with time as well.
        state = {self._body_state.ticket}
        self.DeclareAbstractOutputPort(
            "pose", lambda: AbstractValue.Make(RigidTransform()), self._calc_pose, state
        )
        self.DeclareVectorOutputPort("twist", BasicVector(6), self._calc_twist, state)

    def _calc_pose(self, context: Any, output: Any) -> None:
        state: Any = self._body_state(context)
        # In place: a new RigidTransform of a matrix costs more than all the rest.
        pose = output.get_mutable_value()
        pose.set_rotation(RotationMatrix(rotation_in_world(state)))
        pose.set_translation(state[4:7])

    def _calc_twist(self, context: Any, output: Any) -> None:
        output.SetFromVector(twist_in_body(self._body_state(context)))


@kernel
def rotation_in_world(body_state: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the attitude of a floating body; (3, 3)."""
    # The integration of a discrete plant leaves the quaternion a little longer or shorter than 1.
    w, x, y, z = body_state[0], body_state[1], body_state[2], body_state[3]
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    # As Drake does it, to the last bit.
    two = 2.0 / ((x * x + z * z) + (y * y + w * w))
    sx, sy, sz = two * x, two * y, two * z
    out = np.empty((3, 3))
    out[0, 0] = 1.0 - sy * y - sz * z
    out[0, 1] = sy * x - sz * w
    out[0, 2] = sz * x + sy * w
    out[1, 0] = sy * x + sz * w
    out[1, 1] = 1.0 - sx * x - sz * z
    out[1, 2] = sz * y - sx * w
    out[2, 0] = sz * x - sy * w
    out[2, 1] = sz * y + sx * w
    out[2, 2] = 1.0 - sx * x - sy * y
    return out


@kernel
def twist_in_body(body_state: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns [w; v] of a floating body, expressed in its own frame; (6,)."""
    q = body_state[:4] / math.sqrt(np.sum(body_state[:4] ** 2))
    w, x, y, z = q[0], q[1], q[2], q[3]
    out = np.empty(6)
    for k in (0, 3):
        a, b, c = body_state[7 + k], body_state[8 + k], body_state[9 + k]
        # v + 2 q x (q x v - w v), the rotation by the inverse quaternion.
        s, t, u = y * c - z * b - w * a, z * a - x * c - w * b, x * b - y * a - w * c
        out[k] = a + 2.0 * (y * u - z * t)
        out[k + 1] = b + 2.0 * (z * s - x * u)
        out[k + 2] = c + 2.0 * (x * t - y * s)
    return out
