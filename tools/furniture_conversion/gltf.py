"""Writes models as glTF 2.0: one node, a primitive for each material, all matte."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furniture_conversion.materials import Group, shrunk
from furniture_conversion.shape import IndexedMesh, index

_FLOAT, _UNSIGNED_SHORT, _UNSIGNED_INT = 5126, 5123, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963


def write_gltf(folder: Path, name: str, groups: list[Group], *, texture_side: int) -> int:
    """Writes ``name.gltf``, ``name.bin`` and its pictures; returns the number of triangles."""
    folder.mkdir(parents=True, exist_ok=True)
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"primitives": []}],
        "materials": [],
        "accessors": [],
        "bufferViews": [],
    }
    blob = bytearray()
    triangles = 0
    for number, group in enumerate(groups):
        mesh = index(group.part)
        triangles += len(mesh.triangles)
        material = _material(document, folder, name, group, texture_side)
        document["materials"].append(material)
        textured = group.material.texture is not None
        primitive = _primitive(document, blob, mesh, textured)
        document["meshes"][0]["primitives"].append({**primitive, "material": number})
    document["buffers"] = [{"uri": f"{name}.bin", "byteLength": len(blob)}]
    (folder / f"{name}.bin").write_bytes(bytes(blob))
    text = json.dumps(document, separators=(",", ":"))
    (folder / f"{name}.gltf").write_text(text + "\n", encoding="utf-8")
    return triangles


def _material(
    document: dict[str, Any], folder: Path, name: str, group: Group, side: int
) -> dict[str, Any]:
    matte: dict[str, Any] = {
        "baseColorFactor": [*_linear(group.material.color), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.9,
    }
    material: dict[str, Any] = {"pbrMetallicRoughness": matte, "doubleSided": True}
    if group.material.texture is not None:
        data = shrunk(group.material.texture, side)
        images = document.setdefault("images", [])
        picture = f"{name}_{len(images)}.jpg"
        (folder / picture).write_bytes(data)
        images.append({"uri": picture})
        document.setdefault("textures", []).append({"source": len(images) - 1})
        matte["baseColorTexture"] = {"index": len(images) - 1}
    return material


def _linear(color: tuple[float, float, float]) -> list[float]:
    """Factors in glTF are linear in light; a material file's colours are as on a screen."""
    c = np.asarray(color, dtype=np.float64)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return [round(float(value), 4) for value in linear]


def _primitive(
    document: dict[str, Any], blob: bytearray, mesh: IndexedMesh, textured: bool
) -> dict[str, Any]:
    attributes = {
        "POSITION": _accessor(document, blob, _y_up(mesh.positions), "VEC3", limits=True),
        "NORMAL": _accessor(document, blob, _y_up(mesh.normals), "VEC3"),
    }
    if textured:
        attributes["TEXCOORD_0"] = _accessor(document, blob, mesh.uv, "VEC2")
    short = len(mesh.positions) < 65535
    indices = mesh.triangles.astype(np.uint16 if short else np.uint32).ravel()
    return {
        "attributes": attributes,
        "indices": _accessor(document, blob, indices, "SCALAR"),
    }


def _accessor(
    document: dict[str, Any],
    blob: bytearray,
    array: NDArray[Any],
    kind: str,
    *,
    limits: bool = False,
) -> int:
    blob += bytes(-len(blob) % 4)
    document["bufferViews"].append(
        {
            "buffer": 0,
            "byteOffset": len(blob),
            "byteLength": array.nbytes,
            "target": _ELEMENT_ARRAY_BUFFER if kind == "SCALAR" else _ARRAY_BUFFER,
        }
    )
    blob += np.ascontiguousarray(array).tobytes()
    types = {"float32": _FLOAT, "uint16": _UNSIGNED_SHORT, "uint32": _UNSIGNED_INT}
    accessor: dict[str, Any] = {
        "bufferView": len(document["bufferViews"]) - 1,
        "componentType": types[array.dtype.name],
        "count": len(array),
        "type": kind,
    }
    if limits:
        accessor["min"] = array.min(axis=0).tolist()
        accessor["max"] = array.max(axis=0).tolist()
    document["accessors"].append(accessor)
    return len(document["accessors"]) - 1


def _y_up(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Turns z up into y up, as glTF has it; Drake turns it back: (x, y, z) -> (x, -z, y)."""
    turned: NDArray[np.float32] = np.stack((vectors[:, 0], vectors[:, 2], -vectors[:, 1]), axis=1)
    return turned
