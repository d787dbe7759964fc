"""Writes a textured surface as a glTF in memory: the one form that Drake's renderers texture."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from unilavira_drake.messages import Message

_FLOAT, _UNSIGNED_INT = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_CLAMP_TO_EDGE, _LINEAR = 33071, 9729


@dataclass(frozen=True, eq=False)
class TexturedQuads(Message):
    """Rectangles that share one picture."""

    corners: NDArray[np.float64]
    """(k, 4, 3) metres in the world, counter-clockwise seen from the lit side; a triangle's last
    two are the same."""
    uv: NDArray[np.float64]
    """(k, 4, 2): column and row of the picture, each in [0, 1] from its upper left corner."""
    image: NDArray[np.uint8]
    """(H, W, 3) uint8 RGB."""
    lossy: bool = False
    """Whether the picture may be kept as a JPEG."""

    @property
    def triangles(self) -> int:
        """How many there are to draw."""
        single = (self.corners[:, 2] == self.corners[:, 3]).all(axis=1)
        return 2 * len(self.corners) - int(np.count_nonzero(single))


def textured_mesh(name: str, parts: list[TexturedQuads]) -> Mesh:
    """Returns a mesh of textured quads, matte, in the coordinates they are given in."""
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": []}],
        "samplers": [
            {
                "magFilter": _LINEAR,
                # No mipmaps: with them VTK on Mesa's software renderer hangs in some views.
                "minFilter": _LINEAR,
                "wrapS": _CLAMP_TO_EDGE,
                "wrapT": _CLAMP_TO_EDGE,
            }
        ],
        "accessors": [],
        "bufferViews": [],
        "materials": [],
        "textures": [],
        "images": [],
    }
    blob = bytearray()
    files: dict[str, MemoryFile] = {}
    for index, part in enumerate(parts):
        _add_part(document, blob, part, index)
        kind = ".jpg" if part.lossy else ".png"
        picture = f"{name}_{index}{kind}"
        document["images"].append({"uri": picture})
        _, encoded = cv2.imencode(kind, cv2.cvtColor(_powers_of_two(part.image), cv2.COLOR_RGB2BGR))
        # The stubs know only text; both bindings take bytes.
        content: Any = encoded.tobytes()
        files[picture] = MemoryFile(content, kind, picture)
    buffer = f"{name}.bin"
    document["buffers"] = [{"uri": buffer, "byteLength": len(blob)}]
    geometry: Any = bytes(blob)
    files[buffer] = MemoryFile(geometry, ".bin", buffer)
    text = json.dumps(document)
    mesh_data = InMemoryMesh(
        mesh_file=MemoryFile(text, ".gltf", f"{name}.gltf"), supporting_files=files
    )
    return Mesh(mesh_data=mesh_data, scale=1.0)


def _powers_of_two(image: NDArray[np.uint8]) -> NDArray[Any]:
    """Returns the picture at the nearest sizes that VTK does not distort."""
    rows, columns = (1 << round(math.log2(side)) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA))


def _add_part(document: dict[str, Any], blob: bytearray, part: TexturedQuads, index: int) -> None:
    corners = part.corners.reshape(-1, 3)
    edges = part.corners[:, 1:3] - part.corners[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals = np.repeat(normals / np.linalg.norm(normals, axis=1, keepdims=True), 4, axis=0)
    first = 4 * np.arange(len(part.corners))[:, None]
    triangles = (first + np.array([[0, 1, 2, 0, 2, 3]])).reshape(-1, 3)
    whole = (part.corners[:, 2] != part.corners[:, 3]).any(axis=1)
    drawn = np.stack((np.ones_like(whole), whole), axis=1).ravel()
    indices = triangles[drawn].astype(np.uint32).ravel()
    position = _accessor(document, blob, _y_up(corners), "VEC3")
    normal = _accessor(document, blob, _y_up(normals), "VEC3")
    uv = _accessor(document, blob, part.uv.reshape(-1, 2).astype(np.float32), "VEC2")
    triangle = _accessor(document, blob, indices, "SCALAR")
    attributes = {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}
    primitive = {"attributes": attributes, "indices": triangle, "material": index}
    document["meshes"][0]["primitives"].append(primitive)
    document["textures"].append({"sampler": 0, "source": index})
    surface = {"baseColorTexture": {"index": index}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    document["materials"].append({"pbrMetallicRoughness": surface})


def _accessor(document: dict[str, Any], blob: bytearray, array: NDArray[Any], kind: str) -> int:
    indices = array.dtype == np.uint32
    view = {
        "buffer": 0,
        "byteOffset": len(blob),
        "byteLength": array.nbytes,
        "target": _ELEMENT_ARRAY_BUFFER if indices else _ARRAY_BUFFER,
    }
    document["bufferViews"].append(view)
    blob += array.tobytes()
    accessor: dict[str, Any] = {
        "bufferView": len(document["bufferViews"]) - 1,
        "componentType": _UNSIGNED_INT if indices else _FLOAT,
        "count": len(array),
        "type": kind,
    }
    if kind == "VEC3":
        accessor["min"] = array.min(axis=0).tolist()
        accessor["max"] = array.max(axis=0).tolist()
    document["accessors"].append(accessor)
    return len(document["accessors"]) - 1


def _y_up(vectors: NDArray[np.float64]) -> NDArray[np.float32]:
    """Returns vectors in axes of glTF, which Drake turns to z up as (x, y, z) -> (x, -z, y)."""
    turned: NDArray[np.float32] = np.stack(
        (vectors[:, 0], vectors[:, 2], -vectors[:, 1]), axis=1
    ).astype(np.float32)
    return turned
