"""Adds a world to a plant and its scene graph: few flat-shaded labelled meshes, solid boxes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import Box as BoxShape
from pydrake.geometry import (
    GeometryInstance,
    IllustrationProperties,
    InMemoryMesh,
    LightParameter,
    Mesh,
    PerceptionProperties,
    RenderLabel,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant

from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import Box, Room, World

Color = tuple[float, float, float]

_CORNERS = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 2.0
# Corners of each face, counter-clockwise seen from outside, in the order -x +x -y +y -z +z.
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_NORMALS = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)])

_LIGHTS = ((-0.94, -0.90, -0.50), (0.86, 0.78, -0.50), (0.0, 0.0, 0.80))
"""Each light's direction of travel times its intensity: what a face square to an axis gets."""


def lights(*, mirrored: bool = False) -> list[LightParameter]:
    """Returns three lights that give each of the six directions of a box its own brightness.

    So every face is lit, edges stay visible, and a face square to the axes keeps between 0.78
    and 1.0 of its colour: enough to recognise the colour word.  Three cost 4 ms of CPU less an
    image than six on the axes.  The lights of a mirrored world are mirrored too.
    """
    sign = -1.0 if mirrored else 1.0
    return [
        LightParameter(
            type="directional",
            frame="world",
            direction=(x, sign * y, z),
            intensity=math.hypot(x, y, z),
        )
        for x, y, z in _LIGHTS
    ]


@dataclass(frozen=True)
class _Surface:
    """Flat polygons of one colour and one label: (k, 4, 3) corners and (k, 3) normals."""

    name: str
    label: int
    color: Color
    quads: NDArray[np.float64]
    normals: NDArray[np.float64]
    solid: bool = True
    """Shown to people too; a ceiling is not, it would hide the rooms from above."""


def add_scenery(plant: MultibodyPlant, scene_graph: SceneGraph, world: World) -> None:
    """Adds a world's collision boxes and labelled meshes to the world body.

    Call it before ``plant.Finalize()``.  The floor has no collision geometry: the bases move in
    the plane.
    """
    friction = CoulombFriction(0.5, 0.5)
    boxes = [("wall", box) for box in world.walls]
    boxes += [(thing.name, box) for thing in world.objects for box in thing.boxes]
    for index, (name, box) in enumerate(boxes):
        p_WB: Any = box.center
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform(RollPitchYaw(0, 0, box.yaw), p_WB),
            BoxShape(*box.size),
            f"{name}_{index}",
            friction,
        )
    for surface in _surfaces(world):
        _register(plant, scene_graph, surface)


def _surfaces(world: World) -> Iterable[_Surface]:
    for thing in world.objects:
        label = world.label_of(thing.name)
        assert label is not None
        quads, normals = _box_quads(thing.boxes)
        yield _Surface(thing.name, label, PALETTE[thing.color], quads, normals)
    for room in world.rooms:
        label = world.label_of(f"{room.name}_floor")
        assert label is not None
        quads, normals = _rectangles((room,), 0.0, up=True)
        yield _Surface(f"{room.name}_floor", label, room.floor_color, quads, normals)
    wall = world.label_of("walls")
    assert wall is not None
    quads, normals = _box_quads(world.walls)
    yield _Surface("walls", wall, world.wall_color, quads, normals)
    quads, normals = _rectangles(world.rooms, world.wall_height, up=False)
    yield _Surface("ceiling", wall, world.wall_color, quads, normals, solid=False)


def _box_quads(boxes: Sequence[Box]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    quads, normals = [], []
    for box in boxes:
        R_WB = RollPitchYaw(0, 0, box.yaw).ToRotationMatrix().matrix()
        corners = (_CORNERS * np.array(box.size)) @ R_WB.T + np.array(box.center)
        quads.append(corners[np.array(_FACES)])
        normals.append(_NORMALS @ R_WB.T)
    return np.concatenate(quads), np.concatenate(normals)


def _rectangles(
    rooms: Sequence[Room], z: float, *, up: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    quads = []
    for room in rooms:
        x_min, y_min, x_max, y_max = room.rectangle
        loop = [(x_min, y_min, z), (x_max, y_min, z), (x_max, y_max, z), (x_min, y_max, z)]
        quads.append(loop if up else loop[::-1])
    normals = np.tile([0.0, 0.0, 1.0 if up else -1.0], (len(rooms), 1))
    return np.array(quads, dtype=float), normals


def _register(plant: MultibodyPlant, scene_graph: SceneGraph, surface: _Surface) -> None:
    mesh = Mesh(
        mesh_data=InMemoryMesh(mesh_file=MemoryFile(_obj(surface), ".obj", surface.name)), scale=1.0
    )
    instance = GeometryInstance(RigidTransform(), mesh, f"scenery_{surface.name}")
    rgba = Rgba(*surface.color, 1.0)
    perception = PerceptionProperties()
    perception.AddProperty("phong", "diffuse", rgba)
    perception.AddProperty("label", "id", RenderLabel(surface.label))
    instance.set_perception_properties(perception)
    if surface.solid:
        illustration = IllustrationProperties()
        illustration.AddProperty("phong", "diffuse", rgba)
        instance.set_illustration_properties(illustration)
    source = plant.get_source_id()
    assert source is not None
    scene_graph.RegisterAnchoredGeometry(source, instance)


def _obj(surface: _Surface) -> str:
    """Returns the surface as the text of an .obj file, one normal a polygon."""
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*corner) for corner in surface.quads.reshape(-1, 3)]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*normal) for normal in surface.normals]
    for i in range(len(surface.quads)):
        a, b, c, d = (f"{4 * i + k}//{i + 1}" for k in (1, 2, 3, 4))
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    return "\n".join(lines) + "\n"
