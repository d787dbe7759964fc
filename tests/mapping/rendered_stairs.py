"""Views of the house on two storeys, rendered."""

from __future__ import annotations

import math

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.messages import Frame, Intrinsics
from unilavira_drake.sensors.rig import add_raster_rgbd_camera
from unilavira_drake.worlds.scenery import add_scenery, lights
from unilavira_drake.worlds.world import World

LENS = Intrinsics(320, 240, 194.0, 194.0, 159.5, 119.5)
TILT = math.radians(10.0)

Place = tuple[float, float, float, float]
"""x, y, z of the floor, yaw."""


def camera_pose(place: Place, height: float) -> RigidTransform:
    """Returns X_WC of a camera over a place, ten degrees down."""
    x, y, z, yaw = place
    forward = np.array([math.cos(yaw) * math.cos(TILT), math.sin(yaw) * math.cos(TILT), 0.0])
    forward[2] = -math.sin(TILT)
    right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
    R_WC = RotationMatrix(np.stack([right, np.cross(forward, right), forward], axis=1))
    return RigidTransform(R_WC, [x, y, z + height])


def frames(world: World, places: list[Place], height: float) -> list[Frame]:
    """Returns the views of a camera from some places."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    add_scenery(plant, scene_graph, world)
    poses = [camera_pose(place, height) for place in places]
    for index, X_WC in enumerate(poses):
        plant.AddFrame(FixedOffsetFrame(f"camera_{index}", plant.world_frame(), X_WC))
    plant.Finalize()
    cameras = [
        add_raster_rgbd_camera(
            builder,
            plant,
            scene_graph,
            name=f"camera_{index}",
            frame_names={"front": f"camera_{index}"},
            intrinsics=LENS,
            min_depth=0.1,
            max_depth=10.0,
            lights=lights(mirrored=world.mirrored),
        )
        for index in range(len(places))
    ]
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    views = []
    for camera, X_WC in zip(cameras, poses, strict=True):
        context = camera.GetMyContextFromRoot(root)
        color, depth, label = (
            np.array(camera.GetOutputPort(port).Eval(context).data)
            for port in ("color_image", "depth_image_32f", "label_image")
        )
        views.append(
            Frame(
                color=color[:, :, :3],
                depth=depth[:, :, 0],
                label=label[:, :, 0],
                intrinsics=LENS,
                X_WC=X_WC.GetAsMatrix4(),
            )
        )
    return views
