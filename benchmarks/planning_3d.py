"""CPU of mapping and planning in 3-D: voxels and flight plans beside their peers.

    python benchmarks/planning_3d.py [--pairs 30] [--seeds 3]

Prints one JSON object a line.  The world is 200 x 200 x 60 voxels of 0.5 m, 15 % of them occupied
by buildings and boxes in the air.  Ours and the peer take the same task in turn in one process, in
changing order, with one thread each; the value is the median of the ratio of their CPU times.

Peers: scikit-fmm's first-order field over the whole grid; a plain A* over 26 neighbours compiled
with numba (octile distance, binary heap, flat arrays that are used again); both on voxels that are
inflated already.  OctoMap by octomap-python and by pyoctomap, with the making of the points.  The
any-angle optimum is the best of an eager Theta* without greed and of all paths found, each pulled
straight.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import os
import statistics
from collections.abc import Callable
from typing import Any

# The peers' threads would wait for each other at our expense: one for all.
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
import octomap
import pyoctomap
import skfmm
from cost import cpu_ms
from numpy.typing import NDArray
from planning_3d_peers import a_star, cast, theta_star, workspace

from unilavira_drake.mapping import voxels_carving
from unilavira_drake.mapping.occupancy import DepthView
from unilavira_drake.mapping.voxels import VoxelParameters, integrate_voxels
from unilavira_drake.messages import Intrinsics, VoxelMap
from unilavira_drake.planning.visibility import (
    FlightParameters,
    FlightPlan,
    make_flight_plan,
    warm_up,
)
from unilavira_drake.planning.visibility_lines import slopes_of
from unilavira_drake.planning.visibility_path import shorten
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space
from unilavira_drake.planning.visibility_window import FlightWindow, make_window

SHAPE = (200, 200, 60)
RESOLUTION = 0.5
LENS = Intrinsics(640, 480, 388.0, 388.0, 319.5, 239.5)
RANGE = 40.0
SIZE = Clearance(0.5, 0.5, 0.5)


def row(id_: str, what: str, value: float, unit: str, **more: Any) -> None:
    """Prints one line; without a target it is information."""
    target, sense = more.pop("target", None), more.pop("sense", ">=")
    ok = None
    if target is not None:
        ok = value <= target if sense == "<=" else value >= target
    line = {"id": id_, "what": what, "value": round(value, 5), "target": target}
    line["sense"] = sense if target is not None else None
    print(json.dumps({**line, "unit": unit, "ok": ok, **more}), flush=True)


def ratios(
    id_: str, what: str, target: float | None, tasks: list[tuple[Callable[[], Any], ...]]
) -> None:
    """Prints by how much the first of each two tasks is cheaper than the second."""
    spent: list[list[float]] = []
    for index, task in enumerate(tasks):
        order = (0, 1) if index % 2 else (1, 0)
        took = {which: cpu_ms(task[which]) for which in order}
        spent.append([took[0], took[1]])
    quotients = sorted(peer / ours for ours, peer in spent)
    ours, peer = (statistics.median(column) for column in zip(*spent, strict=True))
    row(id_, what, statistics.median(quotients), "x", target=target,
        p10=round(quotients[len(quotients) // 10], 2), n=len(quotients),
        ours_ms=round(ours, 3), peer_ms=round(peer, 3))  # fmt: skip


class World:
    """A random town as a grid, as our map, and as where an aircraft may fly."""

    def __init__(self, seed: int, share: float = 0.15) -> None:
        rng = np.random.default_rng(seed)
        self.truth = np.zeros(SHAPE, np.bool_)
        self.truth[:, :, 0] = True
        while self.truth.mean() < share:
            dx, dy = (int(value) for value in rng.integers(6, 24, 2))
            x, y = (int(rng.integers(0, SHAPE[axis] - d)) for axis, d in ((0, dx), (1, dy)))
            z = 0 if rng.random() < 0.75 else int(rng.integers(0, 52))
            self.truth[x : x + dx, y : y + dy, z : z + int(rng.integers(10, 56))] = True
        tiles = {}
        for key in np.ndindex(7, 7, 2):
            tile = np.zeros((32, 32, 32), np.int8)
            a, b, c = (32 * k for k in key)
            part = self.truth[a : a + 32, b : b + 32, c : c + 32]
            tile[tuple(map(slice, part.shape))] = np.where(part, 20, -20)
            tiles[key[0], key[1], key[2]] = tile
        self.voxels = VoxelMap(n=1, version=1, resolution=RESOLUTION, tiles=tiles)
        self.space = update_space(FlightSpace(clearance=SIZE), self.voxels)
        self.parameters = FlightParameters(
            clearance=SIZE, min_altitude=0.0, max_altitude=RESOLUTION * SHAPE[2]
        )
        self.window = make_window(
            self.space.blocked, low=(0, 0, 0), high=SHAPE, resolution=RESOLUTION
        )
        # The peers' grid: the same voxels, with a blocked border.
        bits = (self.window.words[..., None] >> np.arange(32, dtype=np.uint32)) & 1 != 0
        grid = bits.reshape(*bits.shape[:2], -1)[:, :, 31 : 33 + SHAPE[2]]
        self.blocked: NDArray[np.bool_] = np.ascontiguousarray(grid)
        self.free = np.argwhere(~self.blocked)

    def plan(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> FlightPlan:
        """Returns our plan between two voxels of the peers' grid."""
        start, goal = ((p - 0.5) * RESOLUTION for p in (a, b))
        place = (float(start[0]), float(start[1]), float(start[2]))
        found = make_flight_plan(
            self.space,
            position=place,
            target=(float(goal[0]), float(goal[1]), float(goal[2])),
            viewpoint=place,
            parameters=self.parameters,
        )
        assert not found.reason, found.reason
        return found

    def pairs(
        self, count: int, metres: float, rng: np.random.Generator, hidden: bool
    ) -> list[NDArray[np.int64]]:
        """Returns free voxels about so far from each other, and if asked not in sight."""
        found: list[NDArray[np.int64]] = []
        while len(found) < count:
            a, b = self.free[rng.integers(len(self.free), size=2)]
            if abs(np.linalg.norm(a - b) * RESOLUTION - metres) > 1.0:
                continue
            if hidden and len(self.plan(a, b).p_WP) == 2:
                continue
            found.append(np.stack((a, b)))
        return found

    def corners(self) -> list[NDArray[np.int64]]:
        """Returns the four diagonals of the grid, each end at the nearest free voxel."""
        x, y, z = SHAPE
        ends = [((2, 2, 3), (x - 3, y - 3, z - 3)), ((2, y - 3, 3), (x - 3, 2, z - 3))]
        ends += [((2, 2, z - 3), (x - 3, y - 3, 3)), ((2, y - 3, z - 3), (x - 3, 2, 3))]
        return [
            np.stack([self.free[np.abs(self.free - p).sum(axis=1).argmin()] for p in pair])
            for pair in ends
        ]


def field(world: World, goal: NDArray[np.int64]) -> Any:
    """Scikit-fmm's field over the whole grid."""
    phi = np.ones(world.blocked.shape)
    phi[tuple(goal)] = -1.0
    return skfmm.distance(np.ma.MaskedArray(phi, world.blocked), order=1)


def planning(worlds: list[World], count: int) -> None:
    """Prints the cost of a plan to a goal at 30 m."""
    rng = np.random.default_rng(0)
    arrays = workspace(worlds[0].blocked.size)
    for id_, hidden, what in (
        ("T6", False, "plan to a goal at 30 m, in sight or not"),
        ("T6.hidden", True, "plan to a goal at 30 m that is not in sight"),
    ):
        tasks_a, tasks_f = [], []
        for world in worlds:
            for a, b in world.pairs(count, 30.0, rng, hidden):
                ours = functools.partial(world.plan, a, b)
                tasks_a.append((ours, functools.partial(a_star, world.blocked, a, b, arrays)))
                tasks_f.append((ours, functools.partial(field, world, b)))
        ratios(f"{id_}.a_star", f"{what} / plain compiled A*", 4.0, tasks_a)
        ratios(
            f"{id_}.skfmm", f"{what} / scikit-fmm's field", 100.0, tasks_f[:: max(count // 10, 1)]
        )


def straightened(window: FlightWindow, nodes: NDArray[np.float64]) -> float:
    """Returns the length of a path pulled straight by our own means, voxels."""
    points = shorten(window.words, nodes, slopes_of(math.pi / 2, math.pi / 2), 50)
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def lengths(worlds: list[World]) -> None:
    """Prints how much longer than the any-angle optimum paths from corner to corner are."""
    excess, over_straight, spent, peer = [], [], [], []
    offset = np.array([0.5, 0.5, 31.5])
    for world in worlds:
        for a, b in world.corners():
            world.plan(a, b)
            spent.append(cpu_ms(functools.partial(world.plan, a, b)))
            ours = world.plan(a, b).length / RESOLUTION
            peer.append(cpu_ms(functools.partial(theta_star, world.blocked, a, b)))
            nodes = theta_star(world.blocked, a, b) + 0.0
            theta = float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum())
            best = min(theta, ours, straightened(world.window, nodes + offset))
            excess.append(ours / best - 1.0)
            over_straight.append(ours / float(np.linalg.norm(b - a)) - 1.0)
    row("T6.length", "corner to corner, longer than the any-angle optimum, worst", max(excess), "1",
        target=0.05, sense="<=", mean=round(statistics.mean(excess), 5), n=len(excess),
        over_straight_mean=round(statistics.mean(over_straight), 5),
        ours_ms=round(statistics.median(spent), 2),
        eager_theta_star_ms=round(statistics.median(peer), 1))  # fmt: skip


def frames(world: World, count: int) -> list[DepthView]:
    """Returns depth images from free places, looking around and a little down."""
    rng = np.random.default_rng(4)
    views = []
    while len(views) < count:
        p = rng.uniform((10, 10, 6), (190, 190, 40))
        if world.truth[tuple(p.astype(int))]:
            continue
        yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 0.3)
        c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
        level = np.array([[s, 0.0, c], [-c, 0.0, s], [0.0, -1.0, 0.0]])
        X_WC = np.eye(4)
        X_WC[:3, :3] = level @ np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
        X_WC[:3, 3] = p * RESOLUTION
        rays = np.ascontiguousarray(X_WC[:3, :3] / RESOLUTION)
        numbers = (LENS.fx, LENS.fy, LENS.cx, LENS.cy)
        depth = cast(world.truth, rays, p, numbers, LENS.height, LENS.width, 1.5 * RANGE)
        if np.isfinite(depth).mean() > 0.5:
            views.append(DepthView(depth, LENS, X_WC))
    return views


def points_of(view: DepthView, stride: int) -> NDArray[np.float64]:
    """Returns (m, 3) the points behind every ``stride``-th pixel, metres in the world."""
    first = stride // 2
    d = view.depth[first::stride, first::stride].astype(np.float64)
    v, u = np.mgrid[first : LENS.height : stride, first : LENS.width : stride]
    known = np.isfinite(d)
    d, u, v = d[known], u[known], v[known]
    p = np.stack(((u - LENS.cx) / LENS.fx * d, (v - LENS.cy) / LENS.fy * d, d), axis=1)
    found: NDArray[np.float64] = p @ view.X_WC[:3, :3].T + view.X_WC[:3, 3]
    return found


def mapping(world: World, count: int) -> None:
    """Prints the cost of taking in a depth image, and of what the planner makes of it."""
    views = frames(world, count)
    for stride, target in ((4, 3.0), (2, None), (1, None)):
        parameters = VoxelParameters(resolution=RESOLUTION, max_range=RANGE, stride=stride)
        for peer, tree in (
            ("octomap-python", octomap.OcTree(RESOLUTION)),
            ("pyoctomap", pyoctomap.OcTree(RESOLUTION)),
        ):
            maps = [VoxelMap(resolution=RESOLUTION)]

            def ours(view: DepthView, maps: Any = maps, parameters: Any = parameters) -> None:
                maps.append(integrate_voxels(maps[-1], [view], parameters=parameters, n=0, time=0))

            def theirs(view: DepthView, tree: Any = tree, stride: int = stride) -> None:
                origin = np.ascontiguousarray(view.X_WC[:3, 3])
                tree.insertPointCloud(points_of(view, stride), origin, RANGE)

            tasks = [(functools.partial(ours, v), functools.partial(theirs, v)) for v in views]
            ratios(f"T6.voxels.{stride}.{peer}",
                   f"a 640x480 depth image at stride {stride} / {peer}", target, tasks)  # fmt: skip
    spaces = [FlightSpace(clearance=SIZE)]
    spent = []
    for voxels in maps[1:]:
        spent.append(cpu_ms(functools.partial(update_space, spaces[-1], voxels)))
        spaces.append(update_space(spaces[-1], voxels))
    row("T6.space", "inflation after a depth image, new places", statistics.median(spent), "ms")


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=30, help="plans in each world")
    parser.add_argument("--seeds", type=int, default=3, help="worlds")
    arguments = parser.parse_args()
    warm_up()
    voxels_carving.warm_up()
    worlds = [World(seed) for seed in range(1, arguments.seeds + 1)]
    a, b = worlds[0].pairs(1, 10.0, np.random.default_rng(0), False)[0]
    a_star(worlds[0].blocked, a, b, workspace(worlds[0].blocked.size))
    theta_star(worlds[0].blocked, a, b)
    planning(worlds, arguments.pairs)
    lengths(worlds)
    mapping(worlds[0], max(arguments.pairs, 20))


if __name__ == "__main__":
    main()
