"""The station: robot, world and cameras as one Diagram with named ports."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import ConstantValueSource

from unilavira_drake.raster import raster_works
from unilavira_drake.resources import package_xml
from unilavira_drake.robots.planar_base import PlanarBase
from unilavira_drake.scenario import Scenario
from unilavira_drake.sensors.rig import (
    add_raster_rgbd_camera,
    add_renderer,
    add_rgbd_camera,
    front_intrinsics,
)
from unilavira_drake.sensors.scene_camera import SceneCamera
from unilavira_drake.task_choice import choose_task
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery, lights
from unilavira_drake.worlds.start import parse_start
from unilavira_drake.worlds.world import World


def add_navigation_station(
    builder: DiagramBuilder,
    scenario: Scenario,
    world: World | None = None,
    *,
    X_WB_start: RigidTransform | None = None,
) -> Diagram:
    """Adds the Diagram of ``make_navigation_station`` to a builder.

    Args:
        builder: of the diagram that gets the station.
        scenario: what to build.
        world: read from the scenario when None.
        X_WB_start: where the robot starts; the chosen task's start when None.

    Raises:
        ScenarioError: if the world's file cannot be used.
        TaskError: if the start cannot be used.
    """
    start = None
    if X_WB_start is not None:
        x, y, _ = X_WB_start.translation()
        start = (x, y, X_WB_start.rotation().ToRollPitchYaw().yaw_angle())
    station = make_navigation_station(scenario, world=world, start=start)
    builder.AddSystem(station)
    return station


def make_navigation_station(
    scenario: Scenario,
    *,
    world: World | None = None,
    start: tuple[float, float, float] | None = None,
) -> Diagram:
    """Returns the Diagram ``station``: plant, scene graph, front camera and actuation.

    .. pydrake_system::
        name: station
        input_ports:
        - base_command
        output_ports:
        - front.color_image
        - front.depth_image
        - front.label_image
        - front.X_BC
        - pose_estimate
        - twist
        - contact_results
        - cheat_X_WB

    Images are rendered only when pulled, by one renderer for all clones of a Context:
    ``scenario.renderer`` says which.
    ``cheat_X_WB`` is the true pose: for scoring only.

    Args:
        scenario: what to build.
        world: read from the scenario when None.
        start: x, y (metres) and yaw (radians); the chosen task's start when None.

    Raises:
        ScenarioError: if the world's file cannot be used.
        TaskError: if the start cannot be used.
    """
    if world is None:
        world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    if start is None:
        start = parse_start(
            choose_task(scenario).start, world, radius=scenario.robot.turning_radius
        )
    builder = DiagramBuilder()
    plant, scene_graph, robot = _add_scene(builder, scenario, world)
    q: Any = np.array(start)
    plant.SetDefaultPositions(robot, q)
    _add_base(builder, plant, robot)
    if scenario.renderer == "raster" and raster_works():
        camera, X_BC = _raster_camera(builder, plant, scene_graph, scenario, world)
    else:
        camera, X_BC = _vtk_camera(builder, plant, scenario, world)
    _export_front_camera(builder, camera, X_BC)
    builder.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    if scenario.meshcat:
        _add_meshcat(builder, scene_graph)
    station = builder.Build()
    station.set_name("station")
    return station


def _add_scene(
    builder: DiagramBuilder, scenario: Scenario, world: World
) -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    plant, scene_graph = AddMultibodyPlant(scenario.plant, builder)
    add_scenery(plant, scene_graph, world)
    robot = _add_robot(plant, scenario.robot.name)
    plant.Finalize()
    return plant, scene_graph, robot


def _add_robot(plant: MultibodyPlant, name: str) -> ModelInstanceIndex:
    parser = Parser(plant)
    parser.package_map().AddPackageXml(package_xml())
    (robot,) = parser.AddModelsFromUrl(f"package://unilavira_drake/robots/{name}.sdf")
    return robot


def _add_base(builder: DiagramBuilder, plant: MultibodyPlant, robot: ModelInstanceIndex) -> None:
    base = builder.AddSystem(PlanarBase())
    builder.Connect(plant.get_state_output_port(robot), base.GetInputPort("joint_state"))
    builder.Connect(
        base.GetOutputPort("desired_joint_state"), plant.get_desired_state_input_port(robot)
    )
    builder.ExportInput(base.GetInputPort("base_command"), "base_command")
    for port, name in (
        ("pose_estimate", "pose_estimate"),
        ("twist", "twist"),
        ("pose_estimate", "cheat_X_WB"),
    ):
        builder.ExportOutput(base.GetOutputPort(port), name)


def _raster_camera(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    scenario: Scenario,
    world: World,
) -> tuple[System, RigidTransform]:
    """Adds our own camera, whose pictures depend on positions alone; a clone shares them."""
    robot = scenario.robot
    return add_raster_rgbd_camera(
        builder,
        plant,
        scene_graph,
        frame_name="front_camera",
        intrinsics=front_intrinsics(robot),
        min_depth=robot.min_depth,
        max_depth=robot.max_depth,
        lights=lights(mirrored=world.mirrored),
    )


def _vtk_camera(
    builder: DiagramBuilder, plant: MultibodyPlant, scenario: Scenario, world: World
) -> tuple[System, RigidTransform]:
    """Adds Drake's camera, on a scene of its own that serves all clones."""
    scene, X_BC = _picture_scene(scenario, world)
    camera = builder.AddNamedSystem("front_camera", SceneCamera(scene))
    builder.Connect(plant.get_state_output_port(), camera.GetInputPort("plant_state"))
    return camera, X_BC


def _export_front_camera(builder: DiagramBuilder, camera: System, X_BC: RigidTransform) -> None:
    depth = "depth_image_32f" if camera.HasOutputPort("depth_image_32f") else "depth_image"
    for port, name in (
        ("color_image", "color_image"),
        (depth, "depth_image"),
        ("label_image", "label_image"),
    ):
        builder.ExportOutput(camera.GetOutputPort(port), f"front.{name}")
    mount = builder.AddNamedSystem("front_mount", ConstantValueSource(AbstractValue.Make(X_BC)))
    builder.ExportOutput(mount.get_output_port(), "front.X_BC")


def _picture_scene(scenario: Scenario, world: World) -> tuple[Diagram, RigidTransform]:
    """Returns the scene that is rendered, and the camera's pose in its body."""
    robot = scenario.robot
    builder = DiagramBuilder()
    plant, scene_graph, _ = _add_scene(builder, scenario, world)
    add_renderer(scene_graph, lights(mirrored=world.mirrored, textured=world.textured))
    sensor, X_BC = add_rgbd_camera(
        builder,
        plant,
        scene_graph,
        frame_name="front_camera",
        intrinsics=front_intrinsics(robot),
        min_depth=robot.min_depth,
        max_depth=robot.max_depth,
    )
    builder.ExportOutput(sensor.color_image_output_port(), "color_image")
    builder.ExportOutput(sensor.depth_image_32F_output_port(), "depth_image")
    builder.ExportOutput(sensor.label_image_output_port(), "label_image")
    return builder.Build(), X_BC


def _add_meshcat(builder: DiagramBuilder, scene_graph: SceneGraph) -> None:
    # Half a second to import, so only when asked for.
    from pydrake.geometry import MeshcatVisualizer, StartMeshcat

    MeshcatVisualizer.AddToBuilder(builder, scene_graph, StartMeshcat())
