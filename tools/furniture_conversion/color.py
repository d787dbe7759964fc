"""Measures on pictures of a model its colour word and which material is seen most."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    GeometryId,
    InMemoryMesh,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo, ImageLabel16I, ImageRgba8U

from unilavira_drake.sensors.color_names import COLOR_WORDS, color_indices
from unilavira_drake.worlds.scenery import lights

_FOV = 0.6
_SIDE = 160
_YAWS = (-0.6, 0.0, 0.6)

Size = tuple[float, float, float]


def mark_main(path: Path, size: Size, elevation: float) -> None:
    """Marks the material that is seen most as the main one, in a model's file."""
    document = json.loads(path.read_text(encoding="utf-8"))
    seen = [
        sum(
            int((view(mesh, size, elevation, yaw=yaw, side=_SIDE)[0][..., 1] < 128).sum())
            for yaw in _YAWS
        )
        for mesh in _black_in_turn(path, document)
    ]
    main = int(np.argmax(seen))
    for number, material in enumerate(document["materials"]):
        material["extras"] = {"main": number == main}
    path.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")


def _black_in_turn(path: Path, document: dict[str, Any]) -> Iterator[Mesh]:
    """Returns the model once for each material, with that one black and the others white."""
    buffer = document["buffers"][0]["uri"]
    data = MemoryFile((path.parent / buffer).read_bytes(), ".bin", buffer)
    for chosen in range(len(document["materials"])):
        materials = [
            {
                "pbrMetallicRoughness": {"baseColorFactor": [*([float(i != chosen)] * 3), 1.0]},
                "extensions": {"KHR_materials_unlit": {}},
                "doubleSided": True,
            }
            for i in range(len(document["materials"]))
        ]
        plain = {key: document[key] for key in document if key not in ("images", "textures")}
        plain |= {"materials": materials, "extensionsUsed": ["KHR_materials_unlit"]}
        file = MemoryFile(json.dumps(plain), ".gltf", path.name)
        yield Mesh(mesh_data=InMemoryMesh(mesh_file=file, supporting_files={buffer: data}))


def measured_color(mesh: Path | Mesh, size: Size, elevation: float) -> str:
    """Returns the word of most pixels of a model seen from its front and both sides of it."""
    votes = np.zeros(len(COLOR_WORDS), dtype=np.int64)
    for yaw in _YAWS:
        rgb, label = view(mesh, size, elevation, yaw=yaw, side=_SIDE)
        words = color_indices(rgb[label == 1])
        votes += np.bincount(words, minlength=len(COLOR_WORDS))
    return COLOR_WORDS[int(np.argmax(votes))]


def view(
    mesh: Path | Mesh, size: Size, elevation: float, *, yaw: float, side: int
) -> tuple[NDArray[np.uint8], NDArray[np.int16]]:
    """Returns colour (side, side, 3) and label (side, side) of a model seen from its front.

    Args:
        mesh: a model whose front faces +x.
        size: its size, metres.
        elevation: height of its lowest point, metres.
        yaw: turn of the eye about the model, radians; 0 is in front.
        side: pixels.
    """
    engine = MakeRenderEngineVtk(
        RenderEngineVtkParams(
            lights=lights(textured=True), backend="EGL", default_clear_color=[1, 1, 1]
        )
    )
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    shape = mesh if isinstance(mesh, Mesh) else Mesh(mesh, 1.0)
    engine.RegisterVisual(GeometryId.get_new_id(), shape, properties, RigidTransform(), False)
    engine.UpdateViewpoint(_eye(size, elevation, yaw))
    core = RenderCameraCore(
        "default", CameraInfo(side, side, _FOV), ClippingRange(0.01, 200.0), RigidTransform()
    )
    camera = ColorRenderCamera(core, False)
    color: Any = ImageRgba8U(side, side)
    label: Any = ImageLabel16I(side, side)
    engine.RenderColorImage(camera, color)
    engine.RenderLabelImage(camera, label)
    return color.data[..., :3].copy(), label.data[..., 0].copy()


def _eye(size: Size, elevation: float, yaw: float) -> RigidTransform:
    middle = np.array([0.0, 0.0, elevation + size[2] / 2])
    distance = 0.55 * float(np.linalg.norm(size)) / math.tan(_FOV / 2)
    tilt = 0.35
    toward = np.array(
        [math.cos(tilt) * math.cos(yaw), math.cos(tilt) * math.sin(yaw), math.sin(tilt)]
    )
    z = -toward
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R_WC = RotationMatrix(np.stack((x, np.cross(z, x), z), axis=1))
    p_WC: Any = middle + distance * toward
    return RigidTransform(R_WC, p_WC)
