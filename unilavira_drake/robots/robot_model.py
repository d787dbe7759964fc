"""The robot's model: its file, read into a plant, and what every other part takes for granted."""

from __future__ import annotations

import math
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from unilavira_drake.errors import ScenarioError
from unilavira_drake.resources import package_xml
from unilavira_drake.robots.planar_base import BASE_JOINTS
from unilavira_drake.robots.robot import GroundRobot, Robot
from unilavira_drake.robots.terrain import climbing_model


def add_robot_model(plant: MultibodyPlant, robot: Robot) -> ModelInstanceIndex:
    """Adds the model of a robot to a plant; one that climbs gets a height joint.

    Args:
        plant: not finalized.
        robot: its ``model`` names the file; empty: the one of the package with the robot's name.

    Raises:
        ScenarioError: if the file cannot be read, or lacks a camera, the body ``base``, a collision
            shape or, of a ground robot, a joint of its base with servo and effort limit.
    """
    model = robot.model or f"package://unilavira_drake/robots/{robot.name}.sdf"
    parser = Parser(plant)
    parser.package_map().AddPackageXml(package_xml())
    known = "://" in model
    try:
        path = Path(parser.package_map().ResolveUrl(model) if known else model)
        if not path.is_file():
            raise ScenarioError(f"robot.model: no file {model!r}; check the path.")
        if robot.can_climb:
            found = parser.AddModelsFromString(climbing_model(path), "sdf")
        else:
            found = parser.AddModelsFromUrl(model) if known else parser.AddModels(path)
    except RuntimeError as error:
        raise ScenarioError(f"robot.model: {model!r} cannot be read: {error}.") from None
    if len(found) != 1:
        raise ScenarioError(f"robot.model: {model!r} holds {len(found)} models; give it just one.")
    missing = _missing(plant, found[0], robot)
    if missing:
        raise ScenarioError(f"robot.model: {model!r} has {missing}; see docs/add_a_robot.md.")
    return found[0]


def _missing(plant: MultibodyPlant, instance: ModelInstanceIndex, robot: Robot) -> str:
    """The first thing that the model lacks, in words; empty if it is complete."""
    for view in robot.views:
        if not plant.HasFrameNamed(f"{view}_camera", instance):
            return f"no frame '{view}_camera' for the camera {view!r} of robot.views"
    if not plant.HasBodyNamed("base", instance):
        return "no body 'base'"
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(instance)]
    if not any(plant.GetCollisionGeometriesForBody(body) for body in bodies):
        return "no collision shape, so it would pass through walls"
    return _missing_joint(plant, instance) if isinstance(robot, GroundRobot) else ""


def _missing_joint(plant: MultibodyPlant, instance: ModelInstanceIndex) -> str:
    # Before the plant is finalized it tells the actuators of all models only.
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    actuators = {one.joint().name(): one for one in every if one.model_instance() == instance}
    for name in BASE_JOINTS:
        if not plant.HasJointNamed(name, instance):
            return f"no joint {name!r}"
        actuator = actuators.get(name)
        if actuator is None or not actuator.has_controller():
            return f"no drake:controller_gains for the joint {name!r}, so nothing would move it"
        if not math.isfinite(actuator.effort_limit()):
            return f"no effort limit of the joint {name!r}, so no wall would stop it"
    return ""
