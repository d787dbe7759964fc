"""Triangles as the raster camera keeps them: packed vertices, one picture, one kind of light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message

VERTEX = np.dtype(
    [("position", "<f4", 3), ("normal", "u1", 4), ("uv", "<f4", 2), ("color", "u1", 4)]
)
"""A vertex: metres; unit normal as 128 + 127 n, and openness to the sky; picture coordinates with
the origin in the upper left corner; sRGB."""

MAX_TEXTURE = 8192
"""Pixels a side; a larger picture is an error, not a machine out of memory."""

WHITE = (1.0, 1.0, 1.0)

Color = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Texture(Message):
    """A picture on surfaces."""

    key: str
    """Digest of the pixels."""
    pixels: NDArray[np.uint8]
    """(H, W, 4) uint8 RGBA, sRGB, upper row first."""
    repeats: bool
    """Whether it repeats outside [0, 1]; else its edge goes on."""


@dataclass(frozen=True, eq=False)
class Surface(Message):
    """Triangles that share a picture."""

    vertices: NDArray[np.void]
    """(n,) of ``VERTEX``, in the geometry's frame."""
    triangles: NDArray[np.uint32]
    """(m, 3) uint32."""
    texture: Texture | None = None
    alpha_cutoff: float = 0.0
    """Points with less alpha are holes; 0 where there are none."""
    linear: bool = False
    """Whether light multiplies linear colours, as on glTF materials, instead of sRGB values."""


@dataclass(frozen=True, eq=False)
class Model(Message):
    """All surfaces of a shape."""

    key: str
    """Digest of everything that shapes it."""
    surfaces: tuple[Surface, ...]


def make_surface(
    positions: NDArray[np.float64],
    normals: NDArray[np.float64],
    triangles: NDArray[np.integer],
    *,
    uv: NDArray[np.float64] | None = None,
    colors: NDArray[np.uint8] | None = None,
    texture: Texture | None = None,
    alpha_cutoff: float = 0.0,
    linear: bool = False,
) -> Surface:
    """Returns a surface of packed vertices.

    Args:
        positions: (n, 3) metres.
        normals: (n, 3) of any length.
        triangles: (m, 3) indices of vertices.
        uv: (n, 2) picture coordinates.
        colors: (n, 3) or (3,) uint8 sRGB; white by default.
        texture: the picture.
        alpha_cutoff: of ``Surface``.
        linear: of ``Surface``.
    """
    vertices = np.zeros(len(positions), VERTEX)
    vertices["position"] = positions
    vertices["normal"][:, :3] = pack_normals(normals)
    vertices["normal"][:, 3] = 255
    if uv is not None:
        vertices["uv"] = uv
    vertices["color"] = 255
    if colors is not None:
        vertices["color"][:, :3] = colors
    faces = np.ascontiguousarray(triangles, np.uint32).reshape(-1, 3)
    return Surface(vertices, faces, texture, alpha_cutoff, linear)


def pack_normals(normals: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Returns (n, 3) normals of any length as a vertex holds them."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    packed: NDArray[np.uint8] = np.round(
        128.0 + 127.0 * normals / np.where(length > 0.0, length, 1.0)
    ).astype(np.uint8)
    return packed


def unpack_normals(surface: Surface) -> NDArray[np.float64]:
    """Returns the (n, 3) unit normals of a surface's vertices."""
    normals: NDArray[np.float64] = (surface.vertices["normal"][:, :3].astype(float) - 128.0) / 127.0
    return normals


def flat_normals(
    positions: NDArray[np.float64], triangles: NDArray[np.integer]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Returns corners, normals and indices in which no two triangles share a vertex."""
    corners = positions[triangles].reshape(-1, 3)
    a, b, c = corners[0::3], corners[1::3], corners[2::3]
    normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    return corners, normals, np.arange(len(corners)).reshape(-1, 3)
