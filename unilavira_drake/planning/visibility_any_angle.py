"""Lazy any-angle search (Nash, Koenig and Tovey 2010, Lazy Theta*) through a window.

A node takes over its neighbour's parent as if it saw it; whether it does is looked up only when
the node is expanded, so there is one line of sight for each expanded node instead of one for each
edge.  Nodes are kept in a table of hashes: a search costs what it touches, however large the
window is.

The way that remains counts ``GREED`` times (Pohl 1970), and the search ends at the first node that
sees the goal: a hundredth of the nodes are expanded, and the path, once shortened, is hardly
longer.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import inlined_kernel, kernel
from unilavira_drake.planning.visibility_lines import Slopes, edge, edge_cost

FOUND, UNREACHABLE, TOO_LARGE = 0, 1, 2

GREED = 1.5


def _boxes() -> NDArray[np.int64]:
    """Returns, for each of 27 steps, the voxels that must be free: bit 9 x + 3 y + z."""
    masks = np.zeros(27, np.int64)
    for step in range(27):
        reach = [
            range(min(d, 0), max(d, 0) + 1)
            for d in (step // 9 - 1, step // 3 % 3 - 1, step % 3 - 1)
        ]
        for x in reach[0]:
            for y in reach[1]:
                for z in reach[2]:
                    masks[step] |= 1 << (9 * (x + 1) + 3 * (y + 1) + z + 1)
    return masks


_BOXES = _boxes()
_CENTER = 13


def any_angle_path(
    words: NDArray[np.uint32],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    slopes: Slopes,
    capacity: int,
) -> tuple[int, NDArray[np.float64]]:
    """Returns whether there is a path, and its (k, 3) nodes from start to goal.

    Args:
        words: blocked bits of a window with a blocked border.
        start: point of the window in a free voxel, voxels.
        goal: likewise.
        slopes: of :func:`slopes_of`.
        capacity: most nodes, a power of two; beyond, the outcome is ``TOO_LARGE``.
    """
    outcome, nodes = _search(words, start, goal, slopes, capacity)
    return int(outcome), nodes


@inlined_kernel
def _slot(table: NDArray[np.int32], cells: NDArray[np.int64], cell: int) -> int:
    """Returns where a cell is, or belongs, in the table."""
    mask = len(table) - 1
    slot = (cell * 0x9E3779B1 >> 7) & mask
    while table[slot] >= 0 and cells[table[slot]] != cell:
        slot = (slot + 1) & mask
    return slot


@inlined_kernel
def _push(
    keys: NDArray[np.float64], heap: NDArray[np.int32], n: int, key: float, node: int
) -> None:
    at = n
    while at > 0:
        up = (at - 1) >> 1
        if keys[up] <= key:
            break
        keys[at], heap[at] = keys[up], heap[up]
        at = up
    keys[at], heap[at] = key, node


@inlined_kernel
def _pop(keys: NDArray[np.float64], heap: NDArray[np.int32], n: int) -> Any:
    """Returns the first node of a heap of n, and leaves a heap of n - 1."""
    node = heap[0]
    key, last = keys[n - 1], heap[n - 1]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= n - 1:
            break
        if child + 1 < n - 1 and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[at], heap[at] = keys[child], heap[child]
        at = child
    keys[at], heap[at] = key, last
    return node


@inlined_kernel
def _free_around(words: NDArray[np.uint32], x: int, y: int, z: int) -> Any:
    """Returns the 27 bits of the free voxels around one."""
    free: Any = 0
    word, shift = z >> 5, z & 31
    for i in range(3):
        for j in range(3):
            bits = np.int64(words[x + i - 1, y + j - 1, word])
            if shift == 0:
                below = np.int64(words[x + i - 1, y + j - 1, word - 1])
                three = (bits << 1 | below >> 31) & 7
            elif shift == 31:
                above = np.int64(words[x + i - 1, y + j - 1, word + 1])
                three = (bits >> 30 | above << 2) & 7
            else:
                three = bits >> (shift - 1) & 7
            free |= (three ^ 7) << (9 * i + 3 * j)
    return free


class Nodes(NamedTuple):
    """What a search knows of each node, the table of their voxels, and the heap of open ones."""

    points: NDArray[np.float64]
    costs: NDArray[np.float64]
    cells: NDArray[np.int64]
    parents: NDArray[np.int32]
    closed: NDArray[np.bool_]
    table: NDArray[np.int32]
    keys: NDArray[np.float64]
    heap: NDArray[np.int32]


@kernel
def _settle(words: NDArray[np.uint32], nodes: Nodes, node: int, near: int, slopes: Slopes) -> bool:
    """Checks the way from a node's parent, takes that from the best neighbour if it is blocked.

    Returns whether there is a way; ``near`` are the 27 bits of free voxels around the node.
    """
    points, costs = nodes.points, nodes.costs
    if edge(words, points[nodes.parents[node]], points[node], slopes) >= 0:
        return True
    across_y, across_x = 32 * words.shape[2], 32 * words.shape[2] * words.shape[1]
    costs[node] = np.inf
    for step in range(27):
        if step == _CENTER or near & _BOXES[step] != _BOXES[step]:
            continue
        shift = (step // 9 - 1) * across_x + (step // 3 % 3 - 1) * across_y + step % 3 - 1
        other = nodes.table[_slot(nodes.table, nodes.cells, nodes.cells[node] + shift)]
        if other < 0 or not nodes.closed[other]:
            continue
        cost = costs[other] + edge_cost(points[other], points[node], slopes)
        if cost < costs[node] and edge(words, points[other], points[node], slopes) >= 0:
            costs[node], nodes.parents[node] = cost, other
    return bool(costs[node] < np.inf)


@inlined_kernel
def _relax(
    nodes: Nodes,
    node: int,
    near: int,
    place: tuple[int, int, int],
    strides: tuple[int, int],
    goal: NDArray[np.float64],
    last: int,
    slopes: Slopes,
    counts: NDArray[np.int64],
) -> None:
    """Offers the free voxels around a node a way over its parent.

    ``counts`` are the nodes known, and those in the heap.
    """
    points, costs, parent = nodes.points, nodes.costs, nodes.parents[node]
    for step in range(27):
        if step == _CENTER or near & _BOXES[step] != _BOXES[step]:
            continue
        sx, sy, sz = step // 9 - 1, step // 3 % 3 - 1, step % 3 - 1
        cell = nodes.cells[node] + sx * strides[0] + sy * strides[1] + sz
        slot = _slot(nodes.table, nodes.cells, cell)
        other: Any = nodes.table[slot]
        if other < 0:
            other = counts[0]
            counts[0] += 1
            nodes.table[slot], nodes.cells[other], costs[other] = other, cell, np.inf
            points[other, 0] = place[0] + sx + 0.5
            points[other, 1] = place[1] + sy + 0.5
            points[other, 2] = place[2] + sz + 0.5
            if cell == last:
                points[other] = goal
        if nodes.closed[other]:
            continue
        cost = costs[parent] + edge_cost(points[parent], points[other], slopes)
        if cost < costs[other]:
            costs[other], nodes.parents[other] = cost, parent
            remaining = GREED * edge_cost(points[other], goal, slopes)
            _push(nodes.keys, nodes.heap, counts[1], cost + remaining, other)
            counts[1] += 1


@kernel
def _search(
    words: NDArray[np.uint32],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    slopes: Slopes,
    capacity: int,
) -> tuple[int, NDArray[np.float64]]:
    if edge(words, start, goal, slopes) >= 0:
        both = np.empty((2, 3))
        both[0], both[1] = start, goal
        return FOUND, both
    ny, nz = words.shape[1], 32 * words.shape[2]
    nodes = Nodes(
        np.empty((capacity, 3)),
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int32),
        np.zeros(capacity, np.bool_),
        np.full(2 * capacity, -1, np.int32),
        np.empty(4 * capacity),
        np.empty(4 * capacity, np.int32),
    )
    first = (math.floor(start[0]) * ny + math.floor(start[1])) * nz + math.floor(start[2])
    last = (math.floor(goal[0]) * ny + math.floor(goal[1])) * nz + math.floor(goal[2])
    nodes.points[0], nodes.costs[0], nodes.cells[0], nodes.parents[0] = start, 0.0, first, 0
    nodes.table[_slot(nodes.table, nodes.cells, first)] = 0
    _push(nodes.keys, nodes.heap, 0, 0.0, 0)
    counts = np.ones(2, np.int64)
    while counts[1] > 0:
        node = _pop(nodes.keys, nodes.heap, counts[1])
        counts[1] -= 1
        if nodes.closed[node]:
            continue
        cell = nodes.cells[node]
        x, y, z = cell // (ny * nz), cell // nz % ny, cell % nz
        near = _free_around(words, x, y, z)
        if node > 0 and not _settle(words, nodes, node, near, slopes):
            continue
        nodes.closed[node] = True
        if cell == last or (node > 0 and edge(words, nodes.points[node], goal, slopes) >= 0):
            return FOUND, _traced(nodes.points, nodes.parents, node, goal)
        if counts[0] + 27 > capacity or counts[1] + 27 > 4 * capacity:
            return TOO_LARGE, nodes.points[:0]
        _relax(nodes, node, near, (x, y, z), (ny * nz, nz), goal, last, slopes, counts)
    return UNREACHABLE, nodes.points[:0]


@kernel
def _traced(
    points: NDArray[np.float64], parents: NDArray[np.int32], node: int, goal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the nodes from the start over a node to the goal."""
    n, at = 2, node
    while at != 0:
        at = parents[at]
        n += 1
    nodes = np.empty((n, 3))
    nodes[n - 1] = goal
    at = node
    for k in range(n - 2, -1, -1):
        nodes[k] = points[at]
        at = parents[at]
    return nodes


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    words = np.full((4, 5, 1), 0xFFFFFFF9, np.uint32)
    any_angle_path(words, np.array([1.5, 1.5, 1.5]), np.array([2.5, 3.5, 1.5]), np.ones(4), 64)
