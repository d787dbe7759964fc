"""Reads .obj, .gltf and .glb meshes, on disk or in memory, and refuses what would be invisible.

``trimesh`` reads the files.  It skips what it cannot read without a word, so what it was asked for
and what it gave are compared here.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.errors import GeometryError
from unilavira_drake.raster.pictures import only_color, picture_texture, stays_inside
from unilavira_drake.raster.surface import Surface, make_surface

EXTENSIONS = (".obj", ".gltf", ".glb")

_GAMMA = 2.2
_DEFAULT_CUTOFF = 0.5
# Extensions that a file may require: read by trimesh, or without effect on these pictures.
_EXTENSIONS = {
    "EXT_texture_webp",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
}


@dataclass
class MeshFiles:
    """A mesh file and the files it refers to."""

    name: str
    """File name, for messages."""
    extension: str
    """In lower case, with its dot."""
    read: Callable[[str], bytes]
    """Returns a file by the name that the mesh gives it; '' is the mesh itself."""
    missing: list[str] = field(default_factory=list)

    def get(self, name: str) -> bytes:
        """Returns the file's bytes, and remembers when there is none (trimesh's resolver)."""
        try:
            return self.read(name)
        except (KeyError, OSError):
            self.missing.append(name)
            raise KeyError(name) from None

    __getitem__ = get


def on_disk(path: Path) -> MeshFiles:
    """Returns a mesh in a folder."""

    def read(name: str) -> bytes:
        return (path.parent / name if name else path).read_bytes()

    return MeshFiles(path.name, path.suffix.lower(), read)


def in_memory(mesh: Any) -> MeshFiles:
    """Returns Drake's ``InMemoryMesh``."""
    supporting = mesh.supporting_files

    def read(name: str) -> bytes:
        file = supporting[name] if name else mesh.mesh_file
        data: bytes = file.read_bytes() if isinstance(file, Path) else file.contents()
        return data

    name = mesh.mesh_file.filename_hint() or "in-memory mesh"
    return MeshFiles(name, mesh.mesh_file.extension().lower(), read)


def read_surfaces(files: MeshFiles, *, materials: bool = True) -> tuple[Surface, ...]:
    """Returns a mesh's surfaces in Drake's axes (a glTF is turned to z up), not yet scaled.

    Args:
        files: where it stands.
        materials: whether to read an .obj file's materials.

    Raises:
        GeometryError: if the mesh or a file that it needs is missing, broken or of another kind.
    """
    # Half a second to import, so only where there is a mesh.
    import trimesh

    if files.extension not in EXTENSIONS:
        raise GeometryError(
            f"{files.name}: {files.extension or 'no'} files are not drawn; "
            f"convert it to one of {', '.join(EXTENSIONS)}"
        )
    try:
        data = files.read("")
    except OSError as error:
        raise GeometryError(f"{files.name}: cannot be read: {error.strerror}") from None
    gltf = files.extension != ".obj"
    textured = _textured_primitives(files, data) if gltf else None
    try:
        resolver: Any = files
        options: dict[str, Any] = {} if gltf else {"skip_materials": not materials}
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=files.extension[1:],
            resolver=resolver,
            process=False,
            **options,
        )
        _check_missing(files)
        surfaces = _scene_surfaces(scene, gltf=gltf)
    except GeometryError as error:
        raise GeometryError(f"{files.name}: {error}") from None
    except Exception as error:
        _check_missing(files)
        raise GeometryError(f"{files.name}: broken mesh: {error!r}") from error
    if not surfaces:
        raise GeometryError(f"{files.name}: holds no triangles")
    loaded = sum(1 for part in scene.geometry.values() if _picture(part) is not None)
    if textured is not None and loaded < textured:
        raise GeometryError(f"{files.name}: {textured - loaded} of its pictures cannot be read")
    return surfaces


def has_material(files: MeshFiles) -> bool:
    """Whether an .obj file names a material library."""
    return files.extension == ".obj" and b"mtllib" in files.read("")


def _check_missing(files: MeshFiles) -> None:
    if files.missing:
        raise GeometryError(f"{files.name}: refers to {files.missing[0]!r}, which does not exist")


def _textured_primitives(files: MeshFiles, data: bytes) -> int:
    """Returns how many primitives of a glTF have a picture."""
    try:
        if files.extension == ".glb":
            length, kind = struct.unpack_from("<I4s", data, 12)
            if data[:4] != b"glTF" or kind != b"JSON":
                raise ValueError("no JSON chunk")
            data = data[20 : 20 + length]
        document = json.loads(data)
        unknown = set(document.get("extensionsRequired", ())) - _EXTENSIONS
        materials = [
            "baseColorTexture" in material.get("pbrMetallicRoughness", {})
            for material in document.get("materials", ())
        ]
        primitives = [
            part["material"]
            for mesh in document.get("meshes", ())
            for part in mesh["primitives"]
            if "material" in part
        ]
        textured: int = sum(materials[index] for index in primitives)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error) as error:
        raise GeometryError(f"{files.name}: broken glTF: {error!r}") from None
    if unknown:
        raise GeometryError(
            f"{files.name}: requires the glTF extension {', '.join(sorted(unknown))}, which is "
            "not drawn"
        )
    return textured


def _scene_surfaces(scene: Any, *, gltf: bool) -> tuple[Surface, ...]:
    surfaces = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not hasattr(part, "faces") or len(part.faces) == 0:
            continue
        positions = np.asarray(part.vertices) @ transform[:3, :3].T + transform[:3, 3]
        normals = np.asarray(part.vertex_normals) @ np.linalg.inv(transform[:3, :3])
        if not np.isfinite(positions).all() or part.faces.max() >= len(positions):
            raise GeometryError("a vertex is missing or infinite")
        if gltf:
            positions, normals = _z_up(positions), _z_up(normals)
        surfaces.append(_surface(part, positions, normals, gltf=gltf))
    return tuple(surfaces)


def _surface(
    part: Any, positions: NDArray[np.float64], normals: NDArray[np.float64], *, gltf: bool
) -> Surface:
    uv = getattr(part.visual, "uv", None)
    if uv is not None:
        uv = np.column_stack((uv[:, 0], 1.0 - uv[:, 1]))
    picture = _picture(part) if uv is not None else None
    texture = None
    if picture is not None and uv is not None:
        texture = picture_texture(picture, repeats=not stays_inside(uv))
    material = getattr(part.visual, "material", None)
    masked = getattr(material, "alphaMode", None) == "MASK"
    cutoff = getattr(material, "alphaCutoff", None)
    colors = _colors(part, gltf=gltf)
    only = None if texture is None or masked else only_color(texture)
    if only is not None:
        # A picture of one colour costs three times as much to draw as the colour.
        colors, texture = np.round(colors * (only[:3] / 255.0)).astype(np.uint8), None
    return make_surface(
        positions,
        normals,
        part.faces,
        uv=uv,
        colors=colors,
        texture=texture,
        alpha_cutoff=(_DEFAULT_CUTOFF if cutoff is None else float(cutoff)) if masked else 0.0,
        linear=gltf,
    )


def _colors(part: Any, *, gltf: bool) -> NDArray[np.uint8]:
    """Returns (n, 3) or (3,) uint8 sRGB; glTF's own are linear."""
    material = getattr(part.visual, "material", None)
    factor = getattr(material, "baseColorFactor" if gltf else "diffuse", None)
    color = np.ones(3) if factor is None else np.asarray(factor, float)[:3] / 255.0
    attributes = getattr(part.visual, "vertex_attributes", {})
    vertex = attributes.get("color") if gltf else None
    if material is None and getattr(part.visual, "kind", None) == "vertex":
        vertex = part.visual.vertex_colors
    if vertex is not None:
        scale = 255.0 if vertex.dtype == np.uint8 else 65535.0 if vertex.dtype == np.uint16 else 1.0
        color = color * (np.asarray(vertex, float)[:, :3] / scale)
    if gltf:
        color = np.clip(color, 0.0, 1.0) ** (1.0 / _GAMMA)
    return np.round(255.0 * np.clip(color, 0.0, 1.0)).astype(np.uint8)


def _picture(part: Any) -> Any:
    material = getattr(part.visual, "material", None)
    picture = getattr(material, "baseColorTexture", None)
    return getattr(material, "image", None) if picture is None else picture


def _z_up(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack((vectors[:, 0], -vectors[:, 2], vectors[:, 1]))
