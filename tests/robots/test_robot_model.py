"""A robot's model is read, or it is told in words what the file lacks."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.errors import ScenarioError
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.robot_model import add_robot_model
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
