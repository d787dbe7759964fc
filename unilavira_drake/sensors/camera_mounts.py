"""Where the cameras are in a body whose trunk sways."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, LeafSystem


class CameraMounts(LeafSystem):
    """Computes each camera's pose in the base from the poses of the bodies.

    A robot knows these from its joint encoders, whatever it believes of its place in the world.

    .. pydrake_system::

        name: CameraMounts
        input_ports:
        - body_poses
        output_ports:
        - (view).X_BC

    Args:
        plant: finalized; gives the frames.
        base: the body B.
        frames: camera frame of each view.
    """

    def __init__(self, plant: MultibodyPlant, base: RigidBody, frames: Mapping[str, Any]) -> None:
        super().__init__()
        self.set_name("camera_mounts")
        self._base = base.index()
        self._port = self.DeclareAbstractInputPort(
            "body_poses", AbstractValue.Make([RigidTransform()])
        )
        ticket = {self.input_port_ticket(self._port.get_index())}
        for view, frame in frames.items():
            mount = (frame.body().index(), frame.GetFixedPoseInBodyFrame())
            self.DeclareAbstractOutputPort(
                f"{view}.X_BC", Value[RigidTransform], functools.partial(self._calc, mount), ticket
            )

    def _calc(self, mount: tuple[Any, RigidTransform], context: Context, output: Any) -> None:
        poses: Any = self._port.Eval(context)
        carrier, X_PC = mount
        X_WB, X_WP = poses[int(self._base)], poses[int(carrier)]
        output.set_value(X_WB.InvertAndCompose(X_WP).multiply(X_PC))
