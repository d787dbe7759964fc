"""Reads Wavefront OBJ and MTL files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from furniture_conversion.polygon import triangulated


@dataclass(frozen=True)
class ObjMaterial:
    """What an MTL file says of a material."""

    name: str
    color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    """Diffuse red, green, blue as shown on a screen, in [0, 1]."""
    opacity: float = 1.0
    texture: Path | None = None


@dataclass(frozen=True)
class Part:
    """Triangles that share a material, one row of each array a corner.

    A part without texture coordinates has ``uv`` zero; one without normals has ``normals`` nan.
    """

    material: ObjMaterial
    positions: NDArray[np.float64]
    """(t, 3, 3) corners."""
    normals: NDArray[np.float64]
    """(t, 3, 3)"""
    uv: NDArray[np.float64]
    """(t, 3, 2): column and row from the picture's lower left corner."""


@dataclass
class _Faces:
    """Corner indices (t, 3, 3) into positions, texture coordinates and normals; -1: absent."""

    triangles: list[tuple[tuple[int, int, int], ...]] = field(default_factory=list)


def read_obj(path: Path) -> list[Part]:
    """Returns the parts of an OBJ file by material; lines and points are left out.

    Raises:
        ValueError: if the file has no triangle.
    """
    vectors: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    materials: dict[str, ObjMaterial] = {}
    faces: dict[str, _Faces] = {}
    current = ""
    for line in path.read_text(encoding="latin-1").replace("\\\n", " ").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key in vectors:
            vectors[key].append([float(word) for word in rest.split()[: 2 if key == "vt" else 3]])
        elif key == "usemtl":
            current = rest.strip()
        elif key == "mtllib":
            materials.update(_read_mtl(path.parent / rest.strip()))
        elif key == "f" and len(rest.split()) > 2:
            counts = tuple(len(vectors[name]) for name in ("v", "vt", "vn"))
            corners = [_corner(word, counts) for word in rest.split()]
            points = np.array([vectors["v"][corner[0]] for corner in corners])
            faces.setdefault(current, _Faces()).triangles += [
                (corners[a], corners[b], corners[c]) for a, b, c in triangulated(points)
            ]
    parts = [
        _part(materials.get(name, ObjMaterial(name)), group, vectors)
        for name, group in faces.items()
        if group.triangles
    ]
    if not parts:
        raise ValueError(f"{path}: no triangle.")
    return parts


def _corner(word: str, counts: tuple[int, ...]) -> tuple[int, int, int]:
    indices = [int(part) if part else 0 for part in word.split("/")] + [0, 0]
    resolved = [
        index - 1 if index > 0 else (count + index if index < 0 else -1)
        for index, count in zip(indices[:3], counts, strict=True)
    ]
    return resolved[0], resolved[1], resolved[2]


def _part(material: ObjMaterial, faces: _Faces, vectors: dict[str, list[list[float]]]) -> Part:
    index = np.array(faces.triangles, dtype=np.int64)
    arrays = []
    for column, (name, width) in enumerate((("v", 3), ("vt", 2), ("vn", 3))):
        missing = np.nan if name == "vn" else 0.0
        table = np.array([*vectors[name], [missing] * width], dtype=np.float64)
        arrays.append(table[index[..., column]])
    return Part(material, positions=arrays[0], uv=arrays[1], normals=arrays[2])


def _read_mtl(path: Path) -> dict[str, ObjMaterial]:
    if not path.is_file():
        return {}
    materials: dict[str, ObjMaterial] = {}
    values: dict[str, object] = {}
    name = ""
    for line in path.read_text(encoding="latin-1").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key == "newmtl":
            name, values = rest.strip(), {}
        elif key == "Kd":
            red, green, blue = (float(word) for word in rest.split()[:3])
            values["color"] = (red, green, blue)
        elif key == "d":
            values["opacity"] = float(rest.split()[-1])
        elif key == "map_Kd":
            texture = path.parent / rest.strip().replace("\\", "/")
            values["texture"] = texture if texture.is_file() else None
        if name:
            materials[name] = ObjMaterial(name, **values)  # type: ignore[arg-type]
    return materials
