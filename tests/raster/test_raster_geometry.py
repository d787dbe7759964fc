"""Meshes that can be drawn, and errors that name the ones that cannot."""

import cv2
import numpy as np
import pytest
from pydrake.common import MemoryFile
from pydrake.geometry import Convex, InMemoryMesh, Mesh, MeshcatCone, RenderLabel
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from two_cameras import TwoCameras, edited, instance, pose, quad, shapes, write_glb

from unilavira_drake.errors import GeometryError
from unilavira_drake.raster import AcceptingRendererWarning, pictures

AHEAD = RigidTransform([3.0, 0.0, 0.0])
MIDDLE = (117, 163)
TRIANGLE = "v 0 -1 -1\nv 0 1 -1\nv 0 0 1\nvn -1 0 0\nf 1//1 2//1 3//1\n"


def build(shape, **options):
    cameras = TwoCameras(shapes(instance(shape, AHEAD, "thing_1", **options)), vtk=False)
    cameras.look(pose(0, 0, 0))
    return cameras.ours()


def broken(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return Mesh(str(path), 1.0)


def test_glb_is_drawn_as_gltf(tmp_path):
    image = np.zeros((8, 8, 3), np.uint8)
    image[:, :4] = (250, 20, 20)
    image[:, 4:] = (20, 20, 250)
    mesh = quad(image=image)
    write_glb(mesh, tmp_path / "quad.glb")
    binary = build(Mesh(str(tmp_path / "quad.glb"), 1.0), color=None)
    for one, other in zip(binary, build(mesh, color=None), strict=True):
        np.testing.assert_array_equal(one, other)
    row, column = MIDDLE
    left, right = binary[0][row, column - 12], binary[0][row, column + 12]
    assert left[0] > 150 > left[2]
    assert right[2] > 150 > right[0]


def test_obj_shows_its_own_material_or_the_given_colour(tmp_path):
    (tmp_path / "paint.mtl").write_text("newmtl paint\nKd 0.1 0.8 0.1\n")
    mesh = broken(tmp_path, "sign.obj", "mtllib paint.mtl\nusemtl paint\n" + TRIANGLE)
    red, green, blue, _ = build(mesh, color=None)[0][MIDDLE]
    assert green > 2 * max(red, blue)
    red, green, blue, _ = build(mesh, color=(0.9, 0.1, 0.1))[0][MIDDLE]
    assert red > 2 * max(green, blue)


def test_vertex_colours_are_shown():
    def paint(document):
        document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = len(document["accessors"])
        document["accessors"].append(
            {"bufferView": len(document["bufferViews"]), "componentType": 5126}
            | {"count": 4, "type": "VEC3"}
        )
        document["bufferViews"].append({"buffer": 1, "byteOffset": 0, "byteLength": 48})
        document["buffers"].append({"uri": "paint.bin", "byteLength": 48})
        del document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]

    colors = np.tile((0.02, 0.6, 0.02), (4, 1)).astype(np.float32).tobytes()
    red, green, blue, _ = build(edited(quad(), paint, paint__bin=colors), color=None)[0][MIDDLE]
    assert green > 2 * max(red, blue)


def test_a_mesh_without_normals_is_shaded():
    text = TRIANGLE.replace("vn -1 0 0\n", "").replace("//1", "")
    mesh = Mesh(mesh_data=InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "x")), scale=1.0)
    color, depth, _ = build(mesh)
    assert depth[MIDDLE] == pytest.approx(3.0, abs=1e-5)
    assert color[MIDDLE].max() > 100


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "", "holds no triangles"),
        ("a.obj", "mtllib gone.mtl\n" + TRIANGLE, "gone.mtl"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "broken|holds no|missing"),
        ("a.gltf", "{", "broken"),
        ("a.gltf", "{}", "broken|holds no"),
        ("a.glb", b"glTFrubbish rubbish rubbish", "broken"),
        ("a.stl", "solid", "not drawn.*convert"),
    ],
)
def test_broken_files(tmp_path, name, text, message):
    with pytest.raises(GeometryError, match=rf"geometry 'thing_1'.*(?:{message})"):
        build(broken(tmp_path, name, text), color=None)


def test_missing_files(tmp_path):
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*nowhere.obj.*does not exist"):
        build(Mesh(str(tmp_path / "nowhere.obj"), 1.0))
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*nowhere.png.*does not exist"):
        build(quad_box(), diffuse_map=str(tmp_path / "nowhere.png"))


def quad_box():
    text = MemoryFile(TRIANGLE, ".obj", "x.obj")
    return Mesh(mesh_data=InMemoryMesh(mesh_file=text), scale=1.0)


def set_image(uri):
    def edit(document):
        document["images"][0]["uri"] = uri

    return edit


def require(document):
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (edited(quad(), set_image("gone.png")), "gone.png"),
        (edited(quad(), lambda _: None, quad_0__png=b"no picture"), "pictures cannot be read"),
        (edited(quad(), require), "KHR_draco_mesh_compression"),
    ],
)
def test_gltf_with_what_cannot_be_shown(mesh, message):
    with pytest.raises(GeometryError, match=rf"geometry 'thing_1'.*{message}"):
        build(mesh, color=None)


def test_huge_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "MAX_TEXTURE", 16)
    path = tmp_path / "large.png"
    cv2.imwrite(str(path), np.zeros((20, 4, 3), np.uint8))
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*4 x 20 pixels; at most 16"):
        build(quad_box(), diffuse_map=str(path))
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*32 x 32 pixels"):
        build(quad(image=np.full((32, 32, 3), 7, np.uint8)), color=None)


def test_shapes_and_labels_that_are_not_drawn():
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*MeshcatCone"):
        build(MeshcatCone(1.0, 0.5, 0.5))
    with pytest.raises(GeometryError, match=r"geometry 'thing_1'.*reserved"):
        build(quad_box(), label=RenderLabel.kEmpty)
    flat = MemoryFile("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n", ".obj", "x")
    with pytest.raises((GeometryError, RuntimeError), match="hull"):
        build(Convex(mesh_data=InMemoryMesh(mesh_file=flat), scale=1.0))


def test_a_list_of_accepting_renderers_is_warned_about():
    model = """<sdf version="1.7"><model name="m"><static>1</static><link name="l">
      <visual name="thing_1"><geometry><sphere><radius>1</radius></sphere></geometry>
        <drake:accepting_renderer>other</drake:accepting_renderer>
      </visual></link></model></sdf>"""

    def fill(plant, _):
        Parser(plant).AddModelsFromString(model, ".sdf")

    with pytest.warns(AcceptingRendererWarning, match="thing_1"):
        TwoCameras(fill, vtk=False)
