"""One scene seen by the raster camera and by Drake's VTK renderer from the same pose."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    InMemoryMesh,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, RgbdSensor

from unilavira_drake.raster import RasterCameraConfig, RasterView, add_raster_camera, suns_of
from unilavira_drake.worlds.gltf import TexturedQuads, textured_mesh
from unilavira_drake.worlds.scenery import lights

PORTS = ("color_image", "depth_image_32f", "label_image")
WIDTH, HEIGHT = 320, 240
DEPTH = DepthRange(0.1, 10.0)

# Camera frame C (x right, y down, z forward) on a body that looks along its x axis.
R_BC = RollPitchYaw(-np.pi / 2, 0, -np.pi / 2).ToRotationMatrix()


def core(width=WIDTH, height=HEIGHT, *, focal=170.0, X_BS=None):
    """Returns a pinhole with its principal point off the middle."""
    info = CameraInfo(width, height, focal, 1.02 * focal, 0.5 * width + 3.25, 0.5 * height - 2.5)
    return RenderCameraCore("vtk", info, ClippingRange(0.05, 40.0), X_BS or RigidTransform())


def properties(label=1, color=(0.2, 0.5, 0.9), **more):
    """Returns perception properties."""
    result = PerceptionProperties()
    if label is not None:
        result.AddProperty("label", "id", RenderLabel(label) if isinstance(label, int) else label)
    if color is not None:
        result.AddProperty("phong", "diffuse", Rgba(*color, 1.0))
    for name, value in more.items():
        result.AddProperty("phong", name, value)
    return result


def instance(shape, X=None, name="shape", **options):
    """Returns a geometry with the perception role."""
    result = GeometryInstance(X or RigidTransform(), shape, name)
    result.set_perception_properties(properties(**options))
    return result


def pose(x, y, z, yaw=0.0, pitch=0.0):
    """Returns X_WC of a camera that looks along yaw."""
    R_WB = RollPitchYaw(0.0, pitch, yaw).ToRotationMatrix()
    return RigidTransform(R_WB.multiply(R_BC), [x, y, z])


class TwoCameras:
    """A diagram with a scene, a body C that carries both cameras, and another body ``thing``."""

    def __init__(self, fill, *, textured=False, vtk=True, thing=None, views=1):
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        inertia = SpatialInertia(1.0, [0, 0, 0], UnitInertia(1, 1, 1))
        self.body = self.plant.AddRigidBody("C", inertia)
        self.thing = self.plant.AddRigidBody("thing", inertia)
        self.source = self.plant.get_source_id()
        fill(self.plant, self.scene_graph)
        self.plant.Finalize()
        self.frame = self.plant.GetBodyFrameIdOrThrow(self.body.index())
        self.thing_frame = self.plant.GetBodyFrameIdOrThrow(self.thing.index())
        if thing is not None:
            self.scene_graph.RegisterGeometry(self.source, self.thing_frame, thing)
        names = [""] if views == 1 else [f"view_{index}" for index in range(views)]
        config = RasterCameraConfig(
            tuple(
                RasterView(self.frame, self.turned(index, views), core(), DEPTH, name)
                for index, name in enumerate(names)
            ),
            light=suns_of(lights()),
            background=(0.8, 0.9, 1.0),
        )
        self.camera = add_raster_camera(builder, self.scene_graph, config)
        self.sensor = None
        if vtk:
            parameters = RenderEngineVtkParams(backend="EGL", lights=lights(textured=textured))
            self.scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
            self.sensor = builder.AddSystem(
                RgbdSensor(
                    self.frame,
                    RigidTransform(),
                    ColorRenderCamera(core()),
                    DepthRenderCamera(core(), DEPTH),
                )
            )
            builder.Connect(
                self.scene_graph.get_query_output_port(), self.sensor.query_object_input_port()
            )
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()

    @staticmethod
    def turned(index, views):
        """Returns the pose of a view in the camera body."""
        return RigidTransform(RollPitchYaw(0.0, 2.0 * np.pi * index / views, 0.0), [0, 0, 0])

    def look(self, X_WC, context=None):
        """Moves the cameras."""
        self._move(self.body, X_WC, context)

    def put(self, X_WT, context=None):
        """Moves the thing."""
        self._move(self.thing, X_WT, context)

    def _move(self, body, X, context):
        plant_context = self.plant.GetMyMutableContextFromRoot(context or self.context)
        self.plant.SetFreeBodyPose(plant_context, body, X)

    def ours(self, *names, context=None):
        """Returns copies of the raster camera's images."""
        return self._pull(self.camera, names or PORTS, context or self.context)

    def theirs(self, *names):
        """Returns copies of VTK's images."""
        return self._pull(self.sensor, names or PORTS, self.context)

    @staticmethod
    def _pull(system, names, context):
        own = system.GetMyContextFromRoot(context)
        return [np.squeeze(system.GetOutputPort(name).Eval(own).data).copy() for name in names]


def agreement(ours, theirs):
    """Returns shares of pixels: depth within 1 mm, and equal label."""
    depth = np.isclose(ours[1], theirs[1], rtol=0.0, atol=1e-3) | (ours[1] == theirs[1])
    return depth.mean(), (ours[2] == theirs[2]).mean()


def shapes(*instances):
    """Returns what fills a scene with anchored geometries."""

    def fill(plant, scene_graph: SceneGraph):
        for one in instances:
            scene_graph.RegisterAnchoredGeometry(plant.get_source_id(), one)

    return fill


def quad(width=1.0, height=1.0, image=None):
    """Returns an upright glTF rectangle that faces -x."""
    y, z = width / 2.0, height / 2.0
    corners = np.array([[(0, y, -z), (0, -y, -z), (0, -y, z), (0, y, z)]], float)
    uv = np.array([[(0, 1), (1, 1), (1, 0), (0, 0)]], float)
    if image is None:
        image = np.full((4, 4, 3), (200, 100, 50), np.uint8)
        image[0] = (190, 100, 50)
    return textured_mesh("quad", [TexturedQuads(corners, uv, image)])


def edited(mesh, edit, **files):
    """Returns a glTF mesh with its document changed by ``edit``, and with more or other files."""
    memory = mesh.source().in_memory()
    document = json.loads(memory.mesh_file.contents())
    edit(document)
    supporting = dict(memory.supporting_files)
    for name, data in files.items():
        stem, _, extension = name.rpartition("__")
        supporting[f"{stem}.{extension}"] = MemoryFile(data, f".{extension}", name)
    text = MemoryFile(json.dumps(document), ".gltf", "edited.gltf")
    memory = InMemoryMesh(mesh_file=text, supporting_files=supporting)
    return Mesh(mesh_data=memory, scale=1.0)


def write_glb(mesh, path: Path):
    """Writes a glTF mesh as one binary file."""
    memory = mesh.source().in_memory()
    document = json.loads(memory.mesh_file.contents())
    files = {name: file.contents() for name, file in memory.supporting_files.items()}
    blob = bytearray(files[document["buffers"][0]["uri"]])
    for image in document["images"]:
        data = files[image.pop("uri")]
        blob += b"\0" * (-len(blob) % 4)
        document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)}
        )
        image.update(bufferView=len(document["bufferViews"]) - 1, mimeType="image/png")
        blob += data
    blob += b"\0" * (-len(blob) % 4)
    document["buffers"] = [{"byteLength": len(blob)}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + bytes(blob)
    )


def wall(x=5.0, label=9):
    """Returns a wide wall across x."""
    return instance(Box(0.1, 30.0, 30.0), RigidTransform([x, 0, 0]), f"wall_{x}", label=label)
