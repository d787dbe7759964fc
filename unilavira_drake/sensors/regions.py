"""The regions of a label image: one pass over runs of equal pixels, then one over their insides.

Connected components by union-find on run-length encoded rows (Rosenfeld and Pfaltz, 1966, on
runs); the inside of a region is measured by the distance to the nearest pixel of another label
(Borgefors, 1986, as in OpenCV).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import frozen_view, kernel
from unilavira_drake.messages import Frame
from unilavira_drake.sensors.color_names import COLOR_WORDS, color_table

SAMPLES = 4000
"""A larger region is sampled: so many pixels settle a median and a vote."""

CENTRAL = 0.01
"""How many pixels of depth inside a region one pixel nearer to its centroid is worth."""


@dataclass(frozen=True)
class Region:
    """What is visible of one label: its connected parts of at least the least size."""

    label: int
    pixels: int
    box: tuple[float, float, float, float]
    """(u_min, v_min, u_max, v_max), pixels."""
    point: tuple[float, float]
    """(u, v) of the pixel deepest inside; among near equals the one near the centroid."""
    color: str
    """The word of most pixels."""
    distance: float
    """Median horizontal distance from the camera, metres."""
    point_distance: float
    """Horizontal distance from the camera to ``point``, metres."""


def find_regions(frame: Frame, wanted: NDArray[np.bool_], least: int, far: float) -> list[Region]:
    """Returns the regions of the wanted labels, in the order of their labels.

    Args:
        frame: colour, depth (metres), label, intrinsics and pose of one view.
        wanted: (32768,) bool, by label.
        least: connected parts with fewer pixels are ignored.
        far: distance that stands for a depth beyond the camera's range, metres.
    """
    label = frozen_view(frame.label, np.int16)
    runs, slots = _runs(label, wanted, least)
    if not len(slots):
        return []
    stats = _stats(runs, len(slots))
    points = _deepest(runs, stats, _depth_inside(label))
    votes, ranges = _samples(
        runs,
        stats,
        points,
        frozen_view(frame.color, np.uint8),
        frozen_view(frame.depth, np.float32),
        color_table(),
        _ray_matrix(frame),
        far,
    )
    return [
        Region(
            label=int(slots[i]),
            pixels=int(stats[i, 0]),
            box=(float(stats[i, 1]), float(stats[i, 2]), float(stats[i, 3]), float(stats[i, 4])),
            point=(float(points[i, 0]), float(points[i, 1])),
            color=COLOR_WORDS[int(np.argmax(votes[i]))],
            distance=float(ranges[i, 0]),
            point_distance=float(ranges[i, 1]),
        )
        for i in range(len(slots))
    ]


def _ray_matrix(frame: Frame) -> NDArray[np.float64]:
    """Returns the (2, 3) matrix from (u, v, 1) to the horizontal offset at depth 1, metres."""
    k = frame.intrinsics
    inverse = np.array(
        [[1 / k.fx, 0.0, -k.cx / k.fx], [0.0, 1 / k.fy, -k.cy / k.fy], [0.0, 0.0, 1.0]]
    )
    return np.ascontiguousarray((frame.X_WC[:3, :3] @ inverse)[:2])


def _depth_inside(label: NDArray[np.int16]) -> NDArray[np.float32]:
    """Returns (H, W) float32 pixels from each pixel to the edge of its region or of the image."""
    inside = cv2.distanceTransform(_interior(label), cv2.DIST_L2, 3)
    return frozen_view(np.asarray(inside), np.float32)


@kernel
def _interior(label: NDArray[np.int16]) -> NDArray[np.uint8]:
    height, width = label.shape
    interior = np.zeros((height, width), np.uint8)
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            own = label[v, u]
            interior[v, u] = (
                own == label[v, u - 1]
                and own == label[v, u + 1]
                and own == label[v - 1, u]
                and own == label[v + 1, u]
            )
    return interior


@kernel
def _find(parent: NDArray[np.int64], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _encode(
    label: NDArray[np.int16], wanted: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Returns (row, start, end, label) of each run of a wanted label, and where rows begin."""
    height, width = label.shape
    capacity = 4096
    runs = np.empty((capacity, 4), np.int32)
    first = np.empty(height + 1, np.int32)
    count = 0
    for v in range(height):
        first[v] = count
        u = 0
        while u < width:
            own = label[v, u]
            start = u
            u += 1
            while u < width and label[v, u] == own:
                u += 1
            if own >= 0 and wanted[own]:
                if count == capacity:
                    larger = np.empty((2 * capacity, 4), np.int32)
                    larger[:capacity] = runs
                    runs = larger
                    capacity *= 2
                runs[count, 0] = v
                runs[count, 1] = start
                runs[count, 2] = u
                runs[count, 3] = own
                count += 1
    first[height] = count
    return runs[:count], first


@kernel
def _connect(runs: NDArray[np.int32], first: NDArray[np.int32]) -> NDArray[np.int64]:
    """Returns the root run of each run: runs that touch across rows share a root."""
    parent = np.arange(len(runs))
    for v in range(1, len(first) - 1):
        i, j = first[v - 1], first[v]
        while i < first[v] and j < first[v + 1]:
            overlap = runs[i, 1] < runs[j, 2] and runs[j, 1] < runs[i, 2]
            if overlap and runs[i, 3] == runs[j, 3]:
                a, b = _find(parent, i), _find(parent, j)
                parent[max(a, b)] = min(a, b)
            if runs[i, 2] < runs[j, 2]:
                i += 1
            else:
                j += 1
    for i in range(len(runs)):
        parent[i] = _find(parent, i)
    return parent


@kernel
def _runs(
    label: NDArray[np.int16], wanted: NDArray[np.bool_], least: int
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Returns the runs of all parts that are large enough, with the slot of their label in the
    place of the label, and the label of each slot (ascending).
    """
    runs, first = _encode(label, wanted)
    root = _connect(runs, first)
    size = np.zeros(len(runs), np.int64)
    for i in range(len(runs)):
        size[root[i]] += runs[i, 2] - runs[i, 1]
    seen = np.zeros(32768, np.bool_)
    kept = 0
    for i in range(len(runs)):
        if size[root[i]] >= least:
            seen[runs[i, 3]] = True
            runs[kept] = runs[i]
            kept += 1
    slots = np.flatnonzero(seen)
    slot_of = np.zeros(32768, np.int32)
    for i in range(len(slots)):
        slot_of[slots[i]] = i
    for i in range(kept):
        runs[i, 3] = slot_of[runs[i, 3]]
    return runs[:kept], slots


@kernel
def _stats(runs: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Returns (pixels, u_min, v_min, u_max, v_max, sum u, sum v) of each slot."""
    stats = np.zeros((count, 7), np.int64)
    stats[:, 1:3] = 1 << 30
    for i in range(len(runs)):
        v, start, end, slot = runs[i]
        length = end - start
        row = stats[slot]
        row[0] += length
        row[1] = min(row[1], start)
        row[2] = min(row[2], v)
        row[3] = max(row[3], end)
        row[4] = max(row[4], v + 1)
        row[5] += length * (start + end - 1) // 2
        row[6] += length * v
    return stats


@kernel
def _deepest(
    runs: NDArray[np.int32], stats: NDArray[np.int64], inside: NDArray[np.float32]
) -> NDArray[np.int64]:
    """Returns (u, v) of the pixel deepest inside each slot."""
    points = np.zeros((len(stats), 2), np.int64)
    best = np.full(len(stats), -np.inf)
    for i in range(len(runs)):
        v, start, end, slot = runs[i]
        u_mean = stats[slot, 5] / stats[slot, 0]
        v_mean = stats[slot, 6] / stats[slot, 0]
        for u in range(start, end):
            if inside[v, u] > best[slot]:
                score = inside[v, u] - CENTRAL * np.hypot(u - u_mean, v - v_mean)
                if score > best[slot]:
                    best[slot] = score
                    points[slot, 0] = u
                    points[slot, 1] = v
    return points


@kernel
def _range(matrix: NDArray[np.float64], depth: float, u: int, v: int, far: float) -> float:
    x = matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2]
    y = matrix[1, 0] * u + matrix[1, 1] * v + matrix[1, 2]
    return min(depth * np.sqrt(x * x + y * y), far)  # type: ignore[no-any-return]


@kernel
def _samples(
    runs: NDArray[np.int32],
    stats: NDArray[np.int64],
    points: NDArray[np.int64],
    color: NDArray[np.uint8],
    depth: NDArray[np.float32],
    table: NDArray[np.uint8],
    matrix: NDArray[np.float64],
    far: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Returns the colour votes (k, 12), and median and point range (k, 2), of each slot."""
    count = len(stats)
    votes = np.zeros((count, 12), np.int64)
    ranges = np.zeros((count, 2), np.float64)
    stride = np.ceil(np.sqrt(stats[:, 0] / SAMPLES)).astype(np.int64)
    end_of = np.cumsum(stats[:, 0])
    samples = np.empty(end_of[-1], np.float32)
    filled = end_of - stats[:, 0]
    for i in range(len(runs)):
        v, start, end, slot = runs[i]
        step = stride[slot]
        if v % step:
            continue
        for u in range(start + (-start) % step, end, step):
            red, green, blue = color[v, u, 0], color[v, u, 1], color[v, u, 2]
            votes[slot, table[(red >> 3) << 10 | (green >> 3) << 5 | blue >> 3]] += 1
            samples[filled[slot]] = _range(matrix, depth[v, u], u, v, far)
            filled[slot] += 1
    for slot in range(count):
        u, v = points[slot]
        first = end_of[slot] - stats[slot, 0]
        ranges[slot, 1] = _range(matrix, depth[v, u], u, v, far)
        ranges[slot, 0] = ranges[slot, 1]
        if filled[slot] > first:
            ranges[slot, 0] = np.median(samples[first : filled[slot]])
    return votes, ranges
