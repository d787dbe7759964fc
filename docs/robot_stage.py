"""A world with robots in it, seen from outside: what no robot's own camera shows."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.geometry import Box as BoxShape
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from unilavira_drake.resources import models_path, package_xml
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.scenery import add_scenery
from unilavira_drake.worlds.world import Box, LabelEntry, Room, World

Point = tuple[float, float, float]

UNSEEN = '<drake:perception_properties enabled="false"/>'
"""Hides a robot's body from its own cameras, so from all."""
SURFACES = {
    "grass": (0.45, 0.62, 0.36),
    "asphalt": (0.36, 0.37, 0.39),
    "paving": (0.72, 0.71, 0.68),
    "cobbles": (0.66, 0.62, 0.57),
    "gravel": (0.74, 0.69, 0.59),
    "sand": (0.87, 0.80, 0.62),
    "tartan": (0.70, 0.33, 0.26),
    "water": (0.35, 0.58, 0.80),
}
FAR = 60.0
"""Metres to the lamps that fill the shade; point lights cast no shadows in VTK."""
MATTE = math.pi
"""A matte surface shows 1/pi of its colour in a light of 1, in a renderer that goes by physics."""


def look_at(eye: Point, target: Point) -> RigidTransform:
    """Returns the pose of an upright camera (x right, y down, z forward); never straight down."""
    p_WC = np.array(eye, dtype=float)
    z = np.array(target) - p_WC
    z /= np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.column_stack([x, np.cross(z, x), z])), p_WC)


def studio() -> World:
    """Returns a pale floor and nothing else."""
    pale = (0.86, 0.87, 0.89)
    room = Room(name="studio", rectangle=(-60.0, -60.0, 60.0, 60.0), floor_color=pale)
    wall = Box(center=(0.0, 59.0, 0.5), size=(100.0, 0.1, 1.0))
    labels = {0: LabelEntry(instance="walls"), 1: LabelEntry(instance="studio_floor")}
    return World(name="studio", rooms=(room,), walls=(wall,), labels=labels, wall_color=pale)


def dolls_house(world: World, height: float) -> World:
    """Returns a world of boxes whose walls and doors are cut off at a height, to look inside."""
    return dc.replace(
        world,
        walls=_cut(world.walls, height),
        objects=tuple(
            dc.replace(thing, boxes=_cut(thing.boxes, height))
            if thing.category == "door"
            else thing
            for thing in world.objects
        ),
    )


def _cut(boxes: Sequence[Box], height: float) -> tuple[Box, ...]:
    kept = []
    for box in boxes:
        x, y, z = box.center
        low, high = z - box.size[2] / 2, min(z + box.size[2] / 2, height)
        if low < high:
            size = (*box.size[:2], high - low)
            kept.append(dc.replace(box, center=(x, y, (low + high) / 2), size=size))
    return tuple(kept)


def add_blocks(plant: MultibodyPlant, world: World) -> None:
    """Adds a town as plain boxes and surfaces: a hundredth of its size, and still a map."""
    boxes = []
    for layer, patch in enumerate(world.ground):
        x_min, y_min, x_max, y_max = patch.rectangle
        # Later ones lie over earlier ones, by more than a viewer from afar mixes up.
        top = 0.03 * (layer - len(world.ground))
        center = ((x_min + x_max) / 2, (y_min + y_max) / 2, top - 0.5)
        box = Box(center=center, size=(x_max - x_min, y_max - y_min, 1.0))
        boxes.append((box, SURFACES.get(patch.material, SURFACES["grass"])))
    for thing in world.objects:
        boxes += [(box, PALETTE[thing.color]) for box in thing.boxes]
    for index, (box, color) in enumerate(boxes):
        X_WB: Any = RigidTransform(RollPitchYaw(0, 0, box.yaw), np.array(box.center))
        shape, rgba = BoxShape(*box.size), np.array([*color, 1.0])
        plant.RegisterVisualGeometry(plant.world_body(), X_WB, shape, f"block_{index}", rgba)


def add_robot(plant: MultibodyPlant, name: str, *, seen: bool) -> ModelInstanceIndex:
    """Adds a robot of this package; ``seen``: cameras see its body."""
    parser = Parser(plant)
    parser.package_map().AddPackageXml(package_xml())
    model = (models_path() / "robots" / f"{name}.sdf").read_text(encoding="utf-8")
    (added,) = parser.AddModelsFromString(model.replace(UNSEEN, "") if seen else model, "sdf")
    return added


class Stage:
    """Holds robots still in a world, and takes pictures of them with shadows.

    Args:
        world: without its ceilings.
        robots: names; one each.
        shadows: pixels a side of the shadow's picture.
    """

    def __init__(self, world: World, robots: Sequence[str], *, shadows: int = 4096) -> None:
        builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        add_scenery(self.plant, self._scene_graph, world)
        self.instances = {name: add_robot(self.plant, name, seen=True) for name in robots}
        self.plant.Finalize()
        _lift_ceilings(self.plant, self._scene_graph)
        parameters = RenderEngineVtkParams(
            lights=_lights(),
            force_to_pbr=True,
            backend="EGL",
            cast_shadows=True,
            shadow_map_size=shadows,
            default_clear_color=[0.86, 0.91, 0.97],
        )
        self._scene_graph.AddRenderer("outside", MakeRenderEngineVtk(parameters))
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def place(self, positions: Mapping[str, NDArray[np.float64]]) -> None:
        """Puts robots where their joints say."""
        context = self.plant.GetMyMutableContextFromRoot(self._context)
        for name, q in positions.items():
            self.plant.SetPositions(context, self.instances[name], q)

    def picture(
        self,
        X_WC: RigidTransform,
        size: tuple[int, int],
        *,
        fov_degrees: float,
        nearest: float = 0.1,
    ) -> Image.Image:
        """Returns what a camera sees, drawn twice as large and made small: smooth edges.

        Nothing nearer than ``nearest`` metres is seen.
        """
        width, height = (2 * side for side in size)
        focal = width / 2.0 / math.tan(math.radians(fov_degrees) / 2.0)
        core = RenderCameraCore(
            "outside",
            CameraInfo(width, height, focal, focal, width / 2.0, height / 2.0),
            ClippingRange(nearest, 200.0),
            RigidTransform(),
        )
        context = self._scene_graph.GetMyContextFromRoot(self._context)
        query: Any = self._scene_graph.get_query_output_port().Eval(context)
        image = query.RenderColorImage(
            ColorRenderCamera(core, False), self._scene_graph.world_frame_id(), X_WC
        )
        pixels = np.array(image.data[:, :, :3])
        return Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS)


def _lift_ceilings(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    inspector = scene_graph.model_inspector()
    for geometry in inspector.GetAllGeometryIds(Role.kPerception):
        if inspector.GetName(geometry).endswith("ceiling"):
            source: Any = plant.get_source_id()
            scene_graph.RemoveRole(source, geometry, Role.kPerception)


def _lights() -> list[LightParameter]:
    """Returns a warm sun that casts shadows, and cool lamps around that do not."""
    lights = [
        LightParameter(
            type="directional",
            frame="world",
            direction=(0.3, 0.25, -1.0),
            intensity=0.5 * MATTE,
            color=Rgba(1.0, 0.95, 0.88),
        )
    ]
    for direction, intensity in (
        ((-0.94, -0.90, 0.9), 0.32),
        ((0.86, -0.60, 0.5), 0.30),
        ((-0.30, 0.80, 0.5), 0.36),
        ((0.0, 0.0, -1.0), 0.25),
    ):
        lights.append(
            LightParameter(
                type="point",
                frame="world",
                position=tuple(FAR * coordinate for coordinate in direction),
                intensity=intensity * MATTE,
                color=Rgba(0.93, 0.96, 1.0),
            )
        )
    return lights
