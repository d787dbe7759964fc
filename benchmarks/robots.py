"""What the robots can do: simulated time per CPU second, tracking, and narrow doors.

B1: whole episodes in the apartment without latency while the robot moves, rendering excluded: the
pictures are those of a run before, see ``kept_pictures``; of several runs, see ``moving.speed``.
B2, B3: seeded drives through a door of 1.35 times the robot's width, on a known map, with planner,
controller, governor and physics; the paper's robots have no such figures.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np
from chosen import names_among
from drives import Drive, seeded_drive
from episode import Meter, chunked_simulator, metering, row
from kept_pictures import KeptPictures
from moving import Stretch, speed

from unilavira_drake import episode, load_scenario, run_episode
from unilavira_drake.robots.robot import GroundRobot
from unilavira_drake.scenario import robot_kinds
from unilavira_drake.scenario_loading import robot_setting

RATIO = 1.35
"""Width of the door by that of the robot."""
RUNS = 5
"""Of each task, after the one that draws the pictures; see ``moving.speed``."""


def moving_stretches(name: str, task: str) -> tuple[list[Stretch], bool]:
    """Runs a task in the apartment; returns how it moved, and whether it succeeded."""
    meter = Meter()
    overlay = f"{{robot: {robot_setting(name)}, task: {{text: '@{task}'}}}}"
    with (
        tempfile.TemporaryDirectory() as folder,
        metering(meter, systems=False),
        mock.patch.object(episode, "Simulator", chunked_simulator(meter)),
    ):
        result = run_episode(load_scenario("apartment", overlay), out=Path(folder) / "run")
    return meter.moving, bool(result.success)


def print_speed(name: str, robot: GroundRobot, tasks: list[str]) -> None:
    """Prints B1 of a robot: all tasks, one after the other."""
    runs: list[list[Stretch]] = [[] for _ in range(RUNS)]
    successes = 0
    for task in tasks:
        pictures = KeptPictures()
        with pictures.drawn():
            moving_stretches(name, task)
        for run in runs:
            with pictures.shown():
                stretches, success = moving_stretches(name, task)
            run += stretches
            successes += success
    value, each = speed(runs)
    row(
        f"B1.{name}",
        "simulated seconds per CPU second while it moves, full agent, rendering excluded",
        value,
        "s/s",
        target=100 if robot.gait is None else 30,
        sense=">=",
        runs=each,
        simulated_moving_s=round(sum(seconds for seconds, _ in runs[0]), 1),
        successes=f"{successes}/{RUNS * len(tasks)}",
    )


def doors(name: str, robot: GroundRobot, count: int) -> None:
    """Prints B2 and B3 of a robot."""
    drives: list[Drive] = [seeded_drive(robot, seed, ratio=RATIO) for seed in range(count)]
    errors = np.concatenate([drive.errors for drive in drives])
    row(
        f"B2.{name}",
        "distance to the path, 95th percentile of the motion of all drives",
        float(np.percentile(errors, 95)),
        "m",
        target=0.10,
        sense="<=",
        median=round(float(np.median(errors)), 4),
        maximum=round(float(errors.max()), 4),
    )
    through = sum(drive.crossed or drive.penetration > 0.01 for drive in drives)
    row(
        f"B3.{name}.penetrations",
        f"drives with a wall penetrated, doors {RATIO} times as wide as the robot",
        through,
        "drives",
        target=0,
        sense="<=",
        drives=count,
        deepest_contact_m=round(max(drive.penetration for drive in drives), 4),
    )
    stuck = [seed for seed, drive in enumerate(drives) if drive.state != "arrived"]
    row(
        f"B3.{name}.stuck",
        "share of the drives that did not arrive",
        len(stuck) / count,
        "1",
        target=0.01,
        sense="<=",
        seeds=stuck,
        touching=sum(drive.contact > 1.0 for drive in drives),
        backed_off=sum(drive.backed_off for drive in drives),
        simulated_s=round(sum(drive.simulated for drive in drives), 1),
        cpu_s=round(sum(drive.cpu for drive in drives), 1),
    )


def main() -> None:
    """Measures the robots and prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ground = {name: kind for name, kind in robot_kinds().items() if issubclass(kind, GroundRobot)}
    tasks = names_among("task", load_scenario("apartment").tasks)
    parser.add_argument(
        "--robots",
        type=names_among("robot on the ground", ground),
        default=[],
        help=f"of {','.join(ground)}; default: all",
    )
    parser.add_argument(
        "--tasks", type=tasks, default="fridge,bathtub", help="named tasks of the apartment"
    )
    parser.add_argument("--drives", type=int, default=100, help="of each robot")
    options = parser.parse_args()
    for name, kind in ground.items():
        if not options.robots or name in options.robots:
            robot = kind()
            print_speed(name, robot, options.tasks)
            doors(name, robot, options.drives)


if __name__ == "__main__":
    main()
