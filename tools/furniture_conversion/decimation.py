"""Fewer triangles for models that have too many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from furniture_conversion.shape import clean, triangle_areas
from furniture_conversion.wavefront import Part

_SMALL = 40
"""No part is asked to have fewer triangles."""


def thin_out(parts: list[Part], limit: int) -> list[Part]:
    """Returns parts of at most ``limit`` triangles in all, by quadric edge collapse.

    A part gets its share by the root of its area: boards of few triangles stay whole, and a screw
    of thousands does not.  Needs the package ``fast-simplification`` where something is removed.

    Raises:
        ValueError: if the limit cannot be reached.
    """
    budget = limit
    for _ in range(8):
        if sum(len(part.positions) for part in parts) <= limit:
            return parts
        thinned = [
            _decimate(part, share) if share < len(part.positions) else part
            for part, share in zip(parts, _shares(parts, budget), strict=True)
        ]
        parts = [part for part in thinned if len(part.positions)]
        budget = int(0.85 * budget)
    raise ValueError(f"more than {limit} triangles even after simplification.")


def _shares(parts: list[Part], limit: int) -> list[int]:
    counts = np.array([len(part.positions) for part in parts])
    weights = np.sqrt([triangle_areas(part.positions).sum() for part in parts])
    low, high = 0.0, float(counts.max() / weights.min())
    for _ in range(60):
        level = (low + high) / 2
        kept = np.minimum(counts, np.maximum(_SMALL, level * weights)).sum()
        low, high = (level, high) if kept <= limit else (low, level)
    shares: list[int] = np.minimum(counts, np.maximum(_SMALL, low * weights)).astype(int).tolist()
    return shares


def _decimate(part: Part, target: int) -> Part:
    # Only models that are too large need it.
    import fast_simplification  # type: ignore[import-untyped]

    flat = part.positions.reshape(-1, 3)
    _, first, inverse = np.unique(
        np.round(flat * 1e4).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    points, faces = fast_simplification.simplify(
        flat[first].astype(np.float32),
        inverse.reshape(-1, 3).astype(np.int32),
        target_count=target,
        agg=5.0,
    )
    positions = np.asarray(points, dtype=np.float64)[np.asarray(faces)]
    _, nearest = cKDTree(flat).query(positions.reshape(-1, 3))
    uv = part.uv.reshape(-1, 2)[nearest].reshape(-1, 3, 2)
    return clean(replace(part, positions=positions, uv=uv, normals=np.full_like(positions, np.nan)))
