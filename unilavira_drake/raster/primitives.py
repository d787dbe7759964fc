"""Drake's primitive shapes as triangles, with as many facets as Drake's VTK renderer gives them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.raster.surface import Surface, Texture, make_surface

FACETS = 50
"""Around a round shape, and from pole to pole of a sphere."""

HALF_SPACE_SIZE = 100.0
"""Metres; edge of the square that stands for a half space."""

_HALF_FACET = np.pi / FACETS
"""VTK's cylinders and capsules begin with the middle of a facet at +x."""

_Grid = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]


def box(size: NDArray[np.float64], texture: Texture | None = None) -> Surface:
    """Returns a box with the whole picture on each face.

    Args:
        size: (3,) edge lengths, metres.
        texture: its picture.
    """
    positions, normals, uv = [], [], []
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.empty((4, 3))
            corners[:, axis] = sign
            # Right-handed seen from outside: the next two axes, swapped on the negative side.
            first, second = (axis + 1) % 3, (axis + 2) % 3
            if sign < 0.0:
                first, second = second, first
            corners[:, first], corners[:, second] = square[:, 0], square[:, 1]
            positions.append(corners * size / 2.0)
            normal = np.zeros((4, 3))
            normal[:, axis] = sign
            normals.append(normal)
            uv.append(np.stack(((square[:, 0] + 1) / 2, (1 - square[:, 1]) / 2), axis=1))
    quads = 4 * np.arange(6)[:, None] + np.array([[0, 1, 2, 0, 2, 3]])
    return make_surface(
        np.concatenate(positions),
        np.concatenate(normals),
        quads,
        uv=np.concatenate(uv),
        texture=texture,
    )


def ellipsoid(semi_axes: NDArray[np.float64], texture: Texture | None = None) -> Surface:
    """Returns an ellipsoid; a sphere has three equal semi-axes.

    Args:
        semi_axes: (3,) metres.
        texture: its picture, wound around z.
    """
    polar = np.linspace(0.0, np.pi, FACETS + 1)
    points, uv, triangles = _revolved(np.sin(polar), np.cos(polar))
    return make_surface(points * semi_axes, points / semi_axes, triangles, uv=uv, texture=texture)


def capsule(radius: float, length: float, texture: Texture | None = None) -> Surface:
    """Returns a capsule along z; ``length`` in metres is that of its cylinder."""
    half = np.linspace(0.0, np.pi / 2, FACETS // 2 + 1)
    polar = np.concatenate((half, np.pi - half[::-1]))
    points, uv, triangles = _revolved(np.sin(polar), np.cos(polar), _HALF_FACET)
    offset = np.zeros_like(points)
    offset[:, 2] = np.where(np.arange(len(points)) < len(points) // 2, 0.5, -0.5) * length
    return make_surface(radius * points + offset, points, triangles, uv=uv, texture=texture)


def cylinder(radius: float, length: float, texture: Texture | None = None) -> Surface:
    """Returns a cylinder along z, with caps, metres."""
    side, side_uv, side_triangles = _revolved(
        np.array([1.0, 1.0]), np.array([0.5, -0.5]), _HALF_FACET
    )
    side_normals = side * (1.0, 1.0, 0.0)
    rim = side[: FACETS + 1]
    parts = [(side, side_normals, side_uv, side_triangles)]
    for sign in (1.0, -1.0):
        points = np.concatenate((rim * (1.0, 1.0, sign), [(0.0, 0.0, 0.5 * sign)]))
        i = np.arange(FACETS)
        fan = np.stack((i, i + 1, np.full(FACETS, FACETS + 1)), axis=1)
        uv = np.stack(((points[:, 0] + 1) / 2, (1 - points[:, 1]) / 2), axis=1)
        parts.append((points, np.tile((0.0, 0.0, sign), (len(points), 1)), uv, fan))
    return _joined(parts, np.array([radius, radius, length]), texture)


def half_space(texture: Texture | None = None) -> Surface:
    """Returns the surface z = 0 of a half space as a large square."""
    reach = HALF_SPACE_SIZE / 2.0
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    positions = np.column_stack((reach * corners, np.zeros(4)))
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    uv = np.stack(((corners[:, 0] + 1) / 2, (1 - corners[:, 1]) / 2), axis=1)
    return make_surface(
        positions, normals, np.array([[0, 1, 2], [0, 2, 3]]), uv=uv, texture=texture
    )


def _joined(parts: list[_Grid], scale: NDArray[np.float64], texture: Texture | None) -> Surface:
    first = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    return make_surface(
        np.concatenate([part[0] for part in parts]) * scale,
        np.concatenate([part[1] for part in parts]),
        np.concatenate([part[3] + offset for part, offset in zip(parts, first, strict=True)]),
        uv=np.concatenate([part[2] for part in parts]),
        texture=texture,
    )


def _revolved(
    radii: NDArray[np.float64], heights: NDArray[np.float64], turn: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Returns points, picture coordinates and triangles of a profile turned about z."""
    around = np.linspace(turn, turn + 2.0 * np.pi, FACETS + 1)
    rings, columns = len(radii), FACETS + 1
    points = np.stack(
        (
            np.outer(radii, np.cos(around)),
            np.outer(radii, np.sin(around)),
            np.broadcast_to(heights[:, None], (rings, columns)),
        ),
        axis=-1,
    ).reshape(-1, 3)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rings))
    index = np.arange(rings * columns).reshape(rings, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
    return points, np.stack((u.ravel(), v.ravel()), axis=1), triangles
