"""Worlds of boxes for the tests of flight: as voxels, and as distances to the true boxes."""

import itertools

import numpy as np

from unilavira_drake.messages import VoxelMap
from unilavira_drake.planning.visibility_space import FlightSpace, update_space

RESOLUTION = 0.5


def voxels_of(boxes, resolution=RESOLUTION, version=1, n=1):
    """A map in which the voxels that a box (x0, y0, z0, x1, y1, z1) enters are occupied."""
    tiles = {}
    for box in boxes:
        low = np.floor(np.array(box[:3]) / resolution + 1e-9).astype(int)
        high = np.ceil(np.array(box[3:]) / resolution - 1e-9).astype(int)
        for key in np.ndindex(*(high // 32 - low // 32 + 1)):
            key = tuple(int(x) for x in np.array(key) + low // 32)
            tile = tiles.setdefault(key, np.full((32, 32, 32), -20, np.int8))
            a, b = np.array(key) * 32, np.array(key) * 32 + 32
            i, j = np.maximum(low, a) - a, np.minimum(high, b) - a
            tile[i[0] : j[0], i[1] : j[1], i[2] : j[2]] = 20
    return VoxelMap(n=n, version=version, resolution=resolution, tiles=tiles)


def space_of(boxes, clearance, resolution=RESOLUTION):
    return update_space(FlightSpace(clearance=clearance), voxels_of(boxes, resolution))


def random_boxes(rng, count=14, size=30.0, height=14.0):
    """Ground and buildings, some of them hanging."""
    boxes = [(-size, -size, -1.0, size, size, 0.0)]
    for _ in range(count):
        x, y = rng.uniform(-0.5 * size, 0.5 * size, 2)
        dx, dy = rng.uniform(1.0, 8.0, 2)
        z = 0.0 if rng.random() < 0.7 else rng.uniform(2.0, 0.6 * height)
        boxes.append((x, y, z, x + dx, y + dy, z + rng.uniform(2.0, height)))
    return boxes


def distance_to(boxes, points):
    """(m,) distances from (m, 3) points to the nearest box; 0 within."""
    low, high = np.array(boxes)[:, None, :3], np.array(boxes)[:, None, 3:]
    gaps = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.linalg.norm(gaps, axis=2).min(axis=0)


def along(p_WP, step=0.05):
    """(m, 3) points along a polyline."""
    parts = []
    for a, b in itertools.pairwise(p_WP):
        n = max(int(np.linalg.norm(b - a) / step), 1)
        parts.append(a + (b - a) * np.linspace(0, 1, n + 1)[:, None])
    return np.concatenate(parts)


def slopes(p_WP):
    """Angles of the pieces above the horizon, radians."""
    d = np.diff(p_WP, axis=0)
    return np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))
