"""Shapes of models: placed in the model's frame, welded, thinned out, with normals."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from furniture_conversion.catalogue import Entry
from furniture_conversion.wavefront import Part

_CREASE = math.cos(math.radians(40.0))


@dataclass(frozen=True)
class IndexedMesh:
    """Triangles that index shared vertices."""

    positions: NDArray[np.float32]
    """(n, 3)"""
    normals: NDArray[np.float32]
    """(n, 3) unit vectors."""
    uv: NDArray[np.float32]
    """(n, 2): column and row from the picture's upper left corner."""
    triangles: NDArray[np.uint32]
    """(t, 3)"""


def place(parts: list[Part], entry: Entry, *, yaw: float, elevation: float) -> list[Part]:
    """Turns and scales parts to the catalogue's size in the model's frame M.

    M's z is up, its origin the middle of the footprint on the floor, and the front, which faces
    the library's +z, faces +x.

    Args:
        parts: as read, y up.
        entry: catalogue entry.
        yaw: further turn about z, a multiple of 90 degrees; the size turns with it.
        elevation: height of the lowest point, metres.
    """
    corners = np.concatenate([part.positions.reshape(-1, 3) for part in parts])
    turned = corners @ entry.rotation.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    scale = np.array([entry.width, entry.height, entry.depth]) / np.maximum(high - low, 1e-9)
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    quarter = round(yaw / 90.0) % 4
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter]
    R_MS = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]], dtype=np.float64)
    R_MS = R_MS @ np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    placed = []
    for part in parts:
        positions = ((part.positions @ entry.rotation.T - middle) * scale) @ R_MS.T
        positions[..., 2] += elevation
        normals = ((part.normals @ entry.rotation.T) / scale) @ R_MS.T
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
        placed.append(replace(part, positions=positions, normals=normals))
    return placed


def extent(parts: list[Part]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the lowest and the highest coordinates (3,) of the parts."""
    corners = np.concatenate([part.positions.reshape(-1, 3) for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


def fit(parts: list[Part], low: NDArray[np.float64], high: NDArray[np.float64]) -> list[Part]:
    """Stretches parts to fill a box again, with the middle of its footprint at x = y = 0."""
    old_low, old_high = extent(parts)
    scale = (high - low) / np.maximum(old_high - old_low, 1e-9)
    base = np.array([*((low - high)[:2] / 2), low[2]])
    return [replace(part, positions=(part.positions - old_low) * scale + base) for part in parts]


def triangle_areas(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the areas (t,) of triangles with corners (t, 3, 3)."""
    edges = positions[:, 1:] - positions[:, :1]
    areas: NDArray[np.float64] = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    return areas


def clean(part: Part) -> Part:
    """Drops triangles without area and those that repeat another, whichever way they face."""
    kept = np.flatnonzero(triangle_areas(part.positions) > 1e-10)
    keys = np.round(part.positions[kept] * 1e5).astype(np.int64)
    order = np.lexsort((keys[..., 2], keys[..., 1], keys[..., 0]), axis=1)
    keys = np.take_along_axis(keys, order[..., None], axis=1).reshape(len(kept), 9)
    _, first = np.unique(keys, axis=0, return_index=True)
    kept = kept[np.sort(first)]
    return replace(
        part, positions=part.positions[kept], normals=part.normals[kept], uv=part.uv[kept]
    )


def index(part: Part) -> IndexedMesh:
    """Returns the part with shared vertices, and triangles that wind as their normals point.

    Normals that the source lacks are means over the faces around a corner that a chain of edges
    below 40 degrees links with the corner's own.
    """
    normals = _corner_normals(part.positions)
    given = np.isfinite(part.normals).all(axis=-1) & (
        np.linalg.norm(np.nan_to_num(part.normals), axis=-1) > 0.5
    )
    normals[given] = part.normals[given]
    edges = part.positions[:, 1:] - part.positions[:, :1]
    faces = np.cross(edges[:, 0], edges[:, 1])
    backwards = np.einsum("ij,ij->i", faces, normals.sum(axis=1)) < 0
    order = np.where(backwards[:, None], [[0, 2, 1]], [[0, 1, 2]])
    stacked = np.concatenate(
        [np.round(part.positions, 5), np.round(normals, 2), np.round(part.uv, 4)], axis=-1
    )
    stacked = np.take_along_axis(stacked, order[..., None], axis=1).reshape(-1, 8)
    vertices, inverse = np.unique(stacked, axis=0, return_inverse=True)
    unit = vertices[:, 3:6] / np.maximum(np.linalg.norm(vertices[:, 3:6], axis=1)[:, None], 1e-9)
    return IndexedMesh(
        positions=vertices[:, :3].astype(np.float32),
        normals=unit.astype(np.float32),
        uv=np.stack((vertices[:, 6], 1.0 - vertices[:, 7]), axis=1).astype(np.float32),
        triangles=inverse.reshape(-1, 3).astype(np.uint32),
    )


def _corner_normals(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    edges = positions[:, 1:] - positions[:, :1]
    weighted = np.cross(edges[:, 0], edges[:, 1])
    unit = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-12)
    _, vertex = np.unique(
        np.round(positions.reshape(-1, 3) * 1e5).astype(np.int64), axis=0, return_inverse=True
    )
    vertex = vertex.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    bounds = np.flatnonzero(np.diff(vertex[order], prepend=-1, append=-1))
    normals = np.repeat(unit[:, None], 3, axis=1).reshape(-1, 3)
    for start, end in pairwise(bounds.tolist()):
        corners = order[start:end]
        faces = corners // 3
        near = _chained(unit[faces] @ unit[faces].T > _CREASE)
        sums = near @ weighted[faces]
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        normals[corners] = np.where(length > 1e-12, sums / np.maximum(length, 1e-12), unit[faces])
    return normals.reshape(-1, 3, 3)


def _chained(near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Returns which faces a chain of near ones links, so that a smooth patch has one normal."""
    if near.all():
        return near
    for _ in range(max(1, math.ceil(math.log2(len(near))))):
        near = (near.astype(np.float32) @ near.astype(np.float32)) > 0
    return near
