"""The station's cameras: one for each view of the robot, drawn by either renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydrake.common.value import AbstractValue
from pydrake.geometry import LightParameter, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantValueSource

from unilavira_drake.robots.robot import Robot
from unilavira_drake.sensors.camera_mounts import CameraMounts
from unilavira_drake.sensors.exposure import ExposureControl
from unilavira_drake.sensors.exposure_config import ExposureConfig
from unilavira_drake.sensors.rig import (
    add_raster_rgbd_camera,
    add_rgbd_camera,
    front_intrinsics,
)
from unilavira_drake.sensors.scene_camera import SceneCamera


def camera_frame(view: str) -> str:
    """Returns the name of a view's frame in the robot's model."""
    return f"{view}_camera"


def add_raster_cameras(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    robot: Robot,
    lights: Sequence[LightParameter],
) -> dict[str, OutputPort]:
    """Adds our own cameras, whose pictures depend on positions alone; a clone shares them.

    Front and down are cameras of their own, whose depth is wanted all the way; the others are one
    rig, drawn in one call.

    Returns:
        The port of each view's colours; depth and label are exported.
    """
    colors = {}
    alone = [(camera_frame(view), (view,)) for view in ("front", "down") if view in robot.views]
    others = tuple(view for view in robot.views if view not in ("front", "down"))
    for name, views in (*alone, ("other_cameras", others)):
        if not views:
            continue
        camera = add_raster_rgbd_camera(
            builder,
            plant,
            scene_graph,
            name=name,
            frame_names={view: camera_frame(view) for view in views},
            intrinsics=front_intrinsics(robot),
            min_depth=robot.min_depth,
            max_depth=robot.max_depth,
            lights=lights,
        )
        for view in views:
            prefix = f"{view}." if len(views) > 1 else ""
            colors[view] = camera.GetOutputPort(f"{prefix}color_image")
            depth = camera.GetOutputPort(f"{prefix}depth_image_32f")
            builder.ExportOutput(depth, f"{view}.depth_image")
            label = camera.GetOutputPort(f"{prefix}label_image")
            builder.ExportOutput(label, f"{view}.label_image")
    return colors


def add_scene_cameras(
    builder: DiagramBuilder, plant: MultibodyPlant, scene: Diagram, robot: Robot
) -> dict[str, OutputPort]:
    """Adds Drake's cameras, on a scene of its own that serves all clones.

    Args:
        builder: of the station.
        plant: the simulated one.
        scene: what ``add_scene_sensors`` was called for.
        robot: whose views these are.

    Returns:
        The port of each view's colours; depth and label are exported.
    """
    camera = builder.AddNamedSystem("cameras", SceneCamera(scene, views=robot.views))
    builder.Connect(plant.get_state_output_port(), camera.GetInputPort("plant_state"))
    for view in robot.views:
        for image in ("depth_image", "label_image"):
            builder.ExportOutput(camera.GetOutputPort(f"{view}.{image}"), f"{view}.{image}")
    return {view: camera.GetOutputPort(f"{view}.color_image") for view in robot.views}


def add_exposure(
    builder: DiagramBuilder,
    colors: Mapping[str, OutputPort],
    config: ExposureConfig,
    *,
    period: float,
    has_recalibrations: bool,
) -> None:
    """Exports the colours of all views, through an exposure control unless it is fixed.

    Args:
        builder: of the station.
        colors: port of each view.
        config: of the exposure.
        period: seconds between two looks at ``recalibrations``.
        has_recalibrations: whether the station has that input port already.
    """
    if config.mode == "fixed":
        for view, port in colors.items():
            builder.ExportOutput(port, f"{view}.color_image")
        return
    control = builder.AddSystem(ExposureControl(config=config, views=list(colors), period=period))
    for view, port in colors.items():
        builder.Connect(port, control.GetInputPort(f"{view}.raw_image"))
        name = f"{view}.color_image"
        builder.ExportOutput(control.GetOutputPort(name), name)
    if control.HasInputPort("recalibrations"):
        recalibrations = control.GetInputPort("recalibrations")
        if has_recalibrations:
            builder.ConnectInput("recalibrations", recalibrations)
        else:
            builder.ExportInput(recalibrations, "recalibrations")


def add_scene_sensors(
    builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph, robot: Robot
) -> None:
    """Adds an ``RgbdSensor`` for each view to a scene that is only rendered."""
    for view in robot.views:
        sensor = add_rgbd_camera(
            builder,
            plant,
            scene_graph,
            frame_name=camera_frame(view),
            intrinsics=front_intrinsics(robot),
            min_depth=robot.min_depth,
            max_depth=robot.max_depth,
        )
        builder.ExportOutput(sensor.color_image_output_port(), f"{view}.color_image")
        builder.ExportOutput(sensor.depth_image_32F_output_port(), f"{view}.depth_image")
        builder.ExportOutput(sensor.label_image_output_port(), f"{view}.label_image")


def add_camera_mounts(
    builder: DiagramBuilder, plant: MultibodyPlant, base: RigidBody, robot: Robot
) -> None:
    """Exports each camera's pose in the base: a constant where nothing sways in between."""
    swaying = {}
    for view in robot.views:
        frame: Any = plant.GetFrameByName(camera_frame(view))
        if frame.body().index() != base.index():
            swaying[view] = frame
            continue
        X_BC = frame.GetFixedPoseInBodyFrame()
        mount = ConstantValueSource(AbstractValue.Make(X_BC))
        builder.AddNamedSystem(f"{view}_mount", mount)
        builder.ExportOutput(mount.get_output_port(), f"{view}.X_BC")
    if swaying:
        mounts = builder.AddSystem(CameraMounts(plant, base, swaying))
        builder.Connect(plant.get_body_poses_output_port(), mounts.GetInputPort("body_poses"))
        for view in swaying:
            builder.ExportOutput(mounts.GetOutputPort(f"{view}.X_BC"), f"{view}.X_BC")
