"""CPU of whole episodes: what a decision costs, and how fast the simulation runs.

    python benchmarks/episode.py [--tasks fridge,sofa]

Prints one JSON object a line.  Each task runs twice through ``run_episode`` with a run folder: once
with only rendering and model metered, which gives the targets, and once with every System metered,
which gives the split (its own cost falls to ``rest``).  Set-up and the final picture are not part
of it.  The plant's steps are metered in place, between two marks in the station: with everything
attached, a step costs about twice what it costs in a loop of its own.

* ``own``: everything of ours per decision, that is the whole less rendering, plant and model.
* ``rtf``: simulated seconds per CPU second while the robot moves, everything attached, rendering
  excluded.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from chosen import names_among
from moving import Stretch, speed
from pydrake.multibody.plant import AddMultibodyPlant
from pydrake.systems.analysis import Simulator, SimulatorStatus
from pydrake.systems.framework import EventStatus, LeafSystem

from unilavira_drake import episode, load_scenario, run_episode, station
from unilavira_drake.mapping.goal_selector import GoalSelector
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.ports import InputReader, Level
from unilavira_drake.recording.recorder import Recorder
from unilavira_drake.robots.governor import Governor
from unilavira_drake.robots.ground_controller import GroundTrackingController
from unilavira_drake.robots.planar_base import PlanarBase
from unilavira_drake.robots.planar_pose import PlanarPose

CHUNK = 0.5
"""Simulated seconds in which the robot either moved or did not."""

PARTS = {
    "OccupancyMapper": "mapping",
    "FastMarchingPlanner": "planning",
    "Observer": "observer",
    "EpisodeMonitor": "monitor",
}
"""Category of each Level by its class; the others are the agent's."""

CALLBACKS = (
    (GroundTrackingController, "_update", "control"),
    (Governor, "_update", "control"),
    (PlanarBase, "_calc_desired", "control"),
    (PlanarPose, "_calc_pose", "control"),
    (PlanarPose, "_calc_twist", "control"),
    (GoalSelector, "_calc_goal", "agent"),
    (Recorder, "_publish", "recording"),
)


class Meter:
    """CPU seconds by category; a nested span is not counted in the one around it.

    ``moving`` are the stretches in which the robot moved, without rendering.
    """

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.moving: list[Stretch] = []
        self._inside: list[float] = []
        self._begun = 0.0

    def metered(self, category: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Returns the function, metered."""
        return self.metered_by(lambda _: category, function)

    def metered_by(
        self, category: Callable[[Any], str], function: Callable[..., Any]
    ) -> Callable[..., Any]:
        """Returns the method, metered under a category that is told by its object.

        Rendering also counts the helper threads that a software renderer has.
        """
        inside, thread_time = self._inside, time.thread_time

        def call(owner: Any, *args: Any) -> Any:
            name = category(owner)
            whole = time.process_time() if name == "rendering" else 0.0
            inside.append(0.0)
            start = thread_time()
            try:
                return function(owner, *args)
            finally:
                took = thread_time() - start
                nested = inside.pop()
                if inside:
                    inside[-1] += took
                all_threads = name == "rendering"
                self.seconds[name] += time.process_time() - whole if all_threads else took - nested

        return call

    def begin(self) -> None:
        """Begins a span that is not one call."""
        self._inside.append(0.0)
        self._begun = time.thread_time()

    def end(self, name: str) -> None:
        """Ends the span and counts it."""
        took = time.thread_time() - self._begun
        self.seconds[name] += took - self._inside.pop()


class Mark(LeafSystem):
    """Calls a function at each step of the plant, in its turn among the Systems of a Diagram."""

    def __init__(self, period: float, function: Callable[[], None]) -> None:
        super().__init__()
        self._function = function
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._call)

    def _call(self, context: Any, state: Any) -> EventStatus:
        self._function()
        return EventStatus.DidNothing()


class MeteredModel:
    """A backend whose calls are metered; they run on threads of their own."""

    def __init__(self, backend: Any, meter: Meter) -> None:
        self._backend = backend
        self._meter = meter

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def complete(self, request: Any) -> Any:
        """Calls the model, metered."""
        start = time.thread_time()
        try:
            return self._backend.complete(request)
        finally:
            self._meter.seconds["model"] += time.thread_time() - start


@contextlib.contextmanager
def metering(meter: Meter, *, systems: bool) -> Iterator[None]:
    """Meters rendering and model, and every System when asked to, in what is built inside."""
    reader_init, broker_init = InputReader.__init__, Broker.__init__

    class MeteredImageReader(InputReader[Any]):
        __call__ = meter.metered("rendering", InputReader.__call__)

    def init_reader(self: Any, system: Any, name: str, *args: Any) -> None:
        reader_init(self, system, name, *args)
        if name.endswith("_image"):
            self.__class__ = MeteredImageReader

    def init_broker(self: Any, backend: Any, **options: Any) -> None:
        broker_init(self, MeteredModel(backend, meter), **options)

    def add_plant(config: Any, builder: Any) -> Any:
        # Drake updates the Systems of a Diagram in the order in which they were added.
        builder.AddSystem(Mark(config.time_step, meter.begin))
        plant = AddMultibodyPlant(config, builder)
        builder.AddSystem(Mark(config.time_step, lambda: meter.end("physics")))
        return plant

    def part(level: Any) -> str:
        return PARTS.get(type(level).__name__, "agent")

    with contextlib.ExitStack() as stack:
        patch = stack.enter_context
        patch(mock.patch.object(InputReader, "__init__", init_reader))
        patch(mock.patch.object(Broker, "__init__", init_broker))
        if systems:
            patch(mock.patch.object(station, "AddMultibodyPlant", add_plant))
            patch(mock.patch.object(Level, "_tick", meter.metered_by(part, Level._tick)))
            for owner, name, category in CALLBACKS:
                own = meter.metered(category, getattr(owner, name))
                patch(mock.patch.object(owner, name, own))
        yield


def chunked_simulator(meter: Meter) -> type[Simulator]:
    """Returns a Simulator that meters AdvanceTo in chunks, by whether the robot moved."""

    class ChunkedSimulator(Simulator):
        def __init__(self, diagram: Any) -> None:
            super().__init__(diagram)
            self._station = diagram.GetSubsystemByName("station")

        def _pose(self) -> tuple[float, float, float]:
            context = self._station.GetMyContextFromRoot(self.get_context())
            X = self._station.GetOutputPort("cheat_X_WB").Eval(context).GetAsMatrix34()
            return X[0, 3], X[1, 3], math.atan2(X[1, 0], X[0, 0])

        def AdvanceTo(self, boundary_time: float) -> SimulatorStatus:
            reached = SimulatorStatus.ReturnReason.kReachedBoundaryTime
            while True:
                begin = self.get_context().get_time()
                end = min(begin + CHUNK, boundary_time)
                before, rendering = self._pose(), meter.seconds["rendering"]
                cpu = time.process_time()
                status = super().AdvanceTo(end)
                cpu = time.process_time() - cpu
                rendering = meter.seconds["rendering"] - rendering
                seconds = self.get_context().get_time() - begin
                meter.seconds["total"] += cpu
                meter.seconds["simulated"] += seconds
                x, y, yaw = (abs(a - b) for a, b in zip(before, self._pose(), strict=True))
                if math.hypot(x, y) > 0.001 or min(yaw, 2 * math.pi - yaw) > 0.005:
                    meter.moving.append((round(seconds, 9), cpu - rendering))
                if status.reason() != reached or end >= boundary_time:
                    return status

    return ChunkedSimulator


def run(task: str, *, systems: bool) -> tuple[Meter, Any]:
    """Runs a task once; returns what was metered and the result."""
    meter = Meter()
    scenario = load_scenario("flat", f"task: {{text: '@{task}'}}")
    with (
        tempfile.TemporaryDirectory() as folder,
        metering(meter, systems=systems),
        mock.patch.object(episode, "Simulator", chunked_simulator(meter)),
    ):
        result = run_episode(scenario, out=Path(folder) / "run")
    return meter, result


def row(id_: str, what: str, value: float, unit: str, **more: Any) -> None:
    """Prints one line; without a target it is information."""
    target, sense = more.pop("target", None), more.pop("sense", None)
    ok = None
    if target is not None:
        ok = value <= target if sense == "<=" else value >= target
    line = {"id": id_, "what": what, "value": round(value, 3), "target": target, "sense": sense}
    print(json.dumps({**line, "unit": unit, "ok": ok, **more}), flush=True)


def main() -> None:
    """Runs the tasks and prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--tasks",
        type=names_among("task", load_scenario("flat").tasks),
        default="fridge,bathtub,sofa",
        help="named tasks of flat",
    )
    tasks = parser.parse_args().tasks
    run(tasks[0], systems=False)  # Compiles the kernels and fills the caches.
    bare: Counter[str] = Counter()
    split: Counter[str] = Counter()
    moving: list[Stretch] = []
    results = []
    for task in tasks:
        meter, result = run(task, systems=False)
        bare += meter.seconds
        moving += meter.moving
        split += run(task, systems=True)[0].seconds
        results.append(result)
    decisions = sum(result.counts.decisions for result in results)
    parts = ("rendering", "mapping", "planning", "control", "physics", "agent", "observer")
    parts += ("monitor", "recording", "model")
    split["rest"] = split["total"] - sum(split[part] for part in parts)
    own = bare["total"] - bare["rendering"] - bare["model"] - split["physics"]
    row(
        "own",
        "CPU per decision of everything of ours: without rendering, plant stepping and model",
        1e3 * own / decisions,
        "ms",
        target=150,
        sense="<=",
        decisions=decisions,
        simulated_s=round(bare["simulated"], 1),
    )
    row(
        "rtf",
        "simulated seconds per CPU second while the robot moves, rendering excluded",
        speed([moving])[0],
        "s/s",
        target=60,
        sense=">=",
        simulated_moving_s=round(sum(seconds for seconds, _ in moving), 1),
        cpu_moving_s=round(sum(cpu for _, cpu in moving), 3),
    )
    for part in (*parts, "rest"):
        row(
            f"split.{part}",
            f"CPU of {part}",
            1e3 * split[part] / decisions,
            "ms/decision",
            ms_per_simulated_second=round(1e3 * split[part] / split["simulated"], 3),
        )
    for task, result in zip(tasks, results, strict=True):
        row(
            f"task.{task}",
            "decisions of the task",
            result.counts.decisions,
            "1",
            success=result.success,
            simulated_s=result.time.simulated_s,
        )


if __name__ == "__main__":
    main()
