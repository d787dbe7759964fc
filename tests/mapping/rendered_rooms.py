"""Furnished rooms as a camera sees them, and their true geometry: the oracle of map accuracy."""

import dataclasses as dc
import functools
import math

import numpy as np
import trimesh
from pydrake.geometry import ClippingRange, DepthRange, RenderCameraCore
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.raster import RasterCameraConfig, RasterView, add_raster_camera
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.worlds.furniture_library import furniture_models
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery
from unilavira_drake.worlds.world import Placement

LENS = pinhole(640, 480, 79.0)
HEIGHT, PITCH = 1.0, math.radians(10.0)
LABEL, DEPTH = "label_image", "depth_image_32f"


def part_of(world, rooms):
    """The world with nothing but some of its rooms, their walls and their things."""
    kept = [room for room in world.rooms if room.name in rooms]
    low = np.min([room.rectangle[:2] for room in kept], axis=0) - 0.2
    high = np.max([room.rectangle[2:] for room in kept], axis=0) + 0.2
    things = tuple(thing for thing in world.objects if set(thing.room.split("|")) & set(rooms))
    walls = tuple(
        box
        for box in world.walls
        if np.all(np.max(box.corners(), axis=0) > low)
        and np.all(np.min(box.corners(), axis=0) < high)
    )
    return dc.replace(world, rooms=tuple(kept), objects=things, walls=walls)


def without(world, name):
    """The world after a thing was carried away."""
    return dc.replace(world, objects=tuple(t for t in world.objects if t.name != name))


class Camera:
    """The camera of a robot, moved by hand through a world."""

    def __init__(self, world):
        builder = DiagramBuilder()
        self.plant, graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        inertia = SpatialInertia(1.0, [0, 0, 0], UnitInertia(1, 1, 1))
        self.body = self.plant.AddRigidBody("C", inertia)
        add_scenery(self.plant, graph, world)
        self.plant.Finalize()
        # Drake counts pixels from their corners.
        info = CameraInfo(LENS.width, LENS.height, LENS.fx, LENS.fy, LENS.cx + 0.5, LENS.cy + 0.5)
        core = RenderCameraCore("", info, ClippingRange(0.05, 40.0), RigidTransform())
        frame = self.plant.GetBodyFrameIdOrThrow(self.body.index())
        view = RasterView(frame, RigidTransform(), core, DepthRange(0.1, 10.0), "")
        self.camera = add_raster_camera(builder, graph, RasterCameraConfig((view,)))
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()

    def look(self, x, y, yaw):
        """The depth view from a place, and the labels of its pixels."""
        turn = RollPitchYaw(-math.pi / 2, 0, -math.pi / 2).ToRotationMatrix()
        level = RollPitchYaw(0.0, PITCH, yaw).ToRotationMatrix()
        X_WC = RigidTransform(level.multiply(turn), [x, y, HEIGHT])
        plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.plant.SetFreeBodyPose(plant_context, self.body, X_WC)
        context = self.camera.GetMyContextFromRoot(self.context)
        depth, label = (
            self.camera.GetOutputPort(port).Eval(context).data[:, :, 0].copy()
            for port in (DEPTH, LABEL)
        )
        return DepthView(depth, LENS, X_WC.GetAsMatrix4()), label

    def look_around(self, x, y, steps=18):
        """Depth views all around, as a robot that turns in place takes them."""
        return [self.look(x, y, math.tau * k / steps) for k in range(steps)]


@functools.lru_cache
def surface(model):
    """(k, 3) points on a piece of furniture, at most a centimetre apart; z up."""
    mesh = trimesh.load(furniture_models()[model].path, force="mesh")
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.02, 20)
    points = np.concatenate((vertices, vertices[faces].mean(axis=1)))
    # glTF has y up.
    return np.stack((points[:, 0], -points[:, 2], points[:, 1]), axis=1)


def box_surface(box):
    """(k, 3) points in a box, at most a centimetre apart along each axis."""
    axes = [
        np.linspace(-side / 2, side / 2, max(math.ceil(side / 0.01), 1) + 1)
        for side in box.size[:2]
    ]
    x, y = (grid.ravel() for grid in np.meshgrid(*axes))
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    low, high = (box.center[2] + sign * box.size[2] / 2 for sign in (-1, 1))
    points = [
        np.stack(
            (box.center[0] + c * x - s * y, box.center[1] + s * x + c * y, np.full_like(x, z)), 1
        )
        for z in np.linspace(low, high, max(math.ceil((high - low) / 0.05), 1) + 1)
    ]
    return np.concatenate(points)


def geometry(world):
    """(k, 3) points of all that is solid in a world."""
    points = [box_surface(box) for box in world.walls]
    for thing in world.objects:
        if isinstance(thing.visual, Placement):
            c, s = math.cos(thing.visual.yaw), math.sin(thing.visual.yaw)
            turned = surface(thing.visual.model) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
            points.append(turned + np.array(thing.visual.position))
        else:
            points += [box_surface(box) for box in thing.boxes]
    return np.concatenate(points)


def load_rooms(name, rooms):
    """Some rooms of a world that comes with the package."""
    return part_of(load_world(name), rooms)
