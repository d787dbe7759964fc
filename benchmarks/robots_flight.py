"""B1, B2 and B3 of the quadrotor: speed of simulation, distance to the path, narrow doors.

    python benchmarks/robots_flight.py [--flights 2] [--doors 100] [--ratios 1.35,1.75]

Prints one JSON object a line.  A flight is the whole diagram in ``apartment``, from room to room
through the doors, in gusts: plant with the world's collision geometry, five cameras, observer,
agent (the ``fixed`` model, without latency), navigation and monitor.  Only the goals are given.

* ``B1``: simulated seconds per CPU second in the half seconds in which the aircraft moved, without
  rendering: the pictures are those of a flight before, see ``kept_pictures``; of several runs, see
  ``moving.speed``.
* ``B2``: distance of the true position from the path that is flown, in 3-D, at each twentieth of
  a second on the way; 95th percentile, metres.
* ``B3``: seeded flights from one half of a hall to the other through a door, on a known map, with
  planner, controller, governor, autopilot, physics and gusts; walls entered, and flights that did
  not arrive.  The target is for doors 1.35 times as wide as the aircraft with its propellers,
  0.51 m.  That is less than the circle around the body, 0.54 m: it flies through such a door
  straight, with its nose along the way, and turns before and behind it.  With voxels of 0.05 m
  every door of 0.65 m, 1.71 times as wide, leaves the planner the radius of 0.30 m in which the
  aircraft may turn, so that wider ones are flown, too.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from typing import Any

import numpy as np
from episode import Meter, metering, row
from flights import GUSTS, seeded_flight
from kept_pictures import KeptPictures
from moving import Stretch, speed
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator, SimulatorStatus
from pydrake.systems.framework import LeafSystem

from unilavira_drake import load_scenario
from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.messages import Goal, History, LanguageAction, Panorama, VisionAction
from unilavira_drake.ports import message_input
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.quadrotor import Quadrotor

OVERLAY = """
robot: !Quadrotor {}
language_model: fixed
vision_model: fixed
flight: {wind: {speed: 0.4, gusts: 0.6}}
"""
ROUTE = (
    (2.9, 5.6, 1.2),
    (9.8, 5.6, 1.6),
    (9.8, 8.2, 1.3),
    (9.8, 5.6, 1.2),
    (14.5, 5.6, 1.5),
    (13.65, 3.6, 1.1),
    (9.8, 5.6, 1.4),
    (2.9, 5.6, 1.0),
)
"""Goals in rooms and corridor, metres; the start is in a bedroom."""
CHUNK, SAMPLE = 0.5, 0.05
"""Simulated seconds in which the aircraft moved or did not, and between two samples."""
MOVED = 0.1
"""Metres in a chunk that count as motion."""
RUNS = 5
"""Of each flight, after the one that draws the pictures."""
RATIO = 1.35
"""Width of the door by that of the aircraft for which there is a target."""
KNOWN = FlightConfig(resolution=0.05)
"""Doors are a few centimetres wider than they must be: finer voxels than the 0.1 m of rooms."""
ASTRAY = 0.5
"""Who ends farther from its goal has not arrived, metres."""


class Route(LeafSystem):
    """In the place of the goal selector: whatever the model says, the next goal of the route."""

    def __init__(self) -> None:
        super().__init__()
        message_input(self, "vision_action", VisionAction())
        message_input(self, "history", History())
        self._panorama = message_input(self, "panorama", Panorama())
        self._action = message_input(self, "language_action", LanguageAction())
        self.DeclareAbstractOutputPort("goal", lambda: AbstractValue.Make(Goal()), self._calc_goal)

    def _calc_goal(self, context: Any, output: Any) -> None:
        n = self._action(context).n
        known = 0 < n == self._panorama(context).n
        point = ROUTE[(n - 1) % len(ROUTE)]
        output.set_value(Goal(n, "go", point) if known else Goal())


def off_path(p_WP: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    """Returns the distance of a point to a (k, 3) polyline, metres."""
    a, step = p_WP[:-1], np.diff(p_WP, axis=0)
    share = np.sum((p - a) * step, axis=1) / np.maximum(np.sum(step * step, axis=1), 1e-12)
    nearest = a + np.clip(share, 0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(p - nearest, axis=1).min())


def fly(seed: int) -> tuple[list[Stretch], dict[str, float]]:
    """Flies the route once; returns how it moved, and what else was measured."""
    scenario = load_scenario("apartment", f"{OVERLAY}\nrandom_seed: {seed}")
    meter = Meter()
    with metering(meter, systems=False):
        diagram = make_navigation_diagram(scenario, replace={"goal_selector": Route()})
        measured = _watched(Simulator(diagram), diagram, meter)
    return meter.moving, measured


def _watched(simulator: Simulator, diagram: Any, meter: Meter) -> dict[str, float]:
    root = simulator.get_context()

    def output(part: str, port: str) -> Any:
        system = diagram.GetSubsystemByName(part)
        return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(root))

    errors, way = [], 0.0
    last = np.array(output("station", "cheat_X_WB").translation())
    while output("navigation", "navigation_status").n < len(ROUTE):
        drawn, at = meter.seconds["rendering"], last
        spent = 0.0
        for _ in range(round(CHUNK / SAMPLE)):
            begun = time.process_time()
            reason = simulator.AdvanceTo(root.get_time() + SAMPLE).reason()
            spent += time.process_time() - begun
            if reason == SimulatorStatus.ReturnReason.kReachedTerminationCondition:
                raise RuntimeError(output("episode_monitor", "metrics").cause)
            last = np.array(output("station", "cheat_X_WB").translation())
            path = output("navigation", "path").p_WP
            if len(path) > 1:
                errors.append(off_path(path, last))
        step = float(np.linalg.norm(last - at))
        if step >= MOVED:
            way += step
            meter.moving.append((CHUNK, spent - (meter.seconds["rendering"] - drawn)))
    return {
        "moving_s": CHUNK * len(meter.moving),
        "way_m": way,
        "off_path_p95_m": float(np.percentile(errors, 95)),
        "off_path_max_m": max(errors),
        "collisions": output("episode_monitor", "metrics").collisions,
    }


def flights(count: int) -> None:
    """Prints B1 and B2: all flights, one after the other."""
    runs: list[list[Stretch]] = [[] for _ in range(RUNS)]
    worst = 0.0
    for seed in range(count):
        pictures = KeptPictures()
        with pictures.drawn():
            _, measured = fly(seed)
        print(json.dumps({"flight": {key: round(value, 3) for key, value in measured.items()}}))
        worst = max(worst, measured["off_path_p95_m"])
        for run in runs:
            with pictures.shown():
                run += fly(seed)[0]
    value, each = speed(runs)
    row(
        "B1.quadrotor",
        "simulated seconds per CPU second while it moves, full agent, rendering excluded",
        value,
        "s/s",
        target=40,
        sense=">=",
        runs=each,
        simulated_moving_s=round(sum(seconds for seconds, _ in runs[0]), 1),
    )
    row(
        "B2.quadrotor",
        "distance to the path in gusts, 95th percentile, of the worst flight",
        worst,
        "m",
        target=0.20,
        sense="<=",
    )


def doors(count: int, ratio: float) -> None:
    """Prints B3 for one width of the doors."""
    robot = Quadrotor()
    flights = [seeded_flight(robot, seed, ratio=ratio, config=KNOWN) for seed in range(count)]
    wanted = ratio == RATIO
    suffix = "" if wanted else f".{ratio:g}"
    row(
        f"B3.quadrotor.penetrations{suffix}",
        f"flights with a wall penetrated, doors {ratio:g} times as wide as the aircraft",
        sum(flight.crossed or flight.penetration > 0.01 for flight in flights),
        "flights",
        target=0 if wanted else None,
        sense="<=",
        flights=count,
        through=sum(flight.through for flight in flights),
        deepest_contact_m=round(max(flight.penetration for flight in flights), 4),
        least_clearance_m=round(min(flight.clearance for flight in flights), 3),
        voxel_m=KNOWN.resolution,
        gusts_m_s=GUSTS,
    )
    stuck = {
        seed: flight.reason or flight.state
        for seed, flight in enumerate(flights)
        if flight.state != "arrived" or flight.off_goal > ASTRAY
    }
    row(
        f"B3.quadrotor.stuck{suffix}",
        "share of the flights that did not arrive",
        len(stuck) / count,
        "1",
        target=0.01 if wanted else None,
        sense="<=",
        seeds=list(stuck) if len(stuck) < count else "all",
        reasons=dict(Counter(stuck.values())),
        touching=sum(flight.contact > 1.0 for flight in flights),
        simulated_s=round(sum(flight.simulated for flight in flights), 1),
        cpu_s=round(sum(flight.cpu for flight in flights), 1),
    )


def main() -> None:
    """Measures the flights and prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=2, help="of B1 and B2; 0: none")
    parser.add_argument("--doors", type=int, default=100, help="flights of B3; 0: none")
    parser.add_argument("--ratios", default="1.35,1.75", help="of doors and aircraft")
    options = parser.parse_args()
    if options.flights:
        flights(options.flights)
    for ratio in options.ratios.split(",") if options.doors else ():
        doors(options.doors, float(ratio))


if __name__ == "__main__":
    main()
