"""What a SceneGraph shows to cameras, read from its perception role."""

from __future__ import annotations

import hashlib
import warnings
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    HalfSpace,
    Mesh,
    PerceptionProperties,
    RenderLabel,
    Role,
    SceneGraphInspector,
    Sphere,
)

from unilavira_drake.errors import GeometryError
from unilavira_drake.messages import Message
from unilavira_drake.ports import pose_matrix
from unilavira_drake.raster import mesh_files, primitives
from unilavira_drake.raster.occlusion import shade_corners
from unilavira_drake.raster.pictures import read_texture
from unilavira_drake.raster.surface import (
    WHITE,
    Color,
    Model,
    Surface,
    Texture,
    flat_normals,
    make_surface,
    pack_normals,
    unpack_normals,
)

DEFAULT_COLOR = (0.9, 0.45, 0.1)
"""Of a geometry without one, as Drake's VTK renderer paints it."""


class AcceptingRendererWarning(UserWarning):
    """A geometry names the renderers that may draw it, which Python cannot read: it is drawn."""


@dataclass(frozen=True, eq=False)
class Drawable(Message):
    """One geometry with the perception role."""

    name: str
    model: Model
    color: Color
    """sRGB; multiplies the model's own."""
    label: int
    labelled: bool
    """Whether it hides what is behind it in label images; not so with ``kDoNotRender``."""
    frame_id: Any
    X_FG: NDArray[np.float64]
    """(4, 4) pose in its frame."""


# Parsed shapes that a scene of this process still shows, by digest: shared, and parsed once.
_models: weakref.WeakValueDictionary[str, Model] = weakref.WeakValueDictionary()


def perception_ids(inspector: SceneGraphInspector) -> list[GeometryId]:
    """Returns the ids of all geometries with the perception role, in a fixed order."""
    return inspector.GetAllGeometryIds(Role.kPerception)


def read_drawables(inspector: SceneGraphInspector, ids: list[GeometryId]) -> tuple[Drawable, ...]:
    """Returns what to draw for each geometry.

    Raises:
        GeometryError: naming the geometry, if it cannot be drawn.
    """
    drawables = []
    for id_ in ids:
        name = inspector.GetName(id_)
        try:
            drawable = _drawable(inspector, id_, name)
        except GeometryError as error:
            raise GeometryError(f"geometry {name!r}: {error}.") from error
        drawables.append(drawable)
    return tuple(drawables)


def _drawable(inspector: SceneGraphInspector, id_: GeometryId, name: str) -> Drawable:
    properties: Any = inspector.GetPerceptionProperties(id_)
    if inspector.IsDeformableGeometry(id_):
        raise GeometryError("deformable geometry is not drawn")
    if properties.HasProperty("renderer", "accepting"):
        warnings.warn(
            f"geometry {name!r} says which renderers accept it; the raster camera cannot read "
            "that and draws it",
            AcceptingRendererWarning,
            stacklevel=2,
        )
    label = properties.GetPropertyOrDefault("label", "id", RenderLabel.kDontCare)
    if label in (RenderLabel.kEmpty, RenderLabel.kUnspecified):
        raise GeometryError("its label is one of the reserved 'empty' and 'unspecified'")
    shape = inspector.GetShape(id_)
    model, color = _appearance(shape, properties)
    X_FG = pose_matrix(inspector.GetPoseInFrame(id_))
    labelled = label != RenderLabel.kDoNotRender
    return Drawable(name, model, color, int(label), labelled, inspector.GetFrameId(id_), X_FG)


def _appearance(shape: Any, properties: PerceptionProperties) -> tuple[Model, Color]:
    """Returns a shape's model and the colour that multiplies it."""
    texture = _diffuse_map(properties)
    color: Color | None = None
    if properties.HasProperty("phong", "diffuse"):
        rgba: Any = properties.GetProperty("phong", "diffuse")
        color = (rgba.r(), rgba.g(), rgba.b())
    if isinstance(shape, Mesh):
        model, own = _mesh_model(shape, texture, painted=color is not None)
        if own:
            return model, WHITE
    else:
        model = _primitive_model(shape, texture)
    textured = any(surface.texture for surface in model.surfaces)
    return model, color or (WHITE if textured else DEFAULT_COLOR)


def _diffuse_map(properties: PerceptionProperties) -> Texture | None:
    path: Any = properties.GetPropertyOrDefault("phong", "diffuse_map", "")
    return read_texture(Path(path), repeats=True) if path else None


def _primitive_model(shape: Any, texture: Texture | None) -> Model:
    key = texture.key if texture else ""
    if isinstance(shape, Box):
        size = np.array(shape.size())
        return _remember(f"box {size.tolist()} {key}", lambda: (primitives.box(size, texture),))
    if isinstance(shape, Sphere | Ellipsoid):
        axes = np.array(
            [shape.radius()] * 3 if isinstance(shape, Sphere) else [shape.a(), shape.b(), shape.c()]
        )
        return _remember(
            f"ellipsoid {axes.tolist()} {key}", lambda: (primitives.ellipsoid(axes, texture),)
        )
    if isinstance(shape, Capsule | Cylinder):
        radius, length = shape.radius(), shape.length()
        make = primitives.capsule if isinstance(shape, Capsule) else primitives.cylinder
        return _remember(
            f"{make.__name__} {radius} {length} {key}", lambda: (make(radius, length, texture),)
        )
    if isinstance(shape, HalfSpace):
        return _remember(f"half space {key}", lambda: (primitives.half_space(texture),))
    if isinstance(shape, Convex):
        return _convex_model(shape)
    raise GeometryError(f"shapes of the kind {type(shape).__name__} are not drawn")


def _convex_model(shape: Convex) -> Model:
    files, key = _files(shape)
    scale = np.array(shape.scale3())

    def build() -> tuple[Surface, ...]:
        from scipy.spatial import ConvexHull, QhullError

        points = np.concatenate(
            [part.vertices["position"] for part in mesh_files.read_surfaces(files, materials=False)]
        )
        try:
            hull = ConvexHull(points * scale)
        except (QhullError, ValueError) as error:
            reason = str(error).splitlines()[0]
            raise GeometryError(f"{files.name}: has no convex hull: {reason}") from None
        corners, normals, triangles = flat_normals(hull.points, hull.simplices)
        # Qhull does not turn its triangles all the same way.
        outward = hull.equations[:, :3].repeat(3, axis=0)
        normals = normals * np.sign(np.einsum("ij,ij->i", normals, outward))[:, None]
        return (make_surface(corners, normals, triangles),)

    return _remember(f"hull {key} {scale.tolist()}", build)


def _mesh_model(shape: Mesh, texture: Texture | None, *, painted: bool) -> tuple[Model, bool]:
    """Returns a mesh's model, and whether it brings its own colours."""
    files, key = _files(shape)
    scale = np.array(shape.scale3())
    gltf = files.extension in (".gltf", ".glb")
    own = gltf or (not painted and texture is None and _has_material(files))

    def build() -> tuple[Surface, ...]:
        surfaces = mesh_files.read_surfaces(files, materials=own)
        if not own:
            surfaces = tuple(
                make_surface(
                    part.vertices["position"],
                    unpack_normals(part),
                    part.triangles,
                    uv=part.vertices["uv"],
                    texture=texture,
                )
                for part in surfaces
            )
        for part in surfaces:
            _scale(part, scale)
        return surfaces

    parts = (key, scale.tolist(), own, texture.key if texture and not own else "")
    return _remember(f"mesh {parts}", build), own


def _has_material(files: mesh_files.MeshFiles) -> bool:
    try:
        return mesh_files.has_material(files)
    except OSError:
        return False


def _scale(surface: Surface, scale: NDArray[np.float64]) -> None:
    surface.vertices["position"] *= scale
    surface.vertices["normal"][:, :3] = pack_normals(unpack_normals(surface) / scale)


def _files(shape: Any) -> tuple[mesh_files.MeshFiles, str]:
    """Returns a mesh's files and a digest of them."""
    source = shape.source()
    if source.is_path():
        path = Path(source.path())
        if not path.is_file():
            raise GeometryError(f"mesh {str(path)!r} does not exist")
        status = path.stat()
        return mesh_files.on_disk(path), f"{path} {status.st_mtime_ns} {status.st_size}"
    mesh = source.in_memory()
    files = mesh_files.in_memory(mesh)
    digest = hashlib.sha1(files.read(""))
    for name in sorted(mesh.supporting_files):
        digest.update(name.encode())
        digest.update(files.read(name))
    return files, digest.hexdigest()


def _remember(key: str, build: Any) -> Model:
    """Returns the model with a digest, built when no scene shows it."""
    model = _models.get(key)
    if model is None:
        surfaces = build()
        shade_corners(surfaces)
        model = Model(key, surfaces)
        _models[key] = model
    return model
