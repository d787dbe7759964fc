"""Collision boxes of a model: its outline seen from above, cut into a few rectangles.

A box around the whole model would stop a robot where nothing is to be seen: beside a round table,
in the corner of a corner sofa.  Each rectangle becomes a box as high as what stands in it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

CELL = 0.025
"""Side of a cell of the outline, metres."""
MOST_PARTS = 8
ENOUGH = 0.97
"""Share of the outline that the rectangles cover before the search ends."""
SMALLEST = 0.01
"""A further rectangle smaller than this is left out, square metres."""
SAMPLES = 60_000

Part = tuple[float, float, float, float, float, float]
"""x, y, z of the middle of the bottom, length, width, height; metres in the model's frame."""


def collision_parts(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[Part, ...]:
    """Returns the collision boxes of a mesh, largest first.

    Args:
        vertices: (n, 3) metres in the model's frame, z up.
        triangles: (k, 3) indices of vertices.
    """
    points = _samples(vertices, triangles)
    low = points[:, :2].min(axis=0)
    columns, rows = np.maximum(1, np.ceil(np.ptp(points[:, :2], axis=0) / CELL)).astype(int)
    u, v = np.minimum(((points[:, :2] - low) / CELL).astype(int), [columns - 1, rows - 1]).T
    mask = np.zeros((rows, columns), np.uint8)
    mask[v, u] = 1
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(mask, outlines, -1, (1,), cv2.FILLED)
    left = mask.astype(bool)
    parts: list[Part] = []
    while len(parts) < MOST_PARTS and left.sum() > (1.0 - ENOUGH) * mask.sum():
        i0, i1, j0, j1 = _largest_rectangle(left)
        if parts and (i1 - i0) * (j1 - j0) * CELL**2 < SMALLEST:
            break
        left[i0:i1, j0:j1] = False
        inside = (v >= i0) & (v < i1) & (u >= j0) & (u < j1)
        parts.append(_part(points[inside], low, (i0, i1, j0, j1), points))
    return tuple(parts)


def _part(
    inside: NDArray[np.float64],
    low: NDArray[np.float64],
    cells: tuple[int, int, int, int],
    points: NDArray[np.float64],
) -> Part:
    i0, i1, j0, j1 = cells
    high = points[:, :2].max(axis=0)
    x0, y0 = low + np.array([j0, i0]) * CELL
    x1, y1 = np.minimum(low + np.array([j1, i1]) * CELL, high)
    z0, z1 = inside[:, 2].min(), inside[:, 2].max()
    numbers = ((x0 + x1) / 2, (y0 + y1) / 2, z0, x1 - x0, y1 - y0, z1 - z0)
    x, y, z, length, width, height = (round(float(number), 3) for number in numbers)
    return x, y, z, max(length, 0.01), max(width, 0.01), max(height, 0.01)


def _samples(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns the vertices and points spread over the triangles by area, the same each time."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    generator = np.random.default_rng(0)
    chosen = generator.choice(len(triangles), SAMPLES, p=area / area.sum())
    s, t = generator.random((2, SAMPLES, 1))
    flip = s + t > 1.0
    s, t = np.where(flip, 1.0 - s, s), np.where(flip, 1.0 - t, t)
    inner = a[chosen] + s * (b[chosen] - a[chosen]) + t * (c[chosen] - a[chosen])
    return np.concatenate((vertices[np.unique(triangles)], inner))


def _largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Returns rows i0:i1 and columns j0:j1 of the largest rectangle of true cells."""
    heights = np.zeros(mask.shape[1], int)
    best, area = (0, 0, 0, 0), 0
    for i, row in enumerate(mask):
        heights = np.where(row, heights + 1, 0)
        stack: list[int] = []
        for j in range(len(heights) + 1):
            height = heights[j] if j < len(heights) else 0
            while stack and heights[stack[-1]] >= height:
                tall = heights[stack.pop()]
                start = stack[-1] + 1 if stack else 0
                if tall * (j - start) > area:
                    area = int(tall * (j - start))
                    best = (i + 1 - int(tall), i + 1, start, j)
            stack.append(j)
    return best
