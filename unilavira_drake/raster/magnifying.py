"""Which surfaces a view shows as large as their pictures, so that no smaller size is needed.

To choose among the sizes of a picture costs a software renderer a quarter of all that a textured
pixel costs, and the walls of a room are nearly always magnified.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message
from unilavira_drake.raster.culling import Pinhole
from unilavira_drake.raster.surface import Surface

_COARSEST = 2.0
"""Pixels of a picture on one of the view.  Bilinear interpolation reads two each way, so up to here
it leaves none out."""

_POINTS = 5
"""A side of the grid over a piece."""

_MOST_PLANES = 8
_SAME_PLANE = 1e-3


@dataclass(frozen=True, eq=False)
class Facets(Message):
    """Flat pieces of some surfaces, each in the frame of its geometry."""

    surface: NDArray[np.int64]
    """(f,) number of the surface that a piece belongs to."""
    normals: NDArray[np.float64]
    """(f, 3)."""
    points: NDArray[np.float64]
    """(f, 25, 3) over the rectangle around the piece, metres."""
    reach: NDArray[np.float64]
    """(f,) half a step between points, metres."""
    density: NDArray[np.float64]
    """(f,) greatest number of the picture's pixels on a metre."""


def facets_of(surfaces: dict[int, Surface]) -> Facets:
    """Returns the pieces of some surfaces with pictures; of one with many planes there are none.

    Args:
        surfaces: by their numbers.
    """
    found = [(number, *facet) for number, surface in surfaces.items() for facet in _planes(surface)]
    number, normal, points, reach, density = zip(*found, strict=True) if found else ((),) * 5
    return Facets(
        np.array(number, np.int64),
        np.array(normal).reshape(-1, 3),
        np.array(points).reshape(-1, _POINTS * _POINTS, 3),
        np.array(reach),
        np.array(density),
    )


def magnified(
    facets: Facets,
    seen: NDArray[np.int64],
    rows: NDArray[np.float64],
    X_CW: NDArray[np.float64],
    pinhole: Pinhole,
) -> NDArray[np.bool_]:
    """Returns which surfaces are in view with all of their pictures' pixels large enough.

    Args:
        facets: flat pieces; surfaces without any are taken for not magnified.
        seen: (k,) numbers of the surfaces in question.
        rows: (n, 3, 4) poses of the geometries of all surfaces.
        X_CW: (4, 4) of the camera.
        pinhole: its model.

    Returns:
        (n,), False beside the surfaces in question.
    """
    small, large = np.zeros((2, len(rows)), np.bool_)
    small[seen] = True
    chosen = np.flatnonzero(small[facets.surface])
    surface = facets.surface[chosen]
    R_CW, pose = X_CW[:3, :3], rows[surface]
    R_GC = (R_CW @ pose[:, :, :3]).transpose(0, 2, 1)
    p = facets.points[chosen] @ R_GC + (pose[:, :, 3] @ R_CW.T + X_CW[:3, 3])[:, None, :]
    n = (facets.normals[chosen, None, :] @ R_GC)[:, 0, :]
    inside: NDArray[np.bool_] = p @ _sides(pinhole) >= -facets.reach[chosen, None, None]
    in_view = np.all(inside, axis=2)
    # The cone of a pixel meets the plane n . p = h in an ellipse as long as z |p| / f h.
    h = np.einsum("fi,fi->f", n, p[:, 0]) * min(pinhole.fx, pinhole.fy)
    length = np.einsum("fki,fki->fk", p, p) * p[:, :, 2] ** 2
    coarsest = (_COARSEST / facets.density[chosen] * h) ** 2
    minified: NDArray[np.bool_] = (length > coarsest[:, None]) & in_view
    large[surface] = True
    large[surface[np.any(minified, axis=1) | ~np.any(in_view, axis=1)]] = False
    return large


@functools.lru_cache(maxsize=16)
def _sides(pinhole: Pinhole) -> NDArray[np.float64]:
    """Returns the normals of the planes around a view, in its frame, as the columns of (3, 5)."""
    left, right = -pinhole.cx / pinhole.fx, (pinhole.width - pinhole.cx) / pinhole.fx
    upper, lower = -pinhole.cy / pinhole.fy, (pinhole.height - pinhole.cy) / pinhole.fy
    sides = np.array(
        [(1, 0, -left), (-1, 0, right), (0, 1, -upper), (0, -1, lower), (0, 0, 1)], float
    )
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    return sides.T


def _planes(surface: Surface) -> list[tuple[Any, ...]]:
    """Returns normal, points, reach and density of each flat piece; none if there are many."""
    texture = surface.texture
    if texture is None:
        return []
    corners = surface.vertices["position"][surface.triangles].astype(float)
    uv = surface.vertices["uv"][surface.triangles] * texture.pixels.shape[1::-1]
    edges, steps = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    area = np.linalg.norm(normals, axis=1, keepdims=True)
    large = area[:, 0] > 0.0
    corners, edges, steps = corners[large], edges[large], steps[large]
    normals = normals[large] / area[large]
    offsets = np.einsum("ti,ti->t", normals, corners[:, 0])
    keys = np.round(np.column_stack((normals, offsets)) / _SAME_PLANE)
    _, first, plane = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    if len(first) > _MOST_PLANES:
        return []
    # Picture pixels along two orthonormal directions of each triangle's plane.
    across = edges[:, 0] / np.linalg.norm(edges[:, 0], axis=1, keepdims=True)
    frame = np.stack((across, np.cross(normals, across)), axis=2)
    jacobian = np.linalg.solve(edges @ frame, steps)
    density = np.linalg.norm(jacobian, ord=2, axis=(1, 2))
    plane = plane.reshape(-1)
    return [
        (
            normals[one],
            *_grid(corners[plane == i].reshape(-1, 3), frame[one]),
            density[plane == i].max(),
        )
        for i, one in enumerate(first)
    ]


def _grid(
    corners: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Returns points over the rectangle around some corners of a plane, and half their step."""
    flat = (corners - corners[0]) @ frame
    low, high = flat.min(axis=0), flat.max(axis=0)
    share = np.linspace(0.0, 1.0, _POINTS)
    s, t = np.meshgrid(share, share)
    flat = low + np.column_stack((s.ravel(), t.ravel())) * (high - low)
    return corners[0] + flat @ frame.T, float(max(high - low)) / (_POINTS - 1) / 2.0
