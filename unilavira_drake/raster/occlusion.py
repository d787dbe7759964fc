"""How open to the sky each vertex of a shape is: dark seams in its inner corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.raster.surface import Surface, unpack_normals

DARKEST = 0.8
"""Share of its brightness that an inner corner keeps: colour words stay as they are."""

_GRID = 1e-4

_REACH = 0.4
"""Metres; longer edges darken nothing, for they would draw their shade over a whole wall."""


def shade_corners(surfaces: tuple[Surface, ...]) -> None:
    """Writes the openness of each vertex, in place.

    A vertex is closed in as far as its neighbours rise above its tangent plane, the mean over the
    edges that meet in its position, of all surfaces; short edges count most.  It costs one pass
    over the edges, no rays.
    """
    if not surfaces:
        return
    position = np.concatenate([surface.vertices["position"] for surface in surfaces])
    normal = np.concatenate([unpack_normals(surface) for surface in surfaces])
    first = np.cumsum([0] + [len(surface.vertices) for surface in surfaces])
    edges = np.concatenate(
        [_edges(surface.triangles) + start for surface, start in zip(surfaces, first, strict=False)]
    )
    place = _places(position)
    count = int(place.max()) + 1 if len(place) else 0
    a, b = place[edges[:, 0]], place[edges[:, 1]]
    sum_of = np.zeros((count, 3))
    along = (position[edges[:, 1]] - position[edges[:, 0]]).astype(np.float64)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along *= np.clip(1.0 - length / _REACH, 0.0, 1.0) / np.where(length > 0.0, length, 1.0)
    degree = np.bincount(a, minlength=count) + np.bincount(b, minlength=count)
    for axis in range(3):
        sum_of[:, axis] = np.bincount(a, along[:, axis], count) - np.bincount(
            b, along[:, axis], count
        )
    mean = sum_of / np.maximum(degree, 1)[:, None]
    rise = np.einsum("ij,ij->i", mean[place], normal)
    openness = 1.0 - (1.0 - DARKEST) * np.clip(2.0 * rise, 0.0, 1.0)
    for surface, start, end in zip(surfaces, first[:-1], first[1:], strict=True):
        surface.vertices["normal"][:, 3] = np.round(255.0 * openness[start:end])


def _edges(triangles: NDArray[np.uint32]) -> NDArray[np.int64]:
    return np.concatenate(
        (triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]])
    ).astype(np.int64)


def _places(position: NDArray[np.float32]) -> NDArray[np.int64]:
    """Returns a number for each vertex, the same for vertices in the same place."""
    cells = np.round(position / _GRID).astype(np.int64)
    low = cells.min(axis=0) if len(cells) else np.zeros(3, np.int64)
    cells -= low
    span = cells.max(axis=0) + 1 if len(cells) else np.ones(3, np.int64)
    flat = (cells[:, 0] * span[1] + cells[:, 1]) * span[2] + cells[:, 2]
    return np.unique(flat, return_inverse=True)[1].reshape(-1)
