"""Adds a raster camera to a diagram, or Drake's own renderer where OpenGL cannot be used."""

from __future__ import annotations

import warnings
from typing import Any

from pydrake.geometry import (
    ColorRenderCamera,
    DepthRenderCamera,
    MakeRenderEngineVtk,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.sensors import RgbdSensor

from unilavira_drake.errors import RenderingError
from unilavira_drake.raster.config import RasterCameraConfig
from unilavira_drake.raster.stage import shared_stage
from unilavira_drake.raster.system import RasterCamera

_PORTS = (
    "color_image",
    "depth_image_32f",
    "depth_image_16u",
    "label_image",
    "body_pose_in_world",
)


class RasterFallbackWarning(UserWarning):
    """The raster camera cannot work here; Drake's slower VTK renderer takes its place."""


def raster_works() -> bool:
    """Returns whether raster cameras can draw in this process; warns when not."""
    try:
        shared_stage()
    except RenderingError as error:
        warnings.warn(
            f"{error}; Drake's VTK renderer draws instead, several times slower",
            RasterFallbackWarning,
            stacklevel=2,
        )
        return False
    return True


def add_raster_camera(
    builder: DiagramBuilder,
    scene_graph: SceneGraph,
    config: RasterCameraConfig,
    name: str = "raster_camera",
) -> RasterCamera | Diagram:
    """Adds a camera rig, connected to the scene graph.

    Call it when the plant is finalized.  All geometries registered so far are read and sent to
    the graphics side now.  Without ``moderngl`` or a recent OpenGL the rig is a Diagram of
    ``RgbdSensor`` with the same ports, and a ``RasterFallbackWarning`` says why.

    Args:
        builder: of the diagram that has the scene graph.
        scene_graph: what the camera sees: its perception role.
        config: views, light and background.
        name: of the new System.

    Raises:
        GeometryError: naming the geometry, if one has a broken or missing file, a huge picture or
            a shape that cannot be drawn.
    """
    camera: Any
    if raster_works():
        camera = RasterCamera(shared_stage(), config)
        camera.renderer.scene(scene_graph.model_inspector())
    else:
        camera = _vtk_rig(scene_graph, config)
    builder.AddNamedSystem(name, camera)
    builder.Connect(scene_graph.get_query_output_port(), camera.GetInputPort("geometry_query"))
    rig: RasterCamera | Diagram = camera
    return rig


def _vtk_rig(scene_graph: SceneGraph, config: RasterCameraConfig) -> Diagram:
    """Returns a Diagram with the ports of a ``RasterCamera``, drawn by VTK."""
    builder = DiagramBuilder()
    sensors = []
    for view in config.views:
        renderer = view.core.renderer_name()
        if not scene_graph.HasRenderer(renderer):
            parameters = RenderEngineVtkParams(
                lights=list(config.fallback_lights),
                default_clear_color=config.background,
                backend="EGL",
            )
            scene_graph.AddRenderer(renderer, MakeRenderEngineVtk(parameters))
        sensor: Any = builder.AddSystem(
            RgbdSensor(
                view.parent_frame_id,
                view.X_PB,
                ColorRenderCamera(view.core),
                DepthRenderCamera(view.core, view.depth_range),
            )
        )
        sensors.append(sensor)
        if len(sensors) == 1:
            builder.ExportInput(sensor.query_object_input_port(), "geometry_query")
        else:
            builder.ConnectInput("geometry_query", sensor.query_object_input_port())
        for port in _PORTS:
            builder.ExportOutput(sensor.GetOutputPort(port), view.port(port))
    builder.ExportOutput(sensors[0].image_time_output_port(), "image_time")
    return builder.Build()
