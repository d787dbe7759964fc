"""One instruction, one agent, several bodies: only what moves them differs."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Diagram, LeafSystem

from unilavira_drake import load_scenario, make_navigation_diagram, run_episode
from unilavira_drake.messages import (
    DIRECTIONS,
    Frame,
    History,
    Intrinsics,
    LanguageAction,
    Panorama,
    SecondChance,
    TodoItem,
    TodoList,
)
from unilavira_drake.mllm.prompt import _environment, compose_prompt
from unilavira_drake.resources import prompts_path
from unilavira_drake.scenario_loading import robot_setting
from unilavira_drake.tasks import TaskSpec

GROUND = ("cobot_magic", "unitree_go1", "unitree_g1")
LEVELS = ("language", "vision", "todo_memory", "waypoint_memory", "goal_selector")


@functools.lru_cache
def diagram(robot: str) -> Diagram:
    scenario = load_scenario("apartment", f"robot: {robot_setting(robot)}")
    return make_navigation_diagram(scenario)


def level(robot: str, name: str) -> Any:
    return diagram(robot).GetSubsystemByName("agent").GetSubsystemByName(name)


def told(value: Any) -> Any:
    """What a constructor was given, as far as it can be compared: functions by what they bind."""
    if isinstance(value, functools.partial):
        return value.func.__name__, value.keywords
    if type(value) is tuple:
        return tuple(told(one) for one in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return type(value), tuple(told(getattr(value, field.name)) for field in fields)
    if isinstance(value, bool | int | float | str | tuple | type(None)):
        return value
    if isinstance(value, np.ndarray):
        return value.tolist()
    return type(value).__name__


def configuration(system: LeafSystem) -> dict[str, Any]:
    return {name: told(value) for name, value in vars(system).items()}


def templates_read(robot: str) -> dict[str, str]:
    """Hashes of the template files that a robot's language and vision levels really read."""
    _environment.cache_clear()
    for name in ("language", "vision"):
        asked(robot, name)
    loaded = [name for _, name in list(_environment().cache)]
    return {
        name: hashlib.sha256((prompts_path() / name).read_bytes()).hexdigest() for name in loaded
    }


@pytest.mark.parametrize("robot", GROUND[1:])
@pytest.mark.parametrize("name", LEVELS)
def test_the_levels_of_the_agent_are_of_one_class_and_configuration(robot: str, name: str) -> None:
    mine, first = level(robot, name), level("cobot_magic", name)
    assert type(mine) is type(first)
    assert configuration(mine) == configuration(first)
    assert len(configuration(mine)) > 1


@pytest.mark.parametrize("name", ["language", "vision"])
def test_an_aircraft_has_the_same_language_and_vision(name: str) -> None:
    mine, first = configuration(level("quadrotor", name)), configuration(level("cobot_magic", name))
    assert type(level("quadrotor", name)) is type(level("cobot_magic", name))
    # How far a view is free is measured by the body: over a floor, or along an axis in the air.
    for measured in (mine, first):
        measured.pop("_free_distance", None)
    assert mine == first


@pytest.mark.parametrize("robot", [*GROUND[1:], "quadrotor"])
def test_all_robots_read_the_same_templates(robot: str) -> None:
    first = templates_read("cobot_magic")
    assert templates_read(robot) == first
    assert {"language/decide.txt.j2", "vision/ground.txt.j2", "tasks/vln.txt.j2"} <= set(first)


def panorama() -> Panorama:
    """Four views as any robot might have taken them."""
    lens = Intrinsics(640, 480, 320.0, 320.0, 319.5, 239.5)
    depth = np.full((480, 640), 2.5, np.float32)
    frames = [Frame(view=d, jpeg=d.encode(), depth=depth, intrinsics=lens) for d in DIRECTIONS]
    return Panorama(n=4, first=4, frames=tuple(frames))


def asked(robot: str, name: str) -> tuple[str, list[Any]]:
    """The prompt that a level makes of one task, panorama and memory, and its pictures."""
    system = level(robot, name)
    todo = TodoList(3 if name == "language" else 4, (TodoItem("Go to the sofa"),))
    inputs = {
        "task": TaskSpec("vln", "Go to the sofa."),
        "panorama": panorama(),
        "history": History(n=4),
        "second_chance": SecondChance(4),
        "todo_list": todo,
        "language_action": LanguageAction(4, "decide", "turn", "left"),
    }
    context = system.CreateDefaultContext()
    for port, value in inputs.items():
        if system.HasInputPort(port):
            system.GetInputPort(port).FixValue(context, AbstractValue.Make(value))
    state = system.state(context)
    if name == "language":
        state = type(state)(action=LanguageAction(3, "decide", "turn", "left"))
        request = system._ask(context, state).request
    else:
        request = system.step(context, state).request
    assert request.n == 4
    prompt = compose_prompt(request)
    return prompt.text, [(part.label, part.jpeg) for part in request.images]


@pytest.mark.parametrize("robot", GROUND[1:])
@pytest.mark.parametrize("name", ["language", "vision"])
def test_the_prompt_is_the_same_byte_for_byte(robot: str, name: str) -> None:
    text, pictures = asked(robot, name)
    assert (text.encode(), pictures) == (asked("cobot_magic", name)[0].encode(), pictures)
    assert pictures == asked("cobot_magic", name)[1]
    assert "Go to the sofa" in text


@pytest.mark.parametrize("robot", GROUND)
def test_the_station_has_the_same_ports_but_for_its_views(robot: str) -> None:
    station = diagram(robot).GetSubsystemByName("station")
    names = {station.get_output_port(i).get_name() for i in range(station.num_output_ports())}
    views = ["front"] if robot == "cobot_magic" else ["front", "left", "back", "right"]
    images = {"color_image", "depth_image", "label_image", "X_BC"}
    assert names == {f"{view}.{image}" for view in views for image in images} | {
        "pose_estimate",
        "twist",
        "contact_results",
        "cheat_X_WB",
    }
    inputs = {station.get_input_port(i).get_name() for i in range(station.num_input_ports())}
    assert inputs == {"base_command"}


@pytest.mark.parametrize("robot", GROUND[1:])
def test_the_same_instruction_succeeds_with_each_body(robot: str) -> None:
    scenario = load_scenario("apartment", f"robot: {robot_setting(robot)}")
    result = run_episode(scenario)
    assert result.success, result.cause
    assert result.robot == robot
    assert result.metrics.collisions == 0
