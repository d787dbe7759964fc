"""RGB-D cameras on a robot, rendered only when pulled: Drake's ``RgbdSensor``, or our own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FrameId,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.sensors import CameraInfo, RgbdSensor

from unilavira_drake.messages import Intrinsics
from unilavira_drake.raster import (
    RasterCamera,
    RasterCameraConfig,
    RasterView,
    add_raster_camera,
    suns_of,
)

RENDERER = "vtk"
"""Name of the render engine in the scene graph."""


_HOUSE, _TOWN = 40.0, 600.0
"""Metres; what depth cameras for rooms and for the open sky see at least in colour."""


class CameraModel(Protocol):
    """A robot's cameras, all alike: image size in pixels and field of view in degrees."""

    image_width: int
    image_height: int
    horizontal_fov_degrees: float


def front_intrinsics(robot: CameraModel) -> Intrinsics:
    """Returns the intrinsics of a robot's front camera, and of every other one that it has."""
    return pinhole(robot.image_width, robot.image_height, robot.horizontal_fov_degrees)


def pinhole(width: int, height: int, horizontal_fov_degrees: float) -> Intrinsics:
    """Returns square-pixel intrinsics with the principal point in the image's middle.

    Pixel centres have integer coordinates.
    """
    focal = width / (2.0 * math.tan(math.radians(horizontal_fov_degrees) / 2.0))
    return Intrinsics(width, height, focal, focal, width / 2 - 0.5, height / 2 - 0.5)


def add_renderer(scene_graph: SceneGraph, lights: Sequence[LightParameter]) -> None:
    """Adds Drake's VTK renderer on EGL: no display, no window."""
    parameters = RenderEngineVtkParams(lights=list(lights), backend="EGL")
    scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(parameters))


def add_rgbd_camera(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    *,
    frame_name: str,
    intrinsics: Intrinsics,
    min_depth: float,
    max_depth: float,
) -> RgbdSensor:
    """Adds a camera at a named frame of the plant (x right, y down, z forward).

    Colour, depth and label share one pinhole.  Depth is float32 metres along z: 0 nearer than
    ``min_depth``, inf beyond ``max_depth``.
    """
    body_frame, X_BC = _mount(plant, frame_name)
    core = _core(intrinsics, min_depth, max_depth)
    sensor: Any = builder.AddNamedSystem(
        frame_name,
        RgbdSensor(
            body_frame,
            X_BC,
            ColorRenderCamera(core, False),
            DepthRenderCamera(core, DepthRange(min_depth, max_depth)),
        ),
    )
    builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
    added: RgbdSensor = sensor
    return added


def add_raster_rgbd_camera(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    *,
    name: str,
    frame_names: Mapping[str, str],
    intrinsics: Intrinsics,
    min_depth: float,
    max_depth: float,
    lights: Sequence[LightParameter],
) -> RasterCamera | Diagram:
    """Adds cameras like ``add_rgbd_camera`` as a raster camera, which needs no renderer.

    Args:
        builder: as there, like what is not named here.
        plant: finalized.
        scene_graph: what it sees.
        name: of the new System.
        frame_names: camera frame of each view; a single view's ports have no prefix.
        intrinsics: of each view.
        min_depth: metres.
        max_depth: metres.
        lights: directional lights in the world.
    """
    views = []
    for view, frame_name in frame_names.items():
        body_frame, X_BC = _mount(plant, frame_name)
        views.append(
            RasterView(
                body_frame,
                X_BC,
                _core(intrinsics, min_depth, max_depth),
                DepthRange(min_depth, max_depth),
                name=view if len(frame_names) > 1 else "",
            )
        )
    config = RasterCameraConfig(tuple(views), light=suns_of(lights), fallback_lights=tuple(lights))
    return add_raster_camera(builder, scene_graph, config, name)


def _mount(plant: MultibodyPlant, frame_name: str) -> tuple[FrameId, RigidTransform]:
    """Returns the frame of the body that carries a camera, and the camera's pose in it."""
    frame: Any = plant.GetFrameByName(frame_name)
    return plant.GetBodyFrameIdOrThrow(frame.body().index()), frame.GetFixedPoseInBodyFrame()


def _core(intrinsics: Intrinsics, min_depth: float, max_depth: float) -> RenderCameraCore:
    # Measured on rendered depth (1.51, 1.58): Drake's renderer takes the principal point in
    # coordinates whose integers are pixel corners, half a pixel from ours.
    return RenderCameraCore(
        RENDERER,
        CameraInfo(
            intrinsics.width,
            intrinsics.height,
            intrinsics.fx,
            intrinsics.fy,
            intrinsics.cx + 0.5,
            intrinsics.cy + 0.5,
        ),
        ClippingRange(min(0.05, min_depth), _farthest(max_depth)),
        RigidTransform(),
    )


def _farthest(max_depth: float) -> float:
    """Returns how far colours reach, metres: through a house, or over a town to the horizon."""
    return max(_HOUSE, 2.0 * max_depth) if max_depth <= _HOUSE / 2 else max(_TOWN, 2.0 * max_depth)
