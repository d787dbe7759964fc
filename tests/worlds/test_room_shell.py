"""Rooms from inside: textures, shadows, doorways, and how the renderer shows them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    PerceptionProperties,
    RenderCameraCore,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from unilavira_drake.sensors.rig import RENDERER, add_renderer
from unilavira_drake.worlds import shell
from unilavira_drake.worlds.gltf import TexturedQuads, textured_mesh
from unilavira_drake.worlds.materials import FLOORS, WALLS, texture
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.panels import PATTERNS, panel, panel_quads
from unilavira_drake.worlds.scenery import lights
from unilavira_drake.worlds.schema import PanelEntry
from unilavira_drake.worlds.structure import DOOR_HEIGHT
from unilavira_drake.worlds.world import JAMB_WIDTH, Box, Doorway, Room

ROOM = Room("den", "study", (0.0, 0.0, 4.0, 3.0), floor="oak", walls="cream_paint")
HEIGHT = 2.6


def area(part: TexturedQuads) -> float:
    """Returns the area of all quads, square metres."""
    a = part.corners[:, 1] - part.corners[:, 0]
    b = part.corners[:, 3] - part.corners[:, 0]
    return float(np.linalg.norm(np.cross(a, b), axis=1).sum())


def normals(part: TexturedQuads) -> np.ndarray:
    """Returns the unit normal of each quad."""
    a = part.corners[:, 1] - part.corners[:, 0]
    b = part.corners[:, 3] - part.corners[:, 0]
    cross = np.cross(a, b)
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


@pytest.mark.parametrize("name", [*FLOORS, *WALLS])
def test_a_texture_is_the_material_s_colour_and_the_same_each_time(name: str) -> None:
    material = FLOORS.get(name) or WALLS[name]
    image = texture(material, 2.0, 1.0, pixels_per_metre=50, seed=3)
    assert image.shape == (50, 100, 3)
    assert np.array_equal(image, texture(material, 2.0, 1.0, pixels_per_metre=50, seed=3))
    assert image.reshape(-1, 3).mean(axis=0) == pytest.approx(np.array(material.color), abs=0.06)


def test_walls_face_inwards_and_leave_the_doorways_out() -> None:
    door = Doorway(1.5, 0.0, 1.0, along_x=True)
    gap = Doorway(4.0, 1.5, 1.2, along_x=False, open=True)
    parts = shell.walls(ROOM, (door, gap), (), HEIGHT, 0.1)
    assert len(parts) == 4
    for part in parts:
        middle = part.corners.mean(axis=1)
        inwards = np.array([2.0, 1.5, 0.0]) - middle
        assert np.all(np.einsum("ij,ij->i", normals(part), inwards) > 0)
    whole = 2 * (3.9 + 2.9) * HEIGHT
    missing = (1.0 + 2 * JAMB_WIDTH) * (DOOR_HEIGHT + JAMB_WIDTH) + 1.2 * HEIGHT
    assert sum(map(area, parts)) == pytest.approx(whole - missing)


def test_a_thing_shades_the_floor_under_it_and_the_wall_behind_it() -> None:
    box = Box((2.0, 0.35, 0.4), (1.0, 0.5, 0.8))
    bare, shaded = (shell.floor(ROOM, boxes).image.astype(int) for boxes in ((), (box,)))
    difference = (bare - shaded).sum(axis=2)
    rows, columns = difference.shape
    # Row 0 lies at y = 3.
    assert difference[round(rows * (1 - 0.35 / 3.0)), columns // 2] > 100
    assert abs(difference[rows // 4]).max() < 20
    south_bare, south_shaded = (
        shell.walls(ROOM, (), boxes, HEIGHT, 0.1)[0].image.astype(int) for boxes in ((), (box,))
    )
    difference = (south_bare - south_shaded).sum(axis=2)
    assert difference[-30, difference.shape[1] // 2] > 20
    assert abs(difference[10]).max() < 20


@pytest.mark.parametrize("category", sorted(PATTERNS))
def test_panels_show_into_the_room(category: str) -> None:
    entry = PanelEntry(category=category, name="x", color="blue", room="den", height=1.0)
    thing = panel(entry, ROOM, (1.0, 2.8), (0.8, 0.6), 0.1)
    front = panel_quads(thing)[0]
    assert area(front) == pytest.approx(0.8 * 0.6)
    expected = [0, 0, 1] if category == "rug" else [0, -1, 0]
    assert normals(front)[0] == pytest.approx(expected, abs=1e-9)
    if category != "rug":
        assert front.corners[0, :, 1] == pytest.approx(3.0 - 0.05 - 0.04, abs=0.01)
        assert front.corners[0, :, 2].min() == pytest.approx(1.0)
    again = panel_quads(thing)[0].image
    assert np.array_equal(front.image, again)
    assert front.image.reshape(-1, 3).std() > 3


def render(parts: list[TexturedQuads]) -> tuple[np.ndarray, np.ndarray]:
    """Returns colour and depth of what a camera at the origin that looks along +x sees."""
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    add_renderer(scene_graph, lights(textured=True))
    source = scene_graph.RegisterSource("test")
    instance = GeometryInstance(RigidTransform(), textured_mesh("part", parts), "part")
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    instance.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(source, instance)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    info = CameraInfo(80, 60, 40.0, 40.0, 39.5, 29.5)
    core = RenderCameraCore(RENDERER, info, ClippingRange(0.1, 10.0), RigidTransform())
    X_WC = RigidTransform(RollPitchYaw(-math.pi / 2, 0, -math.pi / 2), [0, 0, 0])
    frame = scene_graph.world_frame_id()
    color = query.RenderColorImage(ColorRenderCamera(core, False), frame, X_WC)
    camera = DepthRenderCamera(core, DepthRange(0.1, 9.0))
    depth = query.RenderDepthImage(camera, frame, X_WC)
    return np.array(color.data[:, :, :3]), np.array(depth.data[:, :, 0])


def test_the_renderer_shows_the_picture_upright_with_its_colours() -> None:
    image = np.zeros((40, 40, 3), np.uint8)
    wanted = {}
    for word, place in (
        ("red", (0, 0)),
        ("blue", (0, 1)),
        ("green", (1, 0)),
        ("yellow", (1, 1)),
    ):
        v, u = place
        image[20 * v : 20 * v + 20, 20 * u : 20 * u + 20] = 255 * np.array(PALETTE[word])
        wanted[place] = 255 * np.array(PALETTE[word])
    # A wall 2 m ahead, 2 m wide and high, seen from the origin: left is +y.
    corners = np.array([[(2, 1, -1), (2, -1, -1), (2, -1, 1), (2, 1, 1)]], float)
    uv = np.array([[(0, 1), (1, 1), (1, 0), (0, 0)]], float)
    color, depth = render([TexturedQuads(corners, uv, image)])
    assert depth[30, 40] == pytest.approx(2.0, abs=1e-3)
    for (v, u), expected in wanted.items():
        seen = color[20 + 20 * v, 30 + 20 * u].astype(float)
        # Lit from the front at 0.86 to 0.94 of its colour, in linear light.
        assert np.abs(seen - expected).max() < 40
