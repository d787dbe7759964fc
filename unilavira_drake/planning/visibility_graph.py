"""Visibility search between sampled corners, for goals that are far away.

Shortest paths among obstacles bend at convex edges.  The voxels at such edges over which a way
may be shorter than a known one are thinned to a few hundred, and an A* search runs over the
complete graph between them that nobody builds: whether an edge is free is looked up when the
search wants to use it (Dellin and Srinivasa 2016, lazy shortest paths).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import inlined_kernel, kernel
from unilavira_drake.planning.visibility_lines import Slopes, edge, edge_cost, path_cost

MAX_CORNERS = 400
"""Most corners in one graph."""

_FINEST = 4
"""Side of the smallest block of voxels that keeps only its best corner."""


def corner_path(
    words: NDArray[np.uint32],
    known: NDArray[np.float64],
    slopes: Slopes,
    max_corners: int = MAX_CORNERS,
) -> NDArray[np.float64]:
    """Returns the (k, 3) nodes of the shortest path over sampled corners and a known path's nodes.

    Corners over which no way is shorter than the known path are not looked at.

    Args:
        words: blocked bits of a window with a blocked border.
        known: (k, 3) nodes of a path of free edges, k >= 2, voxels.
        slopes: of :func:`slopes_of`.
        max_corners: most corners that are sampled.
    """
    bound = path_cost(known, slopes)
    corners = _corners(words, known[0], known[-1], slopes, bound)
    side = float(_FINEST)
    while True:
        corners = _best_of_blocks(corners, side)
        if len(corners) <= max_corners:
            break
        side *= max(math.sqrt(len(corners) / max_corners), 1.1)
    points = np.concatenate((known[:1], known[-1:], known[1:-1], corners[:, :3]))
    return _search(words, points, slopes)


def _best_of_blocks(corners: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """Returns the corner with the least way over it, column 3, of each block."""
    blocks = np.floor(corners[:, :3] / side).astype(np.int64)
    names = (blocks[:, 0] << 40) + (blocks[:, 1] << 20) + blocks[:, 2]
    order = np.lexsort((corners[:, 3], names))
    names = names[order]
    first = np.ones(len(names), np.bool_)
    first[1:] = names[1:] != names[:-1]
    return corners[order[first]]


@inlined_kernel
def _edge_bits(words: NDArray[np.uint32], x: int, y: int, w: int) -> Any:
    """Returns the free voxels of a word that lie at a convex edge of something blocked."""
    last = words.shape[2] - 1
    found = np.uint32(0)
    center = words[x, y, w]
    below = (center << np.uint32(1)) | (
        words[x, y, w - 1] >> np.uint32(31) if w > 0 else np.uint32(1)
    )
    above = (center >> np.uint32(1)) | (
        words[x, y, w + 1] << np.uint32(31) if w < last else np.uint32(1) << np.uint32(31)
    )
    for side in range(4):
        i = x + (side % 2 * 2 - 1 if side < 2 else 0)
        j = y + (side % 2 * 2 - 1 if side >= 2 else 0)
        beside = words[i, j, w]
        low = (beside << np.uint32(1)) | (
            words[i, j, w - 1] >> np.uint32(31) if w > 0 else np.uint32(1)
        )
        high = (beside >> np.uint32(1)) | (
            words[i, j, w + 1] << np.uint32(31) if w < last else np.uint32(1) << np.uint32(31)
        )
        # Free beside and below, blocked at the diagonal between them; the same above.
        found |= ~beside & ~below & low
        found |= ~beside & ~above & high
        if side < 2:
            for k in range(2):
                found |= ~beside & ~words[x, y + 2 * k - 1, w] & words[i, y + 2 * k - 1, w]
    return found & ~center


@kernel
def _corners(
    words: NDArray[np.uint32],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    slopes: Slopes,
    bound: float,
) -> NDArray[np.float64]:
    """Returns (m, 4): centres of the corners, and the least length of a way over each."""
    nx, ny, nw = words.shape
    corners = np.empty((1024, 4))
    n = 0
    point = np.empty(3)
    for x in range(1, nx - 1):
        for y in range(1, ny - 1):
            point[0], point[1] = x + 0.5, y + 0.5
            flat = math.hypot(point[0] - start[0], point[1] - start[1])
            if flat + math.hypot(point[0] - goal[0], point[1] - goal[1]) > bound:
                continue
            for w in range(nw):
                found = np.int64(_edge_bits(words, x, y, w))
                z = 32 * w
                while found != 0:
                    if found & 1:
                        point[2] = z + 0.5
                        way = edge_cost(start, point, slopes) + edge_cost(point, goal, slopes)
                        if way <= bound:
                            if n == len(corners):
                                longer = np.empty((2 * n, 4))
                                longer[:n] = corners
                                corners = longer
                            corners[n, :3], corners[n, 3] = point, way
                            n += 1
                    found >>= 1
                    z += 1
    return corners[:n]


@kernel
def _search(
    words: NDArray[np.uint32], points: NDArray[np.float64], slopes: Slopes
) -> NDArray[np.float64]:
    """Returns the shortest path from the first to the second point, over the others."""
    n = len(points)
    costs, parents = np.full(n, np.inf), np.zeros(n, np.int32)
    remaining = np.empty(n)
    closed, refused = np.zeros(n, np.bool_), np.zeros((n, n), np.bool_)
    for k in range(n):
        remaining[k] = edge_cost(points[k], points[1], slopes)
    costs[0] = 0.0
    while True:
        node = _next(costs, remaining, closed)
        if node < 0:
            return points[:0]
        if node != 0 and edge(words, points[parents[node]], points[node], slopes) < 0:
            refused[node, parents[node]] = True
            _find_parent(node, points, slopes, closed, refused, costs, parents)
            continue
        closed[node] = True
        if node == 1:
            return _traced(points, parents)
        for k in range(n):
            if not closed[k]:
                cost = costs[node] + edge_cost(points[node], points[k], slopes)
                if cost < costs[k]:
                    costs[k], parents[k] = cost, node


@inlined_kernel
def _next(
    costs: NDArray[np.float64], remaining: NDArray[np.float64], closed: NDArray[np.bool_]
) -> int:
    """Returns the open node with the least way over it, -1 when there is none."""
    node, best = -1, np.inf
    for k in range(len(costs)):
        if not closed[k] and costs[k] + remaining[k] < best:
            node, best = k, costs[k] + remaining[k]
    return node


@inlined_kernel
def _find_parent(
    node: int,
    points: NDArray[np.float64],
    slopes: Slopes,
    closed: NDArray[np.bool_],
    refused: NDArray[np.bool_],
    costs: NDArray[np.float64],
    parents: NDArray[np.int32],
) -> None:
    """Gives a node the best closed parent that was not refused."""
    costs[node] = np.inf
    for k in range(len(points)):
        if closed[k] and not refused[node, k]:
            cost = costs[k] + edge_cost(points[k], points[node], slopes)
            if cost < costs[node]:
                costs[node], parents[node] = cost, k


@kernel
def _traced(points: NDArray[np.float64], parents: NDArray[np.int32]) -> NDArray[np.float64]:
    n, at = 1, 1
    while at != 0:
        at = parents[at]
        n += 1
    nodes = np.empty((n, 3))
    at = 1
    for k in range(n - 1, -1, -1):
        nodes[k] = points[at]
        at = parents[at]
    return nodes


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    words = np.full((4, 4, 1), 0xFFFFFFF9, np.uint32)
    points = np.array([[1.5, 1.5, 1.5], [2.5, 1.5, 1.5]])
    corner_path(words, points, np.array([1.0, 0.0, 1.0, 0.0]))
