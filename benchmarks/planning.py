"""CPU of planning on the floor, and how good its paths are: fields, paths and whole episodes.

    python benchmarks/planning.py [--tasks 10] [--worlds 200] [--episodes fridge,storage,...]

Prints one JSON object a line; without a target it is information.

* T1 to T3: distance fields on random floors of 5 cm, beside scikit-fmm.  Ours and the peer take
  the same task in turn in one process, in changing order; the value is the median of the ratio of
  their CPU times.  Near goals are 4 to 5 m away by the way there.  The peer does not pay for its
  input; its narrow band is the least one that holds the robot.
* T4: paths on floors inflated by the robot's radius, beside the exact shortest way: a visibility
  graph over the corners of the blocked cells, with sight tested in whole numbers.
* T7: the planner and the controller in whole episodes of ``apartment`` with the model ``rules``.
  Counted is the CPU of each poll of the planner that made a plan, with all its reading of ports,
  and of the controller's next update, which follows the new path.  Polls that plan nothing, and
  the controller's other updates, are shown apart.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import json
import math
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from unittest import mock

import numpy as np
import skfmm
from chosen import names_among
from cost import cpu_ms
from numpy.typing import NDArray
from planning_peers import UNIT, blocked_hops, exact_geodesic, floor_plan
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning import system as planning_system
from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.planning.navigation_grid import NavigationGrid, make_navigation_grid
from unilavira_drake.planning.plan import PlanningParameters, make_plan, warm_up
from unilavira_drake.planning.polyline import extract_path, length
from unilavira_drake.planning.system import FastMarchingPlanner
from unilavira_drake.ports import Level
from unilavira_drake.robots.ground_controller import GroundTrackingController

RESOLUTION = 0.05
SEEDS = (1, 2, 3)
NEAR = (4.0, 5.0)
"""Metres to a near goal."""
ROBOT = PlanningParameters()
EPISODES = "fridge,bathtub,piano,desk,television,storage,blue_sofa,armchair,washing_machine"


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


def grid_of(taken: NDArray[np.bool_]) -> NavigationGrid:
    """Returns where the robot may drive on a floor that is known all over."""
    # A robot in a narrow place would open a way out of it.
    row, column = np.unravel_index(distance_transform_edt(~taken).argmax(), taken.shape)
    log_odds = np.where(taken, 20, -20).astype(np.int8)
    occupancy = OccupancyMap(n=1, version=1, resolution=RESOLUTION, log_odds=log_odds)
    grid = make_navigation_grid(
        occupancy,
        position=((column + 0.5) * RESOLUTION, (row + 0.5) * RESOLUTION),
        targets=(),
        radius=ROBOT.radius,
        turning_radius=ROBOT.turning_radius,
    )
    # Without the margin around the outer wall, which nobody reaches.
    rows, columns = ((n - m) // 2 for n, m in zip(grid.blocked.shape, taken.shape, strict=True))
    inner = np.s_[rows : rows + taken.shape[0], columns : columns + taken.shape[1]]
    names = ("log_odds", "clearance", "blocked", "slowness")
    arrays = {name: np.ascontiguousarray(getattr(grid, name)[inner]) for name in names}
    return NavigationGrid(RESOLUTION, (0.0, 0.0), **arrays)


class Task:
    """A floor, a goal and robots at some distance of it by the way there."""

    def __init__(self, blocked: NDArray[np.bool_], rng: np.random.Generator) -> None:
        self.blocked = blocked
        free = np.argwhere(~blocked)
        while True:
            self.goal = free[rng.integers(len(free))]
            self.field = distance_field(blocked, self.goal[None])
            # Not in a pocket.
            if np.isfinite(self.field).sum() > 0.5 * len(free):
                break
        low, high = (metres / RESOLUTION for metres in NEAR)
        near = np.argwhere((self.field >= low) & (self.field <= high))
        row, column = near[rng.integers(len(near))]
        self.robot = (int(row), int(column))
        phi = np.ones(blocked.shape)
        phi[tuple(self.goal)] = 0.0
        self.phi = np.ma.MaskedArray(phi, blocked)
        # Any slowness in its range costs the same.
        self.slowness = rng.uniform(1.0, 3.0, blocked.shape).astype(np.float32)

    def ours(self, *, near: bool, weighted: bool = False) -> Any:
        """Our field; as far as the robot if the goal is near."""
        return distance_field(
            self.blocked,
            self.goal[None],
            slowness=self.slowness if weighted else None,
            stop=self.robot if near else None,
        )

    def call(self, **which: bool) -> Callable[[], Any]:
        """Returns our call, to be measured."""
        return functools.partial(self.ours, **which)

    def full(self, order: int = 2) -> Any:
        """The peer's field over the whole grid."""
        return skfmm.distance(self.phi, order=order)

    def narrow(self) -> Any:
        """The peer's field in the least band that holds the robot."""
        return skfmm.distance(self.phi, narrow=float(self.field[self.robot]) + 1.0)

    def weighted(self) -> Any:
        """The peer's field over the whole grid, with a cost for each cell."""
        return skfmm.travel_time(self.phi, 1.0 / self.slowness)

    def errors(self) -> tuple[float, float]:
        """Returns the largest difference to scikit-fmm's order 1: cells, and relative."""
        peer = np.ma.filled(self.full(order=1), np.inf)
        reached = np.isfinite(self.field) & (self.field > 0.0)
        error = np.abs(self.field - peer)[reached]
        return float(error.max()), float((error / peer[reached]).max())


def fields(count: int) -> None:
    """Prints T1 to T3."""
    rng = np.random.default_rng(0)
    for size, near, target, near_targets in (
        (480, "T2", 4.0, (40.0, 10.0)),
        (960, "T3", None, (150.0, 25.0)),
    ):
        floors = [floor_plan(seed, size) for seed in SEEDS]
        tasks = [Task(floor, rng) for floor in floors for _ in range(count)]
        tasks[0].ours(near=True, weighted=True)
        whole = [(t.call(near=False), t.full) for t in tasks]
        full = [(t.call(near=True), t.full) for t in tasks]
        narrow = [(t.call(near=True), t.narrow) for t in tasks]
        weighted = [(t.call(near=True, weighted=True), t.weighted) for t in tasks]
        what = f"{size} x {size}: near field"
        ratios("T1" if size == 480 else "T1.large",
               f"{size} x {size}: whole field / scikit-fmm, order 2", target, whole)  # fmt: skip
        ratios(f"{near}.full", f"{what} / whole field of scikit-fmm", near_targets[0], full)
        ratios(f"{near}.narrow", f"{what} / narrow band of scikit-fmm", near_targets[1], narrow)
        ratios(
            f"{near}.weighted", f"{what} with a cost for each cell / scikit-fmm's", None, weighted
        )
        errors, shares = zip(*(task.errors() for task in tasks), strict=True)
        row("T1.error" if size == 480 else "T1.error.large",
            f"{size} x {size}: largest difference to scikit-fmm's field of order 1",
            max(errors), "cells", target=1e-3 if size == 480 else None, sense="<=",
            median=round(statistics.median(errors), 6), share=float(f"{max(shares):.2g}"),
            farthest_cells=round(max(float(t.field[np.isfinite(t.field)].max()) for t in tasks)),
            n=len(tasks), free=round(1.0 - float(np.mean(floors)), 3))  # fmt: skip


class Way:
    """A random floor, and our path between two of its cells, with and without clearance cost."""

    def __init__(self, seed: int, size: int) -> None:
        rng = np.random.default_rng(seed)
        taken = floor_plan(seed, size)
        grid = grid_of(taken)
        self.blocked = grid.blocked
        free = np.argwhere(~grid.blocked)
        reached: NDArray[np.int64] = np.zeros((0, 2), np.int64)
        # A goal in a pocket is drawn anew; the start is at least 1 m away.
        while len(reached) < 500:
            cell = free[rng.integers(len(free))]
            times = distance_field(grid.blocked, cell[None])
            reached = np.argwhere(np.isfinite(times) & (times * RESOLUTION >= 1.0))
        start = reached[rng.integers(len(reached))] + rng.integers(1, UNIT, 2) / UNIT
        self.start, self.goal = (start[1], start[0]), (cell[1] + 0.5, cell[0] + 0.5)
        ones = np.ones(grid.blocked.shape, np.float32)
        self.path = extract_path(times, grid.blocked, ones, self.start)
        times = distance_field(grid.blocked, cell[None], slowness=grid.slowness)
        self.cautious = extract_path(times, grid.blocked, grid.slowness, self.start)
        self.obstacles = KDTree(np.argwhere(taken)[:, ::-1] + 0.5)

    def exact(self) -> float:
        """Returns the length of the shortest way, cells."""
        return exact_geodesic(self.blocked, self.start, self.goal, length(self.path))

    def clearance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns distances from a path to what is occupied, metres, four times a cell."""
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
        at = np.linspace(0.0, along[-1], max(int(4 * along[-1]), 2))
        samples = np.stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)], axis=1)
        found: NDArray[np.float64] = (self.obstacles.query(samples)[0] - 0.5) * RESOLUTION
        return found


def paths(worlds: int) -> None:
    """Prints T4."""
    ways = [Way(seed, 480) for seed in range(worlds)]
    exact = [way.exact() for way in ways]
    excess = [length(way.path) / best - 1.0 for way, best in zip(ways, exact, strict=True)]
    row("T4.mean", "path over the exact shortest way, without clearance cost, mean",
        statistics.mean(excess), "1", target=0.01, sense="<=", n=worlds,
        p95=round(float(np.percentile(excess, 95)), 5),
        length_m=round(statistics.median(exact) * RESOLUTION, 2))  # fmt: skip
    row("T4.max", "the same, worst", max(excess), "1", target=0.03, sense="<=", n=worlds,
        seed=int(np.argmax(excess)))  # fmt: skip
    hops = sum(len(way.path) + len(way.cautious) - 2 for way in ways)
    blocked = sum(
        blocked_hops(way.blocked, points) for way in ways for points in (way.path, way.cautious)
    )
    row("T4.blocked", "hops that enter a blocked cell, with and without clearance cost", blocked,
        "1", target=0, sense="<=", n=hops)  # fmt: skip
    for id_, cost, name in (("off", "without", "path"), ("on", "with", "cautious")):
        found = [way.clearance(getattr(way, name)) for way in ways]
        longer = [length(getattr(way, name)) / best for way, best in zip(ways, exact, strict=True)]
        row(f"T4.clearance.{id_}", f"least clearance of a path {cost} clearance cost",
            min(float(c.min()) for c in found), "m",
            least_mean=round(statistics.mean(float(c.min()) for c in found), 3),
            mean_along=round(statistics.mean(float(c.mean()) for c in found), 3),
            longer_mean=round(statistics.mean(longer) - 1.0, 4))  # fmt: skip


class Watch:
    """CPU milliseconds of planner and controller by kind; plans come with the goal's distance."""

    def __init__(self) -> None:
        self.plans: list[tuple[float, float]] = []
        self.spent: defaultdict[str, list[float]] = defaultdict(list)
        self._distance: float | None = None
        self._pending: tuple[float, float] | None = None

    def plan(self, occupancy: OccupancyMap, **named: Any) -> Any:
        """Makes a plan, and notes how far away its goal is."""
        self._distance = math.dist(named["position"], named.get("goal") or named["target"])
        return make_plan(occupancy, **named)

    def tick(self, original: Callable[..., Any]) -> Callable[..., Any]:
        """Returns the poll of a Level; the planner's is measured."""

        def call(level: Any, *args: Any) -> Any:
            if not isinstance(level, FastMarchingPlanner):
                return original(level, *args)
            self._distance = None
            begin = time.thread_time()
            result = original(level, *args)
            took = 1e3 * (time.thread_time() - begin)
            if self._distance is None:
                self.spent["idle"].append(took)
            else:
                self._pending = (self._distance, took)
            return result

        return call

    def update(self, original: Callable[..., Any]) -> Callable[..., Any]:
        """Returns the controller's update, measured; the first after a plan belongs to it."""

        def call(controller: Any, *args: Any) -> Any:
            begin = time.thread_time()
            result = original(controller, *args)
            took = 1e3 * (time.thread_time() - begin)
            self.spent["control"].append(took)
            if self._pending is not None:
                distance, planning = self._pending
                self.plans.append((distance, planning + took))
                self._pending = None
            return result

        return call


@contextlib.contextmanager
def watching(watch: Watch) -> Iterator[None]:
    """Watches the planner and the controller of the episodes that run inside."""
    controller = GroundTrackingController
    with (
        mock.patch.object(planning_system, "make_plan", watch.plan),
        mock.patch.object(Level, "_tick", watch.tick(Level._tick)),
        mock.patch.object(controller, "_update", watch.update(controller._update)),
    ):
        yield


def percentiles(values: Sequence[float]) -> tuple[float, float]:
    """Returns p50 and p99."""
    p50, p99 = np.percentile(values, (50, 99))
    return float(p50), float(p99)


def episodes(names: Sequence[str]) -> None:
    """Prints T7."""
    first = load_scenario("apartment", f"task: {{text: '@{names[0]}'}}")
    run_episode(first)  # Compiles the kernels and fills the caches.
    watch = Watch()
    successes = 0
    for name in names:
        scenario = load_scenario("apartment", f"task: {{text: '@{name}'}}")
        with watching(watch):
            successes += bool(run_episode(scenario).success)
    near = [took for distance, took in watch.plans if distance <= 5.0]
    every = [took for _, took in watch.plans]
    farthest = max(distance for distance, _ in watch.plans)
    for id_, what, taken, target in (
        ("T7.near", "planner and controller, goals up to 5 m", near, 3.0),
        ("T7.any", "planner and controller, all goals", every, 8.0),
    ):
        p50, p99 = percentiles(taken)
        row(id_, f"{what}: a poll that plans and the update after it, p99", p99, "ms",
            target=target, sense="<=", p50=round(p50, 3), max=round(max(taken), 3), n=len(taken),
            farthest_m=round(min(farthest, 5.0 if id_ == "T7.near" else math.inf), 2),
            episodes=len(names), successes=successes)  # fmt: skip
    for kind, what in (("idle", "a poll that plans nothing"), ("control", "a controller update")):
        p50, p99 = percentiles(watch.spent[kind])
        row(f"T7.{kind}", f"{what}, p99", p99, "ms", p50=round(p50, 4), n=len(watch.spent[kind]))


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=10, help="fields on each of three floors")
    parser.add_argument("--worlds", type=int, default=200, help="floors for paths; 0 for none")
    tasks = names_among("task", load_scenario("apartment").tasks)
    parser.add_argument(
        "--episodes", type=tasks, default=EPISODES, help="tasks of apartment; empty for none"
    )
    arguments = parser.parse_args()
    warm_up()
    if arguments.tasks:
        fields(arguments.tasks)
    if arguments.worlds:
        paths(arguments.worlds)
    if arguments.episodes:
        episodes(arguments.episodes)


if __name__ == "__main__":
    main()
