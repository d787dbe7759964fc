"""Pictures of the raster camera against Drake's own, pixel by pixel."""

import cv2
import numpy as np
import pytest
from pydrake.common import MemoryFile
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    InMemoryMesh,
    Mesh,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw
from two_cameras import TwoCameras, agreement, edited, instance, pose, quad, shapes

from unilavira_drake.sensors.color_names import color_indices
from unilavira_drake.worlds.furniture_library import furniture_mesh, furniture_models
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery

DEPTH, LABEL = 0.995, 0.997
"""Least shares of pixels with equal depth and equal label."""

SAME_WORD, BRIGHTNESS = 0.90, 0.10
"""Least share of pixels with the same colour word, and greatest mean difference in brightness."""

ROOM = """
name: room
wall_height: 2.6
wall_thickness: 0.1
rooms:
- {name: hall, kind: hall, rectangle: [0, 0, 5, 4], floor: oak, walls: cream_paint}
- {name: kitchen, kind: kitchen, rectangle: [5, 0, 9, 4], floor: white_tile, walls: white_tiles}
doors:
- {name: door, rooms: [hall, kitchen], position: [5.0, 2.0], width: 1.0, color: white}
objects:
- {name: sofa_1, category: sofa, color: red, room: hall, position: [1.6, 0.6], yaw_degrees: 90}
"""

PRISM = """
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vn 0 0 -1
vn 0 -1 0
vn -1 0 0
vn 1 1 1
f 1//1 3//1 2//1
f 1//2 2//2 4//2
f 1//3 4//3 3//3
f 2//4 3//4 4//4
"""


def obj(text=PRISM):
    return InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "prism.obj"))


def compare(cameras, poses, *, words=SAME_WORD):
    depths, labels, same, brightness = [], [], [], []
    for X_WC in poses:
        cameras.look(X_WC)
        ours, theirs = cameras.ours(), cameras.theirs()
        depth, label = agreement(ours, theirs)
        depths.append(depth)
        labels.append(label)
        rgb = [picture[..., :3] for picture in (ours[0], theirs[0])]
        same.append((color_indices(rgb[0]) == color_indices(rgb[1])).mean())
        brightness.append(abs(rgb[0].mean() - rgb[1].mean()) / 255.0)
    assert min(depths) >= DEPTH
    assert min(labels) >= LABEL
    assert np.mean(same) >= words
    assert np.mean(brightness) <= BRIGHTNESS


def random_poses(rectangle, count, seed):
    rng = np.random.default_rng(seed)
    x_min, y_min, x_max, y_max = rectangle
    for _ in range(count):
        yield pose(
            rng.uniform(x_min, x_max),
            rng.uniform(y_min, y_max),
            rng.uniform(0.5, 1.6),
            rng.uniform(-np.pi, np.pi),
            rng.uniform(-0.2, 0.3),
        )


def world_cameras(name):
    world = load_world(name)
    return TwoCameras(
        lambda plant, graph: add_scenery(plant, graph, world), textured=world.textured
    )


def test_the_flat_world():
    compare(world_cameras("flat"), random_poses((0.5, 0.5, 12.5, 9.5), 10, 0))


def test_a_textured_room(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(ROOM)
    compare(world_cameras(str(file)), random_poses((0.5, 0.8, 8.5, 3.5), 8, 1))


def test_pieces_of_furniture():
    models = sorted(furniture_models().values(), key=lambda model: model.triangles)
    chosen = models[:: max(1, len(models) // 12)]
    parts = [
        instance(
            furniture_mesh(model, "blue" if index == 3 else None),
            RigidTransform(
                RollPitchYaw(0, 0, 0.7 * index), [3.0 * np.cos(index), 3.0 * np.sin(index), 0.0]
            ),
            model.name,
            label=index + 1,
            color=None,
        )
        for index, model in enumerate(chosen)
    ]
    cameras = TwoCameras(shapes(*parts), textured=True)
    poses = [pose(0, 0, 0.8, angle, 0.1) for angle in np.arange(0, 6.2, 0.8)]
    # Slanted faces are black under the suns alone; here the sky lights them, too.
    compare(cameras, poses, words=0.8)


@pytest.fixture(scope="module")
def every_shape(tmp_path_factory):
    picture = tmp_path_factory.mktemp("pictures") / "checks.png"
    checks = np.kron([[0, 1], [1, 0]], np.ones((8, 8)))[..., None] * (40, 180, 220)
    cv2.imwrite(str(picture), checks.astype(np.uint8))

    def moved(document):
        document["nodes"] = [
            {"children": [1], "translation": [0.1, 0.2, 0.3], "scale": [1.0, 2.0, 1.0]},
            {"mesh": 0, "rotation": [0.1, 0.2, 0.3, (1 - 0.14) ** 0.5]},
        ]
        document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.2, 0.9, 0.4, 1]

    gltf = edited(quad(), moved)
    stretched = Mesh(mesh_data=gltf.source().in_memory(), scale3=[0.5, 1.0, 2.0])
    all_shapes = [
        (Box(0.5, 0.7, 0.9), {}),
        (Sphere(0.4), {}),
        (Cylinder(0.3, 0.8), {}),
        (Capsule(0.25, 0.6), {}),
        (Ellipsoid(0.2, 0.3, 0.5), {}),
        (Mesh(mesh_data=obj(), scale=0.8), {}),
        (Mesh(mesh_data=obj(), scale3=[0.5, 1.2, 0.9]), {}),
        (Convex(mesh_data=obj(), scale3=[0.5, 1.2, 0.9]), {}),
        (gltf, {"color": None}),
        (stretched, {"color": None}),
        (Box(0.6, 0.6, 0.6), {"color": None, "diffuse_map": str(picture)}),
        (Sphere(0.4), {"label": None}),
    ]
    parts = [instance(HalfSpace(), name="ground", label=99, color=(0.5, 0.5, 0.5))]
    for index, (shape, options) in enumerate(all_shapes):
        angle = 2.0 * np.pi * index / len(all_shapes)
        X = RigidTransform(
            RollPitchYaw(0.3, 0.5, index), [2.5 * np.cos(angle), 2.5 * np.sin(angle), 0.9]
        )
        parts.append(instance(shape, X, f"shape_{index}", **{"label": index + 1, **options}))
    return TwoCameras(shapes(*parts))


@pytest.mark.parametrize("pitch", [-0.1, 0.4])
def test_one_of_every_shape(every_shape, pitch):
    poses = [pose(0.1, -0.2, 1.1, angle, pitch) for angle in np.arange(0, 6.2, 0.6)]
    # VTK draws all of a scene with a glTF as glTF materials, under lights meant for plain colours.
    compare(every_shape, poses, words=0.0)


def test_vtk_draws_on_undisturbed(every_shape):
    every_shape.look(pose(0, 0, 1.0, 0.3))
    first = every_shape.theirs(), every_shape.ours()
    for angle in (0.5, 1.0, 0.3):
        every_shape.look(pose(0, 0, 1.0, angle))
        again = every_shape.theirs(), every_shape.ours()
    for before, after in zip(first, again, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
