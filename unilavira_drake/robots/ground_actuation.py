"""Actuation on the ground: a twist in the plane, held and carried out by joint servos."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold

from unilavira_drake.robots.planar_base import PlanarBase
from unilavira_drake.robots.robot import GroundRobot

BASE_JOINTS = ("base_x", "base_y", "base_yaw")
"""Joints of the model that move the base in the plane, in their order."""


def add_ground_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: GroundRobot,
) -> None:
    """Adds the base of a ground robot; see ``add_actuation``."""
    base = builder.AddSystem(PlanarBase(holonomic=robot.holonomic))
    builder.Connect(plant.get_state_output_port(model_instance), base.GetInputPort("joint_state"))
    builder.Connect(
        base.GetOutputPort("desired_joint_state"),
        plant.get_desired_state_input_port(model_instance),
    )
    command = base.GetInputPort("base_command")
    if robot.command_period > 0.0:
        hold = builder.AddNamedSystem("command_hold", ZeroOrderHold(robot.command_period, 3))
        builder.Connect(hold.get_output_port(), command)
        command = hold.get_input_port()
    builder.ExportInput(command, "base_command")
    for port, name in (
        ("pose_estimate", "pose_estimate"),
        ("twist", "twist"),
        ("pose_estimate", "cheat_X_WB"),
    ):
        builder.ExportOutput(base.GetOutputPort(port), name)


def set_ground_start(
    plant: MultibodyPlant, model_instance: ModelInstanceIndex, start: tuple[float, float, float]
) -> None:
    """Sets the default x, y (metres) and yaw (radians) of a ground robot."""
    for name, value in zip(BASE_JOINTS, start, strict=True):
        joint = plant.GetJointByName(name, model_instance)
        position: Any = np.array([value])
        joint.set_default_positions(position)
