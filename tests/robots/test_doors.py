"""A few of the drives of the robots' benchmark, through doors little wider than the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from unilavira_drake.robots.stopping import Footprint
from unilavira_drake.scenario import robot_kinds


@pytest.fixture(scope="module")
def drives(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("drives")


@pytest.mark.parametrize("name", ["cobot_magic", "unitree_go1", "unitree_g1"])
@pytest.mark.parametrize("seed", [1, 3])
def test_it_drives_through_a_narrow_door(drives: Any, name: str, seed: int) -> None:
    drive = drives.seeded_drive(robot_kinds()[name](), seed)
    assert (drive.state, drive.reason) == ("arrived", "")
    assert drive.penetration < 0.01
    assert not drive.crossed
    assert np.percentile(drive.errors, 95) < 0.10


@pytest.mark.parametrize("seed", [9, 34])
def test_a_base_that_stops_before_the_frame_turns_without_touching_it(
    drives: Any, seed: int
) -> None:
    drive = drives.seeded_drive(robot_kinds()["cobot_magic"](), seed)
    assert (drive.state, drive.backed_off, drive.contact) == ("arrived", False, 0.0)


def test_a_stuck_robot_backs_off_and_gets_through(
    drives: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    # So near to the frame its corner meets it in the turn.
    near = Footprint(standoff=0.05)
    monkeypatch.setattr("unilavira_drake.navigation._footprint", lambda robot: near)
    drive = drives.seeded_drive(robot_kinds()["cobot_magic"](), 11)
    assert (drive.state, drive.backed_off) == ("arrived", True)
    assert drive.contact > 1.0


def test_a_wall_without_a_door_is_told(drives: Any) -> None:
    robot = robot_kinds()["unitree_g1"]()
    drive = drives.drive(robot, start=(-2.0, 0.0, 0.0), goal=(2.0, 0.0), door=0.0, width=0.3)
    assert drive.state == "failed"
    assert not drive.crossed


@pytest.mark.parametrize(
    ("name", "slow"),
    [
        ("cobot_magic", {"max_yaw_acceleration": 0.2}),
        ("unitree_g1", {"control_period": 2.0, "command_period": 2.0, "max_yaw_rate": 0.8}),
    ],
)
def test_a_slow_turn_to_a_path_behind_it_is_not_being_stuck(
    drives: Any, name: str, slow: dict[str, float]
) -> None:
    robot = robot_kinds()[name](**slow)
    width = 1.6 * robot.width
    drive = drives.drive(robot, start=(-2.5, 0.0, math.pi), goal=(1.5, 0.0), door=0.0, width=width)
    assert (drive.state, drive.backed_off) == ("arrived", False)
