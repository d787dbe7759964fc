"""Where code of this kind departs from the paper's "one agent for all robots", ours does not.

One test for each point; what the paper says stands above it (section III-B3).  There is one robot
today, so what will differ between robots is varied by hand: its body, its camera, its planner.

Not tested here: the local planner of the paper's real robots (NavDP).  Ours is the deterministic,
geometric controller of section III-B3, see tests/robots.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from typing import Any

import jinja2
import jinja2.meta
import pytest
from pydrake.systems.framework import Diagram, System

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.agent import make_agent
from unilavira_drake.language.system import Language
from unilavira_drake.language.variables import language_request
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.mapping.voxel_system import VoxelMapper
from unilavira_drake.messages import (
    CALLS,
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
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables
from unilavira_drake.planning.system import FastMarchingPlanner
from unilavira_drake.planning.visibility_system import VisibilityPlanner
from unilavira_drake.resources import prompts_path
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.system import Vision

OTHER_BODY = """
robot:
  max_speed: 0.5
  max_yaw_rate: 0.9
  length: 0.5
  width: 0.4
  radius: 0.30
  turning_radius: 0.40
  sweep_direction: right
  control_period: 0.025
"""
BODY = {"can_climb", "view_degrees"}
"""All that a prompt knows of the robot: whether it climbs (in a house with stairs it is told, too,
that it does not: ``stairs_barred``), and how wide its camera sees."""


def ports(system: System, names: tuple[str, ...]) -> dict[str, str]:
    """Returns what these ports of a System carry."""
    every: list[Any] = [system.get_input_port(i) for i in range(system.num_input_ports())]
    every += [system.get_output_port(i) for i in range(system.num_output_ports())]
    found = {port.get_name(): port for port in every}
    return {name: type(found[name].Allocate().get_value()).__name__ for name in names}


def test_row_one_map_and_planner_for_each_kind_of_robot() -> None:
    """The paper: on the ground a 2-D occupancy grid and fast marching, in the air a 3-D voxel grid
    and a visibility graph; nothing else of the system differs.
    """
    diagram = make_navigation_diagram(load_scenario("flat"))
    navigation = diagram.GetSubsystemByName("navigation")
    assert isinstance(navigation, Diagram)
    assert type(navigation.GetSubsystemByName("mapper")) is OccupancyMapper
    planner = navigation.GetSubsystemByName("planner")
    assert type(planner) is FastMarchingPlanner
    lens = Intrinsics(24, 18, 16.0, 16.0, 11.5, 8.5)
    mapper, flier = VoxelMapper(intrinsics={"front": lens, "down": lens}), VisibilityPlanner()
    # Seen from the agent both are the same: a goal goes in, a status comes out.
    shared = ("goal", "path", "navigation_status", "pose_estimate")
    assert ports(flier, shared) == ports(planner, shared)
    assert ports(planner, ("goal", "navigation_status")) == {
        "goal": "Goal", "navigation_status": "NavigationStatus",
    }  # fmt: skip
    maps = ports(mapper, ("voxel_map",)), ports(flier, ("voxel_map",))
    assert maps[0] == maps[1] == {"voxel_map": "VoxelMap"}
    assert ports(planner, ("map",)) == {"map": "OccupancyMap"}


def agent_text(overlay: str) -> list[str]:
    """Returns the agent's Graphviz text without the numbers that each process gives."""
    agent = make_navigation_diagram(load_scenario("flat", overlay)).GetSubsystemByName("agent")
    names: dict[str, str] = {}
    plain = re.sub(
        r"(?<=digraph _)\d+|(?<=cluster)\d+|(?<=s)\d+(?=in|out|\b)",
        lambda found: names.setdefault(found.group(), f"<{len(names)}>"),
        agent.GetGraphvizString(),
    )
    return sorted(plain.splitlines())


def test_row_the_agent_is_the_same_around_another_body() -> None:
    """The paper: another robot does not touch the two models' levels."""
    assert agent_text(OTHER_BODY) == agent_text("")


def test_row_the_agent_is_not_told_which_robot_it_is_in() -> None:
    """See above: its constructors take nothing of a body but what the prompts may say of one."""
    robot = {field.name for field in dataclasses.fields(CobotMagic)}
    for make in (make_agent, Language, Vision):
        given = set(inspect.signature(make).parameters)
        assert given & (robot | {"robot", "body", "embodiment", "name"}) <= {"can_climb"}


def undeclared(template: str) -> set[str]:
    """Returns the variables that a template reads itself."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(prompts_path()))
    filters = ("quote", "line", "picture", "metres", "bearing")
    environment.filters.update(dict.fromkeys(filters, str))
    source = (prompts_path() / template).read_text(encoding="utf-8")
    return jinja2.meta.find_undeclared_variables(environment.parse(source))


def test_row_templates_name_no_robot_and_read_nothing_of_one() -> None:
    """The paper: the prompts are the same for all robots, byte by byte."""
    fields = {
        field.name
        for kind in (LanguageVariables, VisionVariables)
        for field in dataclasses.fields(kind)
    }
    made = {"feedback", "past", "current", "places", "words", "question", "answer", "expected"}
    templates = sorted(prompts_path().rglob("*.j2"))
    assert len(templates) >= 15
    read: set[str] = set()
    robots = re.compile(
        r"cobot|agilex|unitree|\bg1\b|\bgo1\b|\bgo2\b|quadruped|humanoid|wheel|\buav\b|\bdrone",
        re.IGNORECASE,
    )
    for path in templates:
        name = str(path.relative_to(prompts_path()))
        found = robots.search(path.read_text(encoding="utf-8"))
        assert found is None, f"{name} names {found and found.group()}"
        unknown = undeclared(name) - fields - made
        assert not unknown, f"{name} reads {unknown}"
        read |= undeclared(name)
    assert read >= BODY
    body = {name for name in fields if re.search("climb|degrees|robot|body|speed|radius", name)}
    assert body == BODY


def asked(call: str, *, can_climb: bool = False, degrees: float = 79.0) -> MllmRequest:
    task, todo = TaskSpec("vln", "Go to the sofa."), (TodoItem("Go to it"),)
    if call == "ground":
        return MllmRequest("vision", 4, call=call, variables=VisionVariables(todo=todo))
    focal = 320.0 / math.tan(math.radians(degrees) / 2)
    lens = Intrinsics(640, 480, focal, focal, 319.5, 239.5)
    frames = tuple(Frame(view=d, jpeg=d.encode(), intrinsics=lens) for d in DIRECTIONS)
    return language_request(
        call=call, seed=0, task=task, panorama=Panorama(n=4, frames=frames),
        history=History(n=4), second_chance=SecondChance(4), todo=TodoList(3, todo),
        last_action=LanguageAction(3, "decide", "turn", "left"), can_climb=can_climb,
        free_distance=lambda frame: 2.0, detector=None,
    )  # fmt: skip


@pytest.mark.parametrize("call", [*CALLS, "ground"])
def test_row_prompts_differ_in_stairs_alone(call: str) -> None:
    """See above: a robot that climbs is offered one tool more, and reads no other word."""
    roller, climber = (
        compose_prompt(asked(call, can_climb=climbs)).text.splitlines() for climbs in (False, True)
    )
    more = [line for line in climber if line not in roller]
    assert [line for line in roller if line not in climber] == []
    assert [line for line in climber if line not in more] == roller
    assert all("stair" in line for line in more)
    assert bool(more) is (call != "ground")


@pytest.mark.parametrize("call", CALLS)
def test_row_prompts_tell_of_a_camera_how_wide_it_sees(call: str) -> None:
    """See above: and that is all that a wider lens changes."""
    usual, wide = (
        compose_prompt(asked(call, degrees=degrees)).text.splitlines() for degrees in (79.0, 95.0)
    )
    changed = set(usual) ^ set(wide)
    assert 2 <= len(changed) <= 5
    head = usual.index("HOW THE ROBOT SEES")
    assert changed & set(usual) <= set(usual[head : head + 6])
    assert any("95 degrees wide" in line for line in changed)
