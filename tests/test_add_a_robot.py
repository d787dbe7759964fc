"""The guide's fifth robot: its four files run, and its episode succeeds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.robot import Robot
from unilavira_drake.scenario import Scenario, register_robot, robot_kinds
from unilavira_drake.scenario_loading import dump_scenario, load_scenario

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "add_a_robot"


def test_it_is_four_files_each_short_but_the_model() -> None:
    names = {path.name for path in FOLDER.iterdir() if path.is_file()}
    assert names == {"run.py", "tracked_cart.py", "tracked_cart.sdf", "tracks.py"}
    assert all(len(path.read_text("utf-8").splitlines()) <= 60 for path in FOLDER.glob("*.py"))


def test_its_episode_succeeds(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(FOLDER / "run.py")],
        cwd=tmp_path, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == "tracked_cart: stopped, success: True"


@pytest.fixture
def clean_choice() -> object:
    field = Scenario.__dataclass_fields__["robot"]
    kind = field.type
    yield
    field.type = kind


@pytest.mark.usefixtures("clean_choice")
def test_a_registered_robot_is_a_choice_like_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    from tracked_cart import TrackedCart  # type: ignore[import-not-found]

    register_robot(TrackedCart)
    register_robot(TrackedCart)
    assert robot_kinds()["tracked_cart"] is TrackedCart
    scenario = load_scenario("flat", "robot: !TrackedCart {max_speed: 0.3}")
    assert type(scenario.robot) is TrackedCart
    assert isinstance(scenario.robot, Robot)
    text = dump_scenario(scenario)
    assert dump_scenario(load_scenario("flat", text)) == text
    assert type(load_scenario("flat").robot) is CobotMagic
