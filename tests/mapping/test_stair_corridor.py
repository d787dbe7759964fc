"""The map on stairs: a corridor of free cells, one map for each storey, from rendered depth."""

import dataclasses as dc
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
from unilavira_drake.worlds.world import Box, LabelEntry, WorldObject

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


def test_the_corridor_ends_on_the_level_floor_of_the_next_storey() -> None:
    x, y = STAIRS.point(STAIRS.length + 0.2)
    above = {"place": (x, y, 2.8), "half_width": 0.3}
    assert corridor_at(GOAL, level=0.2, **above) is not None
    assert corridor_at(GOAL, level=0.35, **above) is None
    descent = Goal(0, "descend", p_WG=(*STAIRS.head, 2.8), heading=-STAIRS.heading)
    below = (*STAIRS.point(-0.3), 0.0)
    assert corridor_at(descent, below, half_width=0.3, level=0.35) is None
    # A landing halfway is no storey.
    assert corridor_at(GOAL, (x, y, 1.4), half_width=0.3, level=0.8) is not None


class Climb:
    """A robot that is set on the stairs, step by step, under a mapper."""

    def __init__(self, world) -> None:
        scenario = Scenario(world=WorldChoice("two_storey"), robot=UnitreeG1(can_climb=True))
        scenario.task.text, scenario.task.start = "Go up.", "hall"
        builder = DiagramBuilder()
        self.world = world
        self.station = builder.AddSystem(make_navigation_station(scenario, world=world))
        lens = front_intrinsics(scenario.robot)
        self.mapper = builder.AddSystem(
            OccupancyMapper(intrinsics=lens, stride=4, footprint_radius=0.3)
        )
        for port in ("front.depth_image", "front.X_BC", "pose_estimate"):
            builder.Connect(self.station.GetOutputPort(port), self.mapper.GetInputPort(port))
        self.simulator = Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        self.plant = self.station.GetSubsystemByName("plant")
        self.at = self.mapper.GetMyMutableContextFromRoot(self.root)
        there = self.station.GetMyMutableContextFromRoot(self.root)
        self.mapper.GetInputPort("panorama").FixValue(self.at, AbstractValue.Make(Panorama()))
        self.mapper.GetInputPort("goal").FixValue(self.at, AbstractValue.Make(GOAL))
        self.station.GetInputPort("base_command").FixValue(there, np.zeros(3))

    def stand(self, s):
        """Returns the map after a look from there."""
        inside = self.plant.GetMyMutableContextFromRoot(self.root)
        model = self.plant.GetModelInstanceByName("unitree_g1")
        x, y = STAIRS.point(s)
        z = self.world.ground_height(x, y, STAIRS.height(x, y))
        for name, value in (
            ("base_x", x),
            ("base_y", y),
            ("base_yaw", math.pi / 2),
            ("base_height", z),
        ):
            joint = self.plant.GetJointByName(name, model)
            setter = joint.set_angle if name == "base_yaw" else joint.set_translation
            setter(inside, value)
        self.simulator.AdvanceTo(self.root.get_time() + 0.1)
        return self.mapper.GetOutputPort("map").Eval(self.at)


def test_a_low_box_on_the_floor_above_is_an_obstacle() -> None:
    x, y = STAIRS.point(STAIRS.length + 1.4)
    box = Box((x, y, 2.8 + 0.15), (0.4, 0.4, 0.3))
    thing = WorldObject("box_1", "box", "red", "landing", (box,))
    labels = HOUSE.labels | {max(HOUSE.labels) + 1: LabelEntry("box", "box_1")}
    house = dc.replace(HOUSE, objects=(*HOUSE.objects, thing), labels=labels)
    climb = Climb(house)
    for s in np.arange(-0.6, STAIRS.length + 0.5, 0.16):
        occupancy = climb.stand(float(s))
    assert occupancy.state_at(x, y - 0.2) == "occupied"
    assert occupancy.state_at(*STAIRS.point(STAIRS.length + 0.8)) == "free"


def test_one_map_for_each_storey() -> None:
    climb, seen = Climb(HOUSE), {}
    for s in np.arange(-2.0, STAIRS.length + 1.2, 0.2):
        seen[round(float(s), 1)] = climb.stand(float(s))
    # From the ground the steps are an obstacle; on the stairs they are the way.
    step = STAIRS.point(0.5)
    assert seen[-1.0].state_at(*step) == "occupied"
    assert seen[0.0].state_at(*step) == "free"
    storeys = climb.mapper.storeys(climb.at)
    assert [round(one.height, 1) for one in storeys] == [0.0, 2.8]
    assert all(one.settled for one in storeys)
    versions = [one.version for one in seen.values()]
    assert versions == sorted(versions)
    # What lies beside and beyond the stairs was left to later looks.
    ground, upper = (one.occupancy for one in storeys)
    assert ground.state_at(6.0, 1.5) != "occupied"
    assert upper.state_at(*STAIRS.point(STAIRS.length + 0.5)) == "free"
    assert upper.state_at(6.0, 1.5) == "unknown"
