"""Adds a world to a plant and its scene graph: few labelled meshes, and solid boxes."""

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
    GeometryId,
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

from unilavira_drake.worlds import shell
from unilavira_drake.worlds.furniture_library import (
    furniture_mesh,
    furniture_model,
    furniture_models,
)
from unilavira_drake.worlds.gltf import TexturedQuads, textured_mesh
from unilavira_drake.worlds.outdoors.meshes import ground_meshes, solid_ground, thing_quads
from unilavira_drake.worlds.outdoors.things import Building, Exterior
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.panels import panel_quads
from unilavira_drake.worlds.stairs import Rectangle
from unilavira_drake.worlds.stairwell import (
    ceiling_holes,
    edge_boxes,
    floor_holes,
    pieces,
    slabs,
    stair_quads,
)
from unilavira_drake.worlds.world import (
    Box,
    Doorway,
    Panel,
    Placement,
    Room,
    World,
    WorldObject,
)

Color = tuple[float, float, float]

_CORNERS = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 2.0
# Corners of each face, counter-clockwise seen from outside, in the order -x +x -y +y -z +z.
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_NORMALS = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)])

_LIGHTS = ((-0.94, -0.90, -0.50), (0.86, 0.78, -0.50), (0.0, 0.0, 0.80))
"""Each light's direction of travel times its intensity: what a face square to an axis gets."""


_MATTE = math.pi
"""A matte glTF surface shows 1/pi of its colour for a light that shows all of a flat one's."""


def lights(*, mirrored: bool = False, textured: bool = False) -> list[LightParameter]:
    """Returns three lights that give each of the six directions of a box its own brightness.

    So every face is lit, edges stay visible, and a face square to the axes keeps between 0.78
    and 1.0 of its colour: enough to recognise the colour word.  Three cost 4 ms of CPU less an
    image than six on the axes.  The lights of a mirrored world are mirrored too.

    Args:
        mirrored: whether the world is.
        textured: whether its surfaces are glTF materials.
    """
    sign = -1.0 if mirrored else 1.0
    gain = _MATTE if textured else 1.0
    return [
        LightParameter(
            type="directional",
            frame="world",
            direction=(x, sign * y, z),
            intensity=gain * math.hypot(x, y, z),
        )
        for x, y, z in _LIGHTS
    ]


_HERE = RigidTransform()


@dataclass(frozen=True)
class _Shape:
    """A mesh with one label."""

    name: str
    label: int
    mesh: Mesh
    X_WM: RigidTransform
    color: Color | None = None
    """Of a mesh without materials of its own."""
    shown: bool = True
    """To people, too; a ceiling is not, it would hide the rooms from above."""


def add_scenery(
    plant: MultibodyPlant, scene_graph: SceneGraph, world: World
) -> tuple[GeometryId, ...]:
    """Adds a world's collision boxes and labelled meshes to the world body.

    Call it before ``plant.Finalize()``.  The lowest floor of rooms has no collision geometry: the
    bases move in the plane.  The ground outdoors has, for what flies.

    Returns:
        The collision geometry of the ground on which a climbing robot walks: steps, and the slabs
        under upper floors.  Its height follows the world's ``ground_height`` without contact.
    """
    friction = CoulombFriction(0.5, 0.5)
    boxes = [("wall", box) for box in world.walls]
    boxes += [(thing.name, box) for thing in world.objects if thing.solid for box in thing.boxes]
    if world.outdoors:
        boxes.append(("ground", solid_ground(world)))
    boxes += [("slab", box) for box in slabs(world.rooms, world.stairs, world.wall_height)]
    steps = {flight.name for flight in world.stairs}
    ground = []
    for index, (name, box) in enumerate(boxes):
        p_WB: Any = box.center
        geometry = plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform(RollPitchYaw(0, 0, box.yaw), p_WB),
            BoxShape(*box.size),
            f"{name}_{index}",
            friction,
        )
        if name == "slab" or name in steps:
            ground.append(geometry)
    for shape in _shapes(world):
        _register(plant, scene_graph, shape)
    return tuple(ground)


def scenery_triangles(world: World) -> int:
    """Returns how many triangles the renderers have to draw for a textured world."""
    models = furniture_models()
    count = 0
    for thing in world.objects:
        if isinstance(thing.visual, Placement):
            count += models[thing.visual.model].triangles
        elif isinstance(thing.visual, Building | Exterior):
            count += sum(part.triangles for part in thing_quads(thing.visual))
        else:
            count += 12 * len(thing.boxes)
    if world.outdoors:
        return count + sum(part.triangles for _, part in ground_meshes(world))
    for room in world.rooms:
        doorways = _doorways(world, room)
        walls = shell.walls(room, doorways, (), world.wall_height, world.wall_thickness)
        holes = len(floor_holes(room, world.stairs)) + len(ceiling_holes(room, world.stairs))
        count += 2 * (2 + 3 * holes + sum(len(part.corners) for part in walls))
    return count


def _shapes(world: World) -> Iterable[_Shape]:
    for thing in world.objects:
        label = world.label_of(thing.name)
        assert label is not None
        flight = next((one for one in world.stairs if one.name == thing.name), None)
        if flight is not None and world.textured:
            mesh = textured_mesh(thing.name, stair_quads(flight))
            yield _Shape(thing.name, label, mesh, RigidTransform())
        else:
            yield _thing(thing, label, textured=world.textured)
    if world.outdoors:
        yield from _ground(world)
        return
    wall = world.label_of("walls")
    assert wall is not None
    for room in world.rooms:
        label = world.label_of(f"{room.name}_floor")
        assert label is not None
        yield from (
            _textured_room(world, room, label, wall)
            if world.textured
            else (_flat(f"{room.name}_floor", label, room.floor_color, *_floors(world, room)),)
        )
    edges = [box for one in world.stairs for box in edge_boxes(one, world.wall_height)]
    if not world.textured:
        yield _flat("walls", wall, world.wall_color, *_box_quads((*world.walls, *edges)))
        quads, normals = _ceilings(world)
        yield _flat("ceiling", wall, world.wall_color, quads[:, ::-1], -normals, shown=False)
    elif edges:
        edge = WorldObject("slab_edges", color="white", boxes=tuple(edges))
        yield _thing(edge, wall, textured=True)


def _thing(thing: WorldObject, label: int, *, textured: bool) -> _Shape:
    visual = thing.visual
    if isinstance(visual, Placement):
        mesh = furniture_mesh(furniture_model(visual.model, thing.name), visual.color or None)
        p_WM: Any = visual.position
        return _Shape(thing.name, label, mesh, RigidTransform(RollPitchYaw(0, 0, visual.yaw), p_WM))
    if isinstance(visual, Panel):
        mesh = textured_mesh(thing.name, panel_quads(visual))
        return _Shape(thing.name, label, mesh, RigidTransform())
    if isinstance(visual, Building | Exterior):
        return _Shape(thing.name, label, textured_mesh(thing.name, thing_quads(visual)), _HERE)
    quads, normals = _box_quads(thing.boxes)
    color = PALETTE[thing.color]
    if not textured:
        return _flat(thing.name, label, color, quads, normals)
    image = np.full((4, 4, 3), np.round(255 * np.array(color)), np.uint8)
    plain = TexturedQuads(quads, np.full((len(quads), 4, 2), 0.5), image)
    return _Shape(thing.name, label, textured_mesh(thing.name, [plain]), RigidTransform())


def _ground(world: World) -> Iterable[_Shape]:
    for name, part in ground_meshes(world):
        label = world.label_of(name)
        assert label is not None
        yield _Shape(name, label, textured_mesh(name, [part]), _HERE)


def _textured_room(world: World, room: Room, floor: int, wall: int) -> Iterable[_Shape]:
    boxes = [
        box.lowered(room.elevation)
        for thing in world.objects
        for box in thing.boxes
        if thing.visual
        and room.contains(box.center[0], box.center[1])
        and world.stands_on(box, room.elevation)
    ]
    quads = shell.walls(
        room, _doorways(world, room), boxes, world.wall_height, world.wall_thickness
    )
    floors = [shell.floor(room, boxes, floor_holes(room, world.stairs))]
    ceilings = [shell.ceiling(room, world.wall_height, ceiling_holes(room, world.stairs))]
    X_WM = RigidTransform(np.array([0.0, 0.0, room.elevation]))  # type: ignore[arg-type]
    for name, label, parts, shown in (
        (f"{room.name}_floor", floor, floors, True),
        (f"{room.name}_walls", wall, quads, True),
        (f"{room.name}_ceiling", wall, ceilings, False),
    ):
        yield _Shape(name, label, textured_mesh(name, parts), X_WM, shown=shown)


def _doorways(world: World, room: Room) -> tuple[Doorway, ...]:
    return tuple(door for door in world.doorways if door.elevation == room.elevation)


def _flat(
    name: str,
    label: int,
    color: Color,
    quads: NDArray[np.float64],
    normals: NDArray[np.float64],
    *,
    shown: bool = True,
) -> _Shape:
    file = MemoryFile(_obj(quads, normals), ".obj", name)
    mesh = Mesh(mesh_data=InMemoryMesh(mesh_file=file), scale=1.0)
    return _Shape(name, label, mesh, RigidTransform(), color, shown)


def _box_quads(boxes: Sequence[Box]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    quads, normals = [], []
    for box in boxes:
        R_WB = RollPitchYaw(0, 0, box.yaw).ToRotationMatrix().matrix()
        corners = (_CORNERS * np.array(box.size)) @ R_WB.T + np.array(box.center)
        quads.append(corners[np.array(_FACES)])
        normals.append(_NORMALS @ R_WB.T)
    return np.concatenate(quads), np.concatenate(normals)


def _floors(world: World, room: Room) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    parts = pieces(room.rectangle, floor_holes(room, world.stairs))
    return _rectangles([(part, room.elevation) for part in parts])


def _ceilings(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return _rectangles(
        [
            (part, room.elevation + world.wall_height)
            for room in world.rooms
            for part in pieces(room.rectangle, ceiling_holes(room, world.stairs))
        ]
    )


def _rectangles(
    parts: Sequence[tuple[Rectangle, float]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    quads = []
    for (x_min, y_min, x_max, y_max), z in parts:
        quads.append([(x_min, y_min, z), (x_max, y_min, z), (x_max, y_max, z), (x_min, y_max, z)])
    return np.array(quads, dtype=float), np.tile([0.0, 0.0, 1.0], (len(parts), 1))


def _register(plant: MultibodyPlant, scene_graph: SceneGraph, shape: _Shape) -> None:
    instance = GeometryInstance(shape.X_WM, shape.mesh, f"scenery_{shape.name}")
    perception, illustration = PerceptionProperties(), IllustrationProperties()
    perception.AddProperty("label", "id", RenderLabel(shape.label))
    if shape.color is not None:
        for properties in (perception, illustration):
            properties.AddProperty("phong", "diffuse", Rgba(*shape.color, 1.0))
    instance.set_perception_properties(perception)
    if shape.shown:
        instance.set_illustration_properties(illustration)
    source = plant.get_source_id()
    assert source is not None
    scene_graph.RegisterAnchoredGeometry(source, instance)


def _obj(quads: NDArray[np.float64], normals: NDArray[np.float64]) -> str:
    """Returns the polygons as the text of an .obj file, one normal each."""
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*corner) for corner in quads.reshape(-1, 3)]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*normal) for normal in normals]
    for i in range(len(quads)):
        a, b, c, d = (f"{4 * i + k}//{i + 1}" for k in (1, 2, 3, 4))
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    return "\n".join(lines) + "\n"
