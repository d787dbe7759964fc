"""The guide's fifth robot: its four files run, and its episode succeeds."""

from __future__ import annotations

import dataclasses as dc
import re
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from unilavira_drake.errors import ScenarioError
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


MODULE = """
import dataclasses as dc
from unilavira_drake.robots.robot import GroundRobot
from unilavira_drake.robots.unitree_go1 import UnitreeGo1

@dc.dataclass
class Trolley(UnitreeGo1):
    name: str = "trolley"
    gauge: float = 0.36
"""


Make = Callable[..., type[Robot]]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Make:
    def class_of(text: str, name: str = "Trolley", module: str = "trolley") -> type[Robot]:
        made = types.ModuleType(module)
        monkeypatch.setitem(sys.modules, module, made)
        # Without dont_inherit the text would take over the __future__ import of this file.
        exec(compile(text, f"{module}.py", "exec", dont_inherit=True), vars(made))
        kind = vars(made)[name]
        assert isinstance(kind, type)
        return kind

    return class_of


@pytest.mark.usefixtures("clean_choice")
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "\nimport",
            "from __future__ import annotations\nimport",
            "the type of name is the text 'str'; remove 'from __future__ import annotations' from",
        ),
        ("gauge: float", "gauge: 'float'", "the type of gauge is the text 'float'; remove"),
        ("gauge: float", "gauge: complex", "gauge has the type <class 'complex'>, which YAML"),
        ("gauge: float", "gauge: list['float']", "gauge has the type list['float'], which YAML"),
        ("@dc.dataclass", "", "trolley.Trolley is no dataclass; write @dataclasses.dataclass"),
        ("Trolley", "CobotMagic", "!CobotMagic is taken by unilavira_drake.robots.cobot_magic."),
        ('"trolley"', '"cobot_magic"', "name: 'cobot_magic' is taken by unilavira_drake."),
    ],
)
def test_a_robot_that_scenarios_could_not_use_is_refused(
    make: Make, old: str, new: str, words: str
) -> None:
    kind = make(MODULE.replace(old, new, 1), "CobotMagic" if new == "CobotMagic" else "Trolley")
    before = robot_kinds()
    with pytest.raises(ScenarioError, match=re.escape(words)) as caught:
        register_robot(kind)
    assert str(caught.value).startswith("register_robot: trolley.")
    assert robot_kinds() == before


@pytest.mark.usefixtures("clean_choice")
def test_all_fields_need_a_default(make: Make) -> None:
    fields = "\n".join(f"    {field.name} = 1" for field in dc.fields(Robot))
    kind = make(MODULE.partition("@")[0] + f"@dc.dataclass\nclass Trolley(GroundRobot):\n{fields}")
    with pytest.raises(ScenarioError, match=r"no default for name, max_speed, .*name: str = "):
        register_robot(kind)


@pytest.mark.parametrize("kind", [CobotMagic(), dict, "CobotMagic"])
def test_only_classes_of_robots_are_registered(kind: Any) -> None:
    with pytest.raises(ScenarioError, match="is no class of a robot; give a dataclass that derive"):
        register_robot(kind)


@pytest.mark.usefixtures("clean_choice")
def test_after_a_reload_the_new_class_takes_the_place_of_the_old(make: Make) -> None:
    register_robot(make(MODULE))
    again = make(MODULE.replace("0.36", "0.40"))
    register_robot(again)
    assert robot_kinds()["trolley"] is again
    assert type(load_scenario("flat", "robot: !Trolley {gauge: 0.5}").robot) is again
    with pytest.raises(ScenarioError, match=r"!Trolley is taken by trolley\.Trolley; rename"):
        register_robot(make(MODULE, module="another"))


@pytest.mark.usefixtures("clean_choice")
def test_a_robot_of_ours_may_be_registered_again() -> None:
    before = Scenario.__dataclass_fields__["robot"].type
    register_robot(CobotMagic)
    assert Scenario.__dataclass_fields__["robot"].type == before
    assert type(load_scenario("flat").robot) is CobotMagic
