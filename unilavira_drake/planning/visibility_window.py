"""A box of the world as bits, in which one search takes place, and what can be reached in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.messages import Message
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.planning.visibility_space import BitTiles, Key

MAX_WORDS = 16_000_000
"""A window holds at most so many words of 32 voxels (64 MB)."""

_ALL = np.uint32(0xFFFFFFFF)


@dataclass(frozen=True, eq=False)
class FlightWindow(Message):
    """Blocked voxels of a box; outside of it, everything is."""

    low: tuple[int, int, int] = (0, 0, 0)
    """The voxel of the world that is (0, 0, 0) here; its z is a multiple of 32."""
    resolution: float = 0.5
    words: NDArray[np.uint32] = field(default_factory=lambda: np.full((1, 1, 1), _ALL))
    """(nx, ny, nw) uint32; bit z % 32 of words[x, y, z // 32] is voxel (x, y, z)."""

    def point(self, p_WP: tuple[float, float, float]) -> NDArray[np.float64]:
        """Returns a world point in voxels of the window, (3,) float64."""
        r, (x, y, z), (i, j, k) = self.resolution, p_WP, self.low
        return np.array((x / r - i, y / r - j, z / r - k))

    def world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns points of the window, (..., 3), in the world, metres."""
        p_WP: NDArray[np.float64] = (points + np.array(self.low)) * self.resolution
        return p_WP

    def contains(self, point: NDArray[np.float64]) -> bool:
        """Returns whether a point lies within the window and off its blocked border."""
        nx, ny, nw = self.words.shape
        x, y, z = point.tolist()
        return bool(1 <= x < nx - 1 and 1 <= y < ny - 1 and 1 <= z < TILE * nw - 1)

    def is_blocked(self, point: NDArray[np.float64]) -> bool:
        """Returns whether the voxel of a point is blocked; points outside are."""
        if not self.contains(point):
            return True
        x, y, z = map(math.floor, point.tolist())
        return bool(int(self.words[x, y, z >> 5]) >> (z & 31) & 1)


def make_window(
    tiles: BitTiles,
    *,
    low: tuple[int, int, int],
    high: tuple[int, int, int],
    resolution: float,
    floor: int | None = None,
    ceiling: int | None = None,
) -> FlightWindow:
    """Returns the window of the voxels in [low, high), within a blocked border.

    Args:
        tiles: the bits.
        low: lowest voxel that may be free.
        high: one beyond the highest voxel that may be free.
        resolution: side of a voxel, metres.
        floor: voxels below it are blocked.
        ceiling: it and the voxels above are blocked.

    Raises:
        ValueError: if the window would be too large.
    """
    x0, y0 = low[0] - 1, low[1] - 1
    x1, y1 = max(high[0], low[0]) + 1, max(high[1], low[1]) + 1
    first, last = (low[2] - 1) // TILE, max(high[2], low[2]) // TILE
    if (x1 - x0) * (y1 - y0) * (last - first + 1) > MAX_WORDS:
        raise ValueError("the window is too large")
    words = np.empty((x1 - x0, y1 - y0, last - first + 1), np.uint32)
    bottom = low[2] if floor is None else max(low[2], floor)
    top = high[2] if ceiling is None else min(high[2], ceiling)
    outside = _outside(bottom - first * TILE, top - first * TILE, last - first + 1)
    corner = (x0, y0, first * TILE)
    _assemble(tiles.pool, tiles.directory, tiles.first, corner, outside, words)
    return FlightWindow(corner, resolution, words)


def _outside(bottom: int, top: int, count: int) -> NDArray[np.uint32]:
    """Returns ``count`` words with the bits below ``bottom``, and from ``top`` on."""
    inside = (1 << max(top, 0)) - (1 << min(max(bottom, 0), max(top, 0)))
    mask = (1 << TILE) - 1
    return np.array([~(inside >> (TILE * word)) & mask for word in range(count)], np.uint32)


@kernel
def _assemble(
    pool: NDArray[np.uint32],
    directory: NDArray[np.int32],
    first: Key,
    corner: Key,
    outside: NDArray[np.uint32],
    words: NDArray[np.uint32],
) -> None:
    """Fills the words of a window from the tiles, one tile after the other."""
    nx, ny, nw = words.shape
    x = 0
    while x < nx:
        a, i = ((x + corner[0]) >> 5) - first[0], (x + corner[0]) & 31
        deep = min(TILE - i, nx - x)
        y = 0
        while y < ny:
            b, j = ((y + corner[1]) >> 5) - first[1], (y + corner[1]) & 31
            wide = min(TILE - j, ny - y)
            for w in range(nw):
                c = w + (corner[2] >> 5) - first[2]
                known = 0 <= a < directory.shape[0] and 0 <= b < directory.shape[1]
                known = known and 0 <= c < directory.shape[2]
                tile = directory[a, b, c] if known else 0
                for k in range(deep):
                    for m in range(wide):
                        words[x + k, y + m, w] = pool[tile, i + k, j + m] | outside[w]
            y += wide
        x += deep
    words[0], words[nx - 1] = _ALL, _ALL
    words[:, 0], words[:, ny - 1] = _ALL, _ALL


def reachable(window: FlightWindow, point: NDArray[np.float64]) -> FlightWindow:
    """Returns a window in which all voxels are blocked that cannot be reached from a point.

    Without cutting corners, the voxels that a step over an edge or corner reaches are those that
    steps over faces reach.  All are blocked when the point's voxel is.
    """
    words = np.full(window.words.shape, _ALL)
    if not window.is_blocked(point):
        x, y, z = (math.floor(value) for value in point)
        _flood(window.words, x, y, z, words)
    return FlightWindow(window.low, window.resolution, words)


@kernel
def _flood(free: NDArray[np.uint32], x: int, y: int, z: int, unreached: NDArray[np.uint32]) -> None:
    """Clears the bits of all voxels connected with one, a word at a time."""
    nx, ny, nw = free.shape
    queue = np.empty(nx * ny * nw + 1, np.int64)
    queued = np.zeros(nx * ny * nw, np.bool_)
    unreached[x, y, z >> 5] &= ~(np.uint32(1) << np.uint32(z & 31))
    queue[0] = (x * ny + y) * nw + (z >> 5)
    queued[queue[0]] = True
    head, tail = 0, 1
    while head != tail:
        at = queue[head]
        head = (head + 1) % len(queue)
        queued[at] = False
        i, j, k = at // (ny * nw), at // nw % ny, at % nw
        open_bits = ~free[i, j, k]
        reached = _filled(~unreached[i, j, k] & open_bits, open_bits)
        unreached[i, j, k] = ~reached
        for side in range(6):
            a, b, c = i, j, k
            entering = reached
            if side < 2:
                a += 2 * side - 1
            elif side < 4:
                b += 2 * side - 5
            elif side == 4:
                c -= 1
                entering = np.uint32((reached & np.uint32(1)) << np.uint32(31))
            else:
                c += 1
                entering = np.uint32(reached >> np.uint32(31))
            if a < 0 or a >= nx or b < 0 or b >= ny or c < 0 or c >= nw:
                continue
            fresh = entering & ~free[a, b, c] & unreached[a, b, c]
            if fresh == 0:
                continue
            unreached[a, b, c] &= ~fresh
            other = (a * ny + b) * nw + c
            if not queued[other]:
                queued[other] = True
                queue[tail] = other
                tail = (tail + 1) % len(queue)


@kernel
def _filled(seeds: np.uint32, open_bits: np.uint32) -> np.uint32:
    """Returns the open bits connected with the seeds."""
    while True:
        wider = seeds
        wider |= (seeds << np.uint32(1)) & open_bits
        wider |= (seeds >> np.uint32(1)) & open_bits
        if wider == seeds:
            return seeds
        seeds = wider


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    window = make_window(BitTiles(), low=(0, 0, 0), high=(2, 2, 2), resolution=1.0)
    reachable(window, window.point((0.5, 0.5, 0.5)))
