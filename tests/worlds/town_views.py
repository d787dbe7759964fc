"""Views of the town for tests: one raster camera that is put anywhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ClippingRange, DepthRange, RenderCameraCore
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from unilavira_drake.raster import RasterCameraConfig, RasterView, add_raster_camera, suns_of
from unilavira_drake.worlds.scenery import add_scenery, lights
from unilavira_drake.worlds.world import World

WIDTH, HEIGHT, FAR = 320, 240, 600.0


class TownCamera:
    """A camera on a body without mass that is put where it is wanted."""

    def __init__(self, world: World) -> None:
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        add_scenery(plant, scene_graph, world)
        self._body = plant.AddRigidBody("camera", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        plant.Finalize()
        focal = WIDTH / 2
        core = RenderCameraCore(
            "raster",
            CameraInfo(WIDTH, HEIGHT, focal, focal, WIDTH / 2, HEIGHT / 2),
            ClippingRange(0.05, FAR),
            RigidTransform(),
        )
        view = RasterView(
            plant.GetBodyFrameIdOrThrow(self._body.index()),
            RigidTransform(),
            core,
            DepthRange(0.1, FAR),
        )
        suns = lights(mirrored=world.mirrored)
        config = RasterCameraConfig((view,), light=suns_of(suns), fallback_lights=tuple(suns))
        self._camera: Any = add_raster_camera(builder, scene_graph, config, "camera")
        self._plant = plant
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def frame(self, p_WC: tuple[float, float, float], yaw: float, pitch: float) -> Any:
        """Returns colour, depth and label; the pitch is positive downwards, radians."""
        c, s = math.cos(yaw), math.sin(yaw)
        ahead = np.array([c * math.cos(pitch), s * math.cos(pitch), -math.sin(pitch)])
        right = np.array([s, -c, 0.0])
        R_WC: Any = np.stack((right, np.cross(ahead, right), ahead), axis=1)
        p: Any = p_WC
        context: Any = self._plant.GetMyContextFromRoot(self._context)
        self._plant.SetFreeBodyPose(context, self._body, RigidTransform(RotationMatrix(R_WC), p))
        return self._camera.frames(self._camera.GetMyContextFromRoot(self._context))[0]

    def labels(self, p_WC: tuple[float, float, float], yaw: float, pitch: float) -> NDArray[Any]:
        """Returns how many pixels show each label."""
        label = self.frame(p_WC, yaw, pitch).label
        return np.bincount(label.ravel(), minlength=32768)
