"""Plain compiled peers of flight planning, and exact depth images of a grid."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

compiled: Any = numba.njit(cache=True, error_model="numpy")


@compiled
def push(keys, heap, n, key, node):
    """Adds a node to a binary heap of n."""
    at = n
    while at > 0:
        up = (at - 1) >> 1
        if keys[up] <= key:
            break
        keys[at], heap[at] = keys[up], heap[up]
        at = up
    keys[at], heap[at] = key, node


@compiled
def pop(keys, heap, n):
    """Takes the first node from a binary heap of n."""
    first, key, last, at = heap[0], keys[n - 1], heap[n - 1], 0
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
    return first


@compiled
def steps_of(ny, nz):
    """Returns the 26 steps in a flat grid, and their lengths."""
    steps, lengths = np.empty(26, np.int64), np.empty(26, np.float32)
    n = 0
    for dx in range(-1, 2):
        for dy in range(-1, 2):
            for dz in range(-1, 2):
                if dx != 0 or dy != 0 or dz != 0:
                    steps[n] = (dx * ny + dy) * nz + dz
                    lengths[n] = math.sqrt(dx * dx + dy * dy + dz * dz)
                    n += 1
    return steps, lengths


def workspace(size):
    """Returns the arrays of A* on a grid of so many voxels, to be used again by each search.

    So the peer does not pay for fresh memory.
    """
    return (
        np.empty(size, np.float32),
        np.empty(size, np.int32),
        np.empty(size, np.bool_),
        np.empty(4 * size, np.float32),
        np.empty(4 * size, np.int32),
    )


@compiled
def a_star(blocked, start, goal, arrays):
    """Returns the length of the shortest path over 26 neighbours, in voxels."""
    _, ny, nz = blocked.shape
    flat = blocked.ravel()
    costs, parents, closed, keys, heap = arrays
    costs[:] = np.inf
    parents[:] = -1
    closed[:] = False
    steps, lengths = steps_of(ny, nz)
    first = (start[0] * ny + start[1]) * nz + start[2]
    last = (goal[0] * ny + goal[1]) * nz + goal[2]
    two, three = math.sqrt(2.0) - 1.0, math.sqrt(3.0) - math.sqrt(2.0)
    costs[first] = 0.0
    push(keys, heap, 0, np.float32(0.0), first)
    n = 1
    while n > 0:
        node = pop(keys, heap, n)
        n -= 1
        if closed[node]:
            continue
        closed[node] = True
        if node == last:
            break
        for k in range(26):
            other = node + steps[k]
            cost = costs[node] + lengths[k]
            if flat[other] or closed[other] or cost >= costs[other]:
                continue
            costs[other], parents[other] = cost, node
            x = abs(other // (ny * nz) - goal[0])
            y = abs(other // nz % ny - goal[1])
            z = abs(other % nz - goal[2])
            high, low = max(x, y, z), min(x, y, z)
            octile = high + two * (x + y + z - high - low) + three * low
            push(keys, heap, n, np.float32(cost + octile), other)
            n += 1
    return costs[last]


@compiled
def sees(blocked, ax, ay, az, bx, by, bz):
    """Returns whether a line between the centres of two voxels meets no blocked one."""
    dx, dy, dz = bx - ax, by - ay, bz - az
    steps = 4 * max(abs(dx), abs(dy), abs(dz))
    for k in range(1, steps):
        t = k / steps
        x, y, z = ax + t * dx, ay + t * dy, az + t * dz
        if blocked[math.floor(x + 0.5), math.floor(y + 0.5), math.floor(z + 0.5)]:
            return False
    return True


@compiled
def traced(parents, first, last, ny, nz):
    """Returns the (k, 3) voxels from the first to the last."""
    count, at = 1, last
    while at != first:
        at = parents[at]
        count += 1
    nodes = np.empty((count, 3), np.int64)
    at = last
    for k in range(count - 1, -1, -1):
        nodes[k, 0], nodes[k, 1], nodes[k, 2] = at // (ny * nz), at // nz % ny, at % nz
        at = parents[at]
    return nodes


@compiled
def theta_star(blocked, start, goal):
    """Returns the (k, 3) voxels of an eager Theta* path without greed (Nash et al. 2007)."""
    _, ny, nz = blocked.shape
    flat = blocked.ravel()
    costs = np.full(flat.size, np.inf, np.float64)
    parents = np.full(flat.size, -1, np.int64)
    closed = np.zeros(flat.size, np.bool_)
    steps, lengths = steps_of(ny, nz)
    first = (start[0] * ny + start[1]) * nz + start[2]
    last = (goal[0] * ny + goal[1]) * nz + goal[2]
    keys, heap = np.empty(1 << 23, np.float64), np.empty(1 << 23, np.int64)
    costs[first], parents[first] = 0.0, first
    push(keys, heap, 0, 0.0, first)
    n = 1
    while n > 0:
        node = pop(keys, heap, n)
        n -= 1
        if closed[node]:
            continue
        closed[node] = True
        if node == last:
            break
        up = parents[node]
        px, py, pz = up // (ny * nz), up // nz % ny, up % nz
        for k in range(26):
            other = node + steps[k]
            if flat[other] or closed[other]:
                continue
            x, y, z = other // (ny * nz), other // nz % ny, other % nz
            straight = math.sqrt((x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2)
            cost, parent = costs[up] + straight, up
            if cost >= costs[other]:
                continue
            if not sees(blocked, px, py, pz, x, y, z):
                cost, parent = costs[node] + lengths[k], node
            if cost < costs[other]:
                costs[other], parents[other] = cost, parent
                left = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2 + (z - goal[2]) ** 2)
                push(keys, heap, n, cost + left, other)
                n += 1
    return traced(parents, first, last, ny, nz)


@compiled
def cast(truth, rays, p, lens, rows, columns, far):
    """Returns the (H, W) depth image of the occupied voxels, inf where nothing is hit."""
    depth = np.full((rows, columns), np.inf, np.float32)
    at, border, per = np.empty(3, np.int64), np.empty(3), np.empty(3)
    for v in range(rows):
        for u in range(columns):
            x, y = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
            for k in range(3):
                d = rays[k, 0] * x + rays[k, 1] * y + rays[k, 2]
                at[k] = math.floor(p[k])
                per[k] = 1.0 / d if d != 0.0 else np.inf
                edge = at[k] + 1 - p[k] if d > 0.0 else at[k] - p[k]
                border[k] = edge * per[k] if d != 0.0 else np.inf
            t = 0.0
            while t <= far:
                if (
                    min(at) < 0
                    or at[0] >= truth.shape[0]
                    or at[1] >= truth.shape[1]
                    or at[2] >= truth.shape[2]
                ):
                    break
                if truth[at[0], at[1], at[2]]:
                    depth[v, u] = t
                    break
                k = int(np.argmin(border))
                t = border[k]
                at[k] += 1 if per[k] > 0.0 else -1
                border[k] += abs(per[k])
    return depth
