"""Actuation on the ground: a twist in the plane, carried out by servos of the joints."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System

from unilavira_drake.errors import ScenarioError
from unilavira_drake.robots.gait import joints_without
from unilavira_drake.robots.planar_base import BASE_JOINTS, HEIGHT_JOINT, PlanarBase
from unilavira_drake.robots.planar_pose import PlanarPose
from unilavira_drake.robots.robot import GroundRobot
from unilavira_drake.robots.terrain import GroundHeight, TerrainFollower, set_start_height
from unilavira_drake.robots.velocity_servo import VelocityServo, take_servos
from unilavira_drake.robots.walking_base import WalkingBase


def add_ground_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: GroundRobot,
    locomotion: System | None = None,
    ground_height: GroundHeight | None = None,
) -> tuple[OutputPort, OutputPort]:
    """Adds the base of a ground robot; see ``add_actuation``.

    Returns:
        The ports of the true pose X_WB and of the twist.

    Raises:
        ScenarioError: if our locomotion shall swing a joint that the model lacks.
    """
    if robot.gait is None and locomotion is None:
        locomotion = PlanarBase(holonomic=robot.holonomic)
    joints = joint_names(plant, model_instance)
    actuated = actuator_names(plant, model_instance)
    if locomotion is None:
        _check_gait(robot, actuated)
        locomotion = WalkingBase(
            robot=robot,
            joints=[name for name in joints if name != HEIGHT_JOINT],
            actuated=[name for name in actuated if name != HEIGHT_JOINT],
            time_step=plant.time_step(),
        )
    builder.AddNamedSystem("locomotion", locomotion)
    state = plant.get_state_output_port(model_instance)
    desired = _servo_input(builder, plant, model_instance)
    if HEIGHT_JOINT in joints and ground_height is not None:
        terrain = builder.AddSystem(
            TerrainFollower(joints=joints, actuated=actuated, ground_height=ground_height)
        )
        builder.Connect(state, terrain.GetInputPort("joint_state"))
        builder.Connect(
            terrain.GetOutputPort("level_joint_state"), locomotion.GetInputPort("joint_state")
        )
        builder.Connect(
            locomotion.GetOutputPort("desired_joint_state"),
            terrain.GetInputPort("desired_level_joint_state"),
        )
        builder.Connect(terrain.GetOutputPort("desired_joint_state"), desired)
    else:
        builder.Connect(state, locomotion.GetInputPort("joint_state"))
        builder.Connect(locomotion.GetOutputPort("desired_joint_state"), desired)
    builder.ExportInput(locomotion.GetInputPort("base_command"), "base_command")
    pose = builder.AddSystem(PlanarPose(joints=joints))
    builder.Connect(state, pose.GetInputPort("joint_state"))
    return pose.GetOutputPort("X_WB"), pose.GetOutputPort("twist")


def _servo_input(
    builder: DiagramBuilder, plant: MultibodyPlant, model_instance: ModelInstanceIndex
) -> InputPort:
    """The port that takes the desired state of the actuated joints, of whichever servos."""
    gains = take_servos(plant, model_instance)
    if gains is None:
        return plant.get_desired_state_input_port(model_instance)
    servo = builder.AddSystem(VelocityServo(gains))
    state = plant.get_state_output_port(model_instance)
    builder.Connect(state, servo.GetInputPort("joint_state"))
    builder.Connect(
        servo.GetOutputPort("actuation"), plant.get_actuation_input_port(model_instance)
    )
    return servo.GetInputPort("desired_joint_state")


def _check_gait(robot: GroundRobot, actuated: Collection[str]) -> None:
    """Refuses a gait of which the model would show nothing."""
    lacking = joints_without(robot.gait, actuated) if robot.gait else {}
    if not lacking:
        return
    numbers = ", ".join(f"{name} {getattr(robot.gait, name):g}" for name in lacking)
    zeros = ", ".join(f"{name}: 0" for name in lacking)
    raise ScenarioError(
        f"robot.gait: {numbers}: the model {robot.model or robot.name!r} lacks the joints that "
        f"would show it ({', '.join(map(repr, lacking.values()))}); add them, with "
        f"drake:controller_gains (docs/add_a_robot.md), or set {{{zeros}}}."
    )


def set_ground_start(
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    start: tuple[float, float, float],
    height: float = 0.0,
) -> None:
    """Sets the default x, y (metres) and yaw (radians) of a ground robot.

    ``height`` is that of the floor, metres; a robot that does not climb stands at 0.
    """
    set_start_height(plant, model_instance, height)
    for name, value in zip(BASE_JOINTS, start, strict=True):
        joint = plant.GetJointByName(name, model_instance)
        position: Any = np.array([value])
        joint.set_default_positions(position)


def joint_names(plant: MultibodyPlant, model_instance: ModelInstanceIndex) -> list[str]:
    """Returns the names of a model's moving joints in the order of its positions.

    Args:
        plant: finalized.
        model_instance: whose joints have one coordinate each.
    """
    joints = [plant.get_joint(index) for index in plant.GetJointIndices(model_instance)]
    moving = [joint for joint in joints if joint.num_positions()]
    return [joint.name() for joint in sorted(moving, key=lambda joint: joint.position_start())]


def actuator_names(plant: MultibodyPlant, model_instance: ModelInstanceIndex) -> list[str]:
    """Returns the names of a model's actuated joints in the order of its actuators."""
    indices = plant.GetJointActuatorIndices(model_instance)
    return [plant.get_joint_actuator(index).joint().name() for index in indices]
