"""A robot upstairs and people downstairs: they are no neighbours."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.analysis import Simulator

from unilavira_drake.people.config import PeopleConfig, WalkRoute
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario import Scenario, WorldChoice
from unilavira_drake.station import make_navigation_station

PLACE = (6.2, 4.0)


def station_at(height):
    """A robot that stands over, or beside, a person's walk through the room below."""
    x, y = PLACE
    route = WalkRoute(waypoints=[f"{x},{y - 1.5}", f"{x},{y + 1.2}"], speed=1.0, pause=9.0)
    scenario = Scenario(world=WorldChoice("two_storey"), robot=UnitreeGo1(can_climb=True))
    scenario.people = PeopleConfig(count=1, routes=[route])
    return make_navigation_station(scenario, start=(x, y, 0.0), start_height=height)


def walked(height):
    station = station_at(height)
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("base_command").FixValue(context, np.zeros(3))
    simulator.AdvanceTo(3.5)
    return station.GetOutputPort("cheat_people").Eval(context)


def test_who_is_below_a_robot_upstairs_is_not_near_and_does_not_wait() -> None:
    upstairs = walked(2.8)
    assert upstairs.gap == math.inf
    assert upstairs.people[0].position[1] > PLACE[1] + 0.9
    beside = walked(0.0)
    assert 0.0 < beside.gap < 1.5
    assert beside.people[0].position[1] < PLACE[1]
