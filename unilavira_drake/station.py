"""The station: robot, world and cameras as one Diagram with named ports."""

from __future__ import annotations

import math

from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Diagram, DiagramBuilder, System

from unilavira_drake.people.adding import connect_people
from unilavira_drake.people.bodies import add_people
from unilavira_drake.people.crowd import Person, make_crowd, with_people
from unilavira_drake.raster import raster_works
from unilavira_drake.robots.actuation import add_actuation, set_start
from unilavira_drake.robots.planar_base import HEIGHT_JOINT
from unilavira_drake.robots.quadrotor_actuation import add_landing_ground
from unilavira_drake.robots.robot_model import add_robot_model
from unilavira_drake.robots.terrain import follow_terrain
from unilavira_drake.robots.wind import WindModel
from unilavira_drake.scenario import Scenario, plant_config
from unilavira_drake.sensors.rig import add_renderer
from unilavira_drake.station_cameras import (
    add_camera_mounts,
    add_exposure,
    add_raster_cameras,
    add_scene_cameras,
    add_scene_sensors,
)
from unilavira_drake.task_choice import start_pose
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery, lights
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
        ScenarioError: if the world's file or the robot's model cannot be used.
        TaskError: if the start cannot be used.
    """
    start, height = None, 0.0
    if X_WB_start is not None:
        x, y, height = X_WB_start.translation()
        start = (x, y, X_WB_start.rotation().ToRollPitchYaw().yaw_angle())
    station = make_navigation_station(scenario, world=world, start=start, start_height=height)
    builder.AddSystem(station)
    return station


def make_navigation_station(
    scenario: Scenario,
    *,
    world: World | None = None,
    start: tuple[float, float, float] | None = None,
    start_height: float = 0.0,
    locomotion: System | None = None,
) -> Diagram:
    """Returns the Diagram ``station``: plant, scene graph, cameras and actuation.

    .. pydrake_system::
        name: station
        input_ports:
        - base_command
        - recalibrations (only with an error of the pose or a locked exposure; optional)
        output_ports:
        - (view).color_image
        - (view).depth_image
        - (view).label_image
        - (view).X_BC
        - pose_estimate
        - twist
        - contact_results
        - cheat_X_WB
        - cheat_people (where the scenario has people)

    The ports are named alike for all robots; the robot's ``views`` say which views there are.
    Images are rendered only when pulled, by one renderer for all clones of a Context:
    ``scenario.renderer`` says which.
    ``cheat_X_WB`` is the true pose: for scoring only.  ``recalibrations`` is a count: when it
    grows, the drift of the pose is zero again, and the exposure is locked anew.

    Args:
        scenario: what to build.
        world: read from the scenario when None.
        start: x, y (metres) and yaw (radians); the chosen task's start when None.
        start_height: of the floor at ``start``, metres, or of an aircraft in the air.
        locomotion: a System in the place of the robot's own, see ``add_actuation``.

    Raises:
        ScenarioError: if the world's file or the robot's model cannot be used.
        TaskError: if the start cannot be used.
    """
    if world is None:
        world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    if start is None:
        x, y, start_height, yaw = start_pose(scenario, world)
        start = (x, y, yaw)
    builder = DiagramBuilder()
    world = with_people(world, scenario.people)
    people = make_crowd(scenario.people, world, seed=scenario.random_seed, robot=start[:2])
    plant, scene_graph, model_instance = _add_scene(builder, scenario, world, people)
    robot = scenario.robot
    set_start(plant, model_instance, robot, start, start_height)
    add_actuation(
        builder,
        plant,
        model_instance,
        robot,
        locomotion=locomotion,
        localization=scenario.pose_estimate,
        seed=scenario.random_seed,
        ground_height=world.ground_height,
        wind=_wind(scenario, world),
    )
    base = plant.GetBodyByName("base", model_instance)
    if people:
        connect_people(builder, plant, people, scenario.people, base, (robot.length, robot.width))
    if scenario.renderer == "raster" and raster_works():
        light = lights(mirrored=world.mirrored)
        colors = add_raster_cameras(builder, plant, scene_graph, robot, light)
    else:
        colors = add_scene_cameras(builder, plant, _picture_scene(scenario, world, people), robot)
    add_exposure(
        builder,
        colors,
        scenario.exposure,
        period=scenario.tick,
        has_recalibrations=not scenario.pose_estimate.exact,
    )
    add_camera_mounts(builder, plant, base, robot)
    builder.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    if scenario.meshcat:
        _add_meshcat(builder, scene_graph)
    station = builder.Build()
    station.set_name("station")
    return station


def _wind(scenario: Scenario, world: World) -> WindModel:
    wind = scenario.flight.mirrored_if(world.mirrored).wind
    return WindModel(
        wind.speed,
        math.radians(wind.direction_degrees),
        wind.gusts,
        wind.correlation_time,
        scenario.random_seed,
        world.mirrored,
    )


def _add_scene(
    builder: DiagramBuilder, scenario: Scenario, world: World, people: tuple[Person, ...]
) -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    plant, scene_graph = AddMultibodyPlant(plant_config(scenario), builder)
    ground = add_scenery(plant, scene_graph, world)
    model_instance = add_robot_model(plant, scenario.robot)
    if scenario.robot.flies:
        add_landing_ground(plant)
    add_people(plant, scene_graph, people)
    if plant.HasJointNamed(HEIGHT_JOINT, model_instance):
        follow_terrain(plant, scene_graph, model_instance, ground)
    plant.Finalize()
    return plant, scene_graph, model_instance


def _picture_scene(scenario: Scenario, world: World, people: tuple[Person, ...]) -> Diagram:
    """Returns the scene that is rendered."""
    builder = DiagramBuilder()
    plant, scene_graph, _ = _add_scene(builder, scenario, world, people)
    add_renderer(scene_graph, lights(mirrored=world.mirrored, textured=world.textured))
    add_scene_sensors(builder, plant, scene_graph, scenario.robot)
    return builder.Build()


def _add_meshcat(builder: DiagramBuilder, scene_graph: SceneGraph) -> None:
    # Half a second to import, so only when asked for.
    from pydrake.geometry import MeshcatVisualizer, StartMeshcat

    MeshcatVisualizer.AddToBuilder(builder, scene_graph, StartMeshcat())
