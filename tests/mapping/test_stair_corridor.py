"""The map on stairs: a corridor of free cells, one map for each storey, from rendered depth."""

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from rendered_stairs import frames

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.stair_corridor import corridor_at
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import Goal, OccupancyMap, Panorama
from unilavira_drake.robots.unitree_g1 import UnitreeG1
from unilavira_drake.scenario import Scenario, WorldChoice
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.load import load_world

HOUSE = load_world("two_storey")
STAIRS = HOUSE.stairs[0]
GOAL = Goal(0, "climb", p_WG=(*STAIRS.foot, 0.0), heading=STAIRS.heading)


def corridor(s, across=0.0, goal=GOAL):
    x, y = STAIRS.point(s, across)
    return corridor_at(goal, (x, y, STAIRS.height(x, y)), half_width=0.3)


def test_the_corridor_is_where_the_stairs_are() -> None:
    assert corridor(-1.2) is None
    assert corridor(1.0, across=0.7) is None
    assert corridor(-0.5).slope == pytest.approx(0.7)
    assert corridor(2.0).slope == pytest.approx(2.8 / 3.92, abs=1e-6)
    descent = Goal(0, "descend", p_WG=(*STAIRS.head, 2.8), heading=-STAIRS.heading)
    assert corridor(2.0, goal=descent).slope == 0.0
    assert corridor_at(GOAL, (math.nan, 0.0, 0.0), half_width=0.3) is None


@pytest.mark.parametrize("s", [0.0, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("up", [True, False])
def test_steps_are_no_obstacle_and_who_stands_on_them_is(s: float, up: bool) -> None:
    x, y = STAIRS.point(s)
    z = STAIRS.height(x, y)
    goal = GOAL
    if not up:
        goal = Goal(0, "descend", p_WG=(*STAIRS.head, 2.8), heading=-STAIRS.heading)
    here = corridor_at(goal, (x, y, z), half_width=0.3)
    assert here is not None
    (frame,) = frames(HOUSE, [(x, y, z, goal.heading)], 1.0)
    view = DepthView.of(frame)
    assert not here.seen(view).depth.any()
    # A board a metre ahead, upright and as wide as the picture.
    board = DepthView(np.minimum(view.depth, np.float32(1.0)), view.intrinsics, view.X_WC)
    assert np.count_nonzero(here.seen(board).depth) > 500


def test_cells_around_the_robot_are_freed_and_no_others() -> None:
    blocked = OccupancyMap(n=3, version=2, origin=(0, 0), log_odds=np.full((200, 200), 20, np.int8))
    x, y = STAIRS.point(1.0)
    here = corridor_at(GOAL, (x, y, 0.7), half_width=0.3)
    freed = here.freed(blocked)
    assert (freed.n, freed.version, freed.shape) == (3, 2, blocked.shape)
    for s, across, state in (
        (1.0, 0.0, "free"),
        (2.3, 0.2, "free"),
        (0.6, -0.2, "free"),
        (2.7, 0.0, "occupied"),
        (1.0, 0.4, "occupied"),
        (0.2, 0.0, "occupied"),
    ):
        assert freed.state_at(*STAIRS.point(s, across)) == state, (s, across)


def test_one_map_for_each_storey() -> None:
    scenario = Scenario(world=WorldChoice("two_storey"), robot=UnitreeG1(can_climb=True))
    scenario.task.text, scenario.task.start = "Go up.", "hall"
    builder = DiagramBuilder()
    station = builder.AddSystem(make_navigation_station(scenario, world=HOUSE))
    lens = front_intrinsics(scenario.robot)
    mapper = builder.AddSystem(OccupancyMapper(intrinsics=lens, stride=4, footprint_radius=0.3))
    for port in ("front.depth_image", "front.X_BC", "pose_estimate"):
        builder.Connect(station.GetOutputPort(port), mapper.GetInputPort(port))
    simulator = Simulator(builder.Build())
    root, plant = simulator.get_mutable_context(), station.GetSubsystemByName("plant")
    at, there, inside = (one.GetMyMutableContextFromRoot(root) for one in (mapper, station, plant))
    mapper.GetInputPort("panorama").FixValue(at, AbstractValue.Make(Panorama()))
    mapper.GetInputPort("goal").FixValue(at, AbstractValue.Make(GOAL))
    station.GetInputPort("base_command").FixValue(there, np.zeros(3))
    model = plant.GetModelInstanceByName("unitree_g1")
    seen = {}
    for s in np.arange(-2.0, STAIRS.length + 1.2, 0.2):
        x, y = STAIRS.point(s)
        z = HOUSE.ground_height(x, y, STAIRS.height(x, y))
        for name, value in (
            ("base_x", x),
            ("base_y", y),
            ("base_yaw", math.pi / 2),
            ("base_height", z),
        ):
            joint = plant.GetJointByName(name, model)
            setter = joint.set_angle if name == "base_yaw" else joint.set_translation
            setter(inside, value)
        simulator.AdvanceTo(root.get_time() + 0.1)
        seen[round(float(s), 1)] = mapper.GetOutputPort("map").Eval(at)
    # From the ground the steps are an obstacle; on the stairs they are the way.
    step = STAIRS.point(0.5)
    assert seen[-1.0].state_at(*step) == "occupied"
    assert seen[0.0].state_at(*step) == "free"
    storeys = mapper.storeys(at)
    assert [round(one.height, 1) for one in storeys] == [0.0, 2.8]
    assert all(one.settled for one in storeys)
    versions = [one.version for one in seen.values()]
    assert versions == sorted(versions)
    # What lies beside and beyond the stairs was left to later looks.
    ground, upper = (one.occupancy for one in storeys)
    assert ground.state_at(6.0, 1.5) != "occupied"
    assert upper.state_at(*STAIRS.point(STAIRS.length + 0.5)) == "free"
    assert upper.state_at(6.0, 1.5) == "unknown"
