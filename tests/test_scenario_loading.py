"""Scenarios: what is right loads, and what is wrong is told with place, value and remedy."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import InputError, ScenarioError, TaskError
from unilavira_drake.mllm.latency import ConstantLatency
from unilavira_drake.robots.unitree_g1 import UnitreeG1
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario import Scenario, robot_kinds
from unilavira_drake.scenario_loading import (
    dump_scenario,
    load_scenario,
    overlay_from_settings,
    robot_setting,
    scenario_names,
)
from unilavira_drake.scenario_schema import Source, check_fields


def loaded(*settings: str) -> Scenario:
    return load_scenario("flat", overlay_from_settings(list(settings)))


def test_every_scenario_loads_and_survives_a_round_trip(tmp_path: Path) -> None:
    for name in scenario_names():
        text = dump_scenario(load_scenario(name))
        (tmp_path / "saved.yaml").write_text(text, encoding="utf-8")
        assert dump_scenario(load_scenario(tmp_path / "saved.yaml")) == text


def test_a_complete_dump_names_every_field() -> None:
    data = yaml.load(dump_scenario(load_scenario("flat")), Loader=yaml.SafeLoader)
    check_fields(data, Scenario, Source("dump", "", numbered=False))
    assert set(data) == set(vars(Scenario()))


def test_each_named_task_can_be_chosen() -> None:
    for name in load_scenario("flat").tasks:
        assert loaded(f"task.text='@{name}'").task.text == f"@{name}"


def test_an_overlay_changes_what_it_names_and_nothing_else() -> None:
    plain = load_scenario("flat")
    changed = loaded("budgets.decisions=3", "tasks.fridge.text=Go to the fridge.")
    assert changed.budgets.decisions == 3
    assert changed.tasks["fridge"].text == "Go to the fridge."
    assert changed.tasks["fridge"].goal == plain.tasks["fridge"].goal
    changed.budgets.decisions = plain.budgets.decisions
    changed.tasks["fridge"].text = plain.tasks["fridge"].text
    assert dump_scenario(changed) == dump_scenario(plain)


def test_the_later_setting_wins_and_tags_are_read() -> None:
    scenario = loaded(
        "budgets.decisions=3",
        "language_latency=!ConstantLatency {seconds: 3}",
        "budgets.decisions=4",
    )
    assert scenario.budgets.decisions == 4
    assert scenario.language_latency == ConstantLatency(3.0)


@pytest.mark.parametrize(
    ("setting", "fragments"),
    [
        ("budgts.decisions=3", ["budgts", "did you mean 'budgets'"]),
        ("budgets.decisons=3", ["budgets.decisons", "did you mean 'decisions'"]),
        ("tasks.fridge.goel=x", ["tasks.fridge.goel", "did you mean 'goal'"]),
        ("plant.time_stp=0.01", ["plant.time_stp", "did you mean 'time_step'"]),
        ("robot.radius=wide", ["robot.radius", "a number", "'wide'"]),
        ("budgets.decisions=1.5", ["budgets.decisions", "a whole number", "1.5"]),
        ("budgets.decisions=true", ["budgets.decisions", "a whole number", "True"]),
        ("meshcat=maybe", ["meshcat", "true or false", "'maybe'"]),
        ("description=3", ["description", "quotes", "3"]),
        ("world=3", ["world", "name, mirror", "3"]),
        ("tasks=[]", ["tasks", "a mapping", "[]"]),
        ("tasks.fridge.accept=yes please", ["tasks.fridge.accept", "a list"]),
        ("tasks.fridge.accept=[1]", ["tasks.fridge.accept.0", "quotes"]),
        ("language_latency=!ConstantLatensy {}", ["did you mean '!ConstantLatency'"]),
        ("language_latency.seconds=3", ["needs a tag", "!ConstantLatency"]),
        ("robot=!Spot {}", ["robot", "unknown tag", "!CobotMagic"]),
        ("tick=0.055", ["tick", "plant.time_step (0.025)", "0.05"]),
        ("robot.control_period=0.004", ["robot.control_period", "0.004", "0.025"]),
        ("tick=.nan", ["tick", "nan", "a positive number"]),
        ("budgets.stall=-1", ["budgets.stall", "-1", "a positive number"]),
        ("random_seed=-1", ["random_seed", "not negative"]),
        ("language_latency=!ConstantLatency {seconds: -1}", ["language_latency.seconds"]),
        ("robot.image_width=1", ["robot.image_width", "16 to 4096"]),
        ("robot.max_depth=0.05", ["robot.min_depth", "robot.max_depth"]),
        ("robot.turning_radius=0.1", ["robot.turning_radius", "robot.radius"]),
        ("plant.time_step=0", ["plant.time_step", "positive"]),
        ("plant.contact_model=sticky", ["plant", "sticky"]),
        ("ablation=no_tmd", ["ablation", "did you mean 'no_tdm'"]),
        ("renderer=vkt", ["renderer", "did you mean 'vtk'"]),
        ("prompt_preset=papre", ["prompt_preset", "did you mean 'paper'"]),
        ("world.name=flta", ["world.name", "did you mean 'flat'"]),
        ("robot.name=cobot", ["robot.name", "did you mean 'cobot_magic'"]),
        ("robot.name=unitree_g1", ["robot.name", "another robot", "robot: !UnitreeG1 {}"]),
        ("robot.views=[front, left]", ["robot.views", "front alone"]),
        ("robot.views=[back]", ["robot.views", "front alone"]),
        ("robot=!UnitreeG1 {command_period: 0.03}", ["robot.command_period", "plant.time_step"]),
        ("robot=!UnitreeGo1 {gait: {frequency: 0}}", ["robot.gait.frequency", "positive"]),
        ("pose_estimate.position_drift=-1", ["pose_estimate.position_drift", "not negative"]),
        ("pose_estimate={position_noise: 1, period: 0.03}", ["pose_estimate.period"]),
        ("exposure.mode=lockt", ["exposure.mode", "did you mean 'locked'"]),
        ("language_model=rulez", ["language_model", "rulez"]),
        ("default_task=frige", ["default_task", "did you mean 'fridge'"]),
        ("tasks.fridge.family=vnl", ["tasks.fridge.family", "did you mean 'vln'"]),
        ("tasks.fridge.text=''", ["tasks.fridge.text", "empty"]),
    ],
)
def test_what_is_wrong_is_told_with_its_place_and_remedy(
    setting: str, fragments: list[str]
) -> None:
    with pytest.raises(ScenarioError) as caught:
        loaded(setting)
    for fragment in fragments:
        assert fragment in str(caught.value)


def test_a_file_s_mistake_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("world: {name: flat}\nbudgets:\n  decisions: 3\n  stahl: 4\n")
    with pytest.raises(ScenarioError, match=r"mine\.yaml, line 4: budgets\.stahl: .*'stall'"):
        load_scenario(file)
    file.write_text("world: {name: flat\n")
    with pytest.raises(ScenarioError, match=r"not valid YAML.*line 2"):
        load_scenario(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match=r"cannot be read"):
        load_scenario(file)


@pytest.mark.parametrize(
    ("name", "fragment"),
    [
        ("flta", "did you mean 'flat'"),
        ("no/such.yaml", "no file"),
        ("", "valid: apartment, apartment_eqa, apartment_objectnav"),
    ],
)
def test_an_unknown_scenario_is_told(name: str, fragment: str) -> None:
    with pytest.raises(ScenarioError, match=fragment):
        load_scenario(name)


@pytest.mark.parametrize("setting", ["budgets.decisions", "=3", "a..b=3", "tick=[", "tick=&a [*b]"])
def test_a_malformed_setting_is_told(setting: str) -> None:
    with pytest.raises(ScenarioError, match="setting"):
        overlay_from_settings([setting])


def test_a_value_and_a_part_of_it_exclude_each_other() -> None:
    with pytest.raises(ScenarioError, match="as a whole"):
        overlay_from_settings(["budgets={decisions: 3}", "budgets.stall=4"])


@pytest.mark.parametrize("start", ["kichen", "1,2", "a,b,c", "0,0,0", "99,0,0"])
def test_a_start_that_cannot_be_one_is_told(start: str) -> None:
    with pytest.raises(TaskError, match="start"):
        loaded(f"task.start='{start}'")


@pytest.mark.parametrize("text", ["?", "1: 2", "? {}", "- a", "5", "x", "!A {}", "&a [*a]"])
def test_a_text_that_is_no_mapping_of_names_is_told(text: str) -> None:
    with pytest.raises(ScenarioError, match="overlay"):
        load_scenario("flat", text)


def test_keys_for_anchors_are_private() -> None:
    overlay = "_few: &few {decisions: 2}\nbudgets: *few"
    assert load_scenario("flat", overlay).budgets.decisions == 2


KEYS = st.sampled_from(["budgets", "tasks", "tick", "robot", "world", "name", "task", "text", "x"])
SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
TREES = st.recursive(
    SCALARS,
    lambda below: st.lists(below, max_size=3) | st.dictionaries(KEYS, below, max_size=3),
    max_leaves=8,
)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.dictionaries(KEYS, TREES, max_size=3))
def test_any_tree_loads_or_is_told_to_be_wrong(tree: dict[str, object]) -> None:
    with contextlib.suppress(InputError):
        assert isinstance(load_scenario("flat", yaml.safe_dump(tree)), Scenario)


@settings(derandomize=True, deadline=None, max_examples=120)
@given(st.text(alphabet="abt:{}[]&*!?|>-# '\"\n,%@`0.", max_size=20))
def test_any_text_loads_or_is_told_to_be_wrong(text: str) -> None:
    with contextlib.suppress(InputError):
        assert isinstance(load_scenario("flat", text), Scenario)


def test_a_robot_is_chosen_by_name_and_changed_key_by_key() -> None:
    choice = f"robot={robot_setting('unitree_g1')}"
    overlay = overlay_from_settings([choice, "robot.max_speed=0.2", "robot.gait.heave=0"])
    robot = load_scenario("flat", overlay).robot
    assert isinstance(robot, UnitreeG1)
    assert (robot.max_speed, robot.gait.heave, robot.gait.frequency) == (0.2, 0.0, 1.6)


def test_an_overlay_without_a_tag_changes_the_files_robot(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("world: {name: flat}\nrobot: !UnitreeGo1 {max_speed: 0.3}\nstart: kitchen\n")
    robot = load_scenario(path, "robot: {max_yaw_rate: 0.5}\ntask: {text: Go.}").robot
    assert isinstance(robot, UnitreeGo1)
    assert (robot.max_speed, robot.max_yaw_rate) == (0.3, 0.5)


def test_an_unknown_robot_is_told_the_nearest_name() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'unitree_go1'"):
        robot_setting("unitre_go1")


@pytest.mark.parametrize("name", sorted(robot_kinds()))
def test_each_robot_is_written_and_read_back(name: str) -> None:
    scenario = load_scenario("flat", f"robot: {robot_setting(name)}")
    assert scenario.robot.name == name
    text = dump_scenario(scenario)
    assert dump_scenario(load_scenario("flat", text)) == text
