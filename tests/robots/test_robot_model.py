"""A robot's model is read, or it is told in words what the file lacks."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, System

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.errors import ScenarioError
from unilavira_drake.resources import models_path
from unilavira_drake.robots.actuation import add_actuation
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.gait_config import Gait
from unilavira_drake.robots.planar_base import PlanarBase
from unilavira_drake.robots.robot import GroundRobot
from unilavira_drake.robots.robot_model import add_robot_model
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario import robot_kinds

CART = Path(__file__).resolve().parents[2] / "examples" / "add_a_robot" / "tracked_cart.sdf"


@pytest.fixture
def plant() -> MultibodyPlant:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.025)
    return plant


@pytest.mark.parametrize("name", sorted(robot_kinds()))
def test_the_models_of_the_package_are_complete(plant: MultibodyPlant, name: str) -> None:
    instance = add_robot_model(plant, robot_kinds()[name]())
    assert plant.HasBodyNamed("base", instance)


@pytest.mark.parametrize(
    ("pattern", "put", "told"),
    [
        ("front_camera", "eye", "no frame 'front_camera' for the camera 'front' of robot.views"),
        ('"base"|>base<', lambda found: found[0].replace("base", "hull"), "no body 'base'"),
        ("base_yaw", "yaw", "no joint 'base_yaw'"),
        ("(?s)<collision.*?</collision>", "", "no collision shape"),
        ("<drake:controller_gains[^>]*>", "", "no drake:controller_gains for the joint 'base_x'"),
        ("<limit>.*?</limit>", "", "no effort limit of the joint 'base_x'"),
        ("</sdf>", "", "cannot be read"),
    ],
)
def test_it_is_told_what_a_model_lacks(
    plant: MultibodyPlant,
    tmp_path: Path,
    pattern: str,
    put: str | Callable[[re.Match[str]], str],
    told: str,
) -> None:
    path = tmp_path / "cart.sdf"
    text = re.sub(pattern, put, CART.read_text())
    assert text != CART.read_text()
    path.write_text(text)
    with pytest.raises(ScenarioError, match=re.escape(told)) as error:
        add_robot_model(plant, CobotMagic(model=str(path)))
    assert str(error.value).startswith(f"robot.model: {str(path)!r} ")


def test_a_view_needs_its_camera(plant: MultibodyPlant) -> None:
    robot = dataclasses.replace(CobotMagic(), views=["front", "up"])
    with pytest.raises(ScenarioError, match="no frame 'up_camera'"):
        add_robot_model(plant, robot)


def test_a_file_of_two_models_is_refused(plant: MultibodyPlant, tmp_path: Path) -> None:
    path = tmp_path / "two.dmd.yaml"
    models = "".join(f"- add_model: {{name: {n}, file: 'file://{CART}'}}\n" for n in "ab")
    path.write_text(f"directives:\n{models}")
    with pytest.raises(ScenarioError, match="holds 2 models; give it just one"):
        add_robot_model(plant, CobotMagic(model=str(path)))


@pytest.mark.parametrize(
    "model",
    [
        "package://nope/x.sdf",
        "package://unilavira_drake/robots/nope.sdf",
        "http://localhost/x.sdf",
        "nope.sdf",
    ],
)
def test_a_file_that_is_not_there_is_told(plant: MultibodyPlant, model: str) -> None:
    with pytest.raises(ScenarioError, match=rf"^robot\.model: .*{re.escape(model)}"):
        add_robot_model(plant, CobotMagic(model=model))


GO1 = models_path() / "robots" / "unitree_go1.sdf"
STILL = Gait(heave=0.0, roll_degrees=0.0, pitch_degrees=0.0, swing_degrees=0.0)


def actuate(robot: GroundRobot, locomotion: System | None = None) -> None:
    """Gives a robot alone in the world its actuation."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.025)
    instance = add_robot_model(plant, robot)
    plant.Finalize()
    add_actuation(builder, plant, instance, robot, locomotion=locomotion)


@pytest.mark.parametrize(
    ("gait", "told"),
    [
        (Gait(), "heave 0.01, roll_degrees 2, pitch_degrees 1, swing_degrees 20: "),
        (dataclasses.replace(STILL, heave=0.02), "heave 0.02: "),
        (dataclasses.replace(STILL, swing_degrees=15.0), "swing_degrees 15: "),
        (STILL, ""),
        (None, ""),
    ],
)
def test_a_gait_needs_the_joints_it_swings(gait: Gait | None, told: str) -> None:
    robot = CobotMagic(model=str(CART), gait=gait)
    if not told:
        actuate(robot)
        return
    with pytest.raises(ScenarioError) as error:
        actuate(robot)
    words = str(error.value)
    assert words.startswith(f"robot.gait: {told}")
    assert repr(str(CART)) in words
    for number, joint in (("heave", "trunk_z"), ("swing_degrees", "LEG_hip")):
        assert (f"{joint!r}" in words) == (f"{number}: 0" in words) == (number in told)


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        ('(?<=joint name=")trunk_roll', "roll_degrees 1.5"),
        ('(?<=joint name=")[a-z]+_(left|right)_(?=hip)', "swing_degrees 22"),
        ('(?<=joint name=")[a-z]+_(left|right)_(?=knee)', ""),
        ('(?<=joint name=")front_left_', ""),
    ],
)
def test_one_joint_is_enough_for_each_number(tmp_path: Path, pattern: str, told: str) -> None:
    numbers = itertools.count()
    text, count = re.subn(pattern, lambda found: f"own_{next(numbers)}_", GO1.read_text())
    assert count
    path = tmp_path / "own_go1.sdf"
    path.write_text(text)
    robot = UnitreeGo1(model=str(path))
    if not told:
        actuate(robot)
        return
    with pytest.raises(ScenarioError, match=f"^robot.gait: {told}: "):
        actuate(robot)


def test_a_locomotion_of_ones_own_swings_what_it_likes() -> None:
    actuate(CobotMagic(model=str(CART), gait=Gait()), locomotion=PlanarBase(holonomic=False))


def test_a_scenario_is_told_too() -> None:
    scenario = load_scenario("flat", "robot: !CobotMagic {gait: {swing_degrees: 0}}")
    with pytest.raises(ScenarioError, match=r"'cobot_magic' lacks .* or set \{heave: 0, roll_deg"):
        make_navigation_diagram(scenario)
