"""People cross a driving robot's way: it stops, goes on, and nobody is touched."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drive import Drive
from pydrake.systems.analysis import Simulator

ALONG = {"start": (3.0, 5.7, 0.0), "goal": (11.0, 5.7)}
# They rest until the robot has passed: nothing helps against who walks into its side.
SLOWLY = {"waypoints": ["7.6,4.2", "7.6,6.0"], "speed": 0.5, "pause": 9.0, "delay": 2.5}
CROSSING = {"waypoints": ["7.6,4.2", "6.5,7.6"], "speed": 1.0, "pause": 3.0, "delay": 2.0}


def stops(log):
    """Times at which the robot came to rest on its way."""
    speed = np.abs(log.speeds)
    return [log.times[k] for k in range(15, len(speed) - 15) if speed[k] < 0.05 <= speed[k - 1]]


@pytest.fixture(scope="module")
def crossed():
    # Someone who does not care for the robot: it is the governor's to stop.
    people = {"count": 1, "polite": False, "routes": [SLOWLY]}
    return Drive(**ALONG, people=people).run(40.0)


def test_the_governor_stops_for_who_crosses_and_goes_on_after(crossed):
    assert stops(crossed)
    assert crossed.state == "arrived"
    assert not crossed.touched
    assert min(crossed.gaps) > 0.1


def test_it_stood_because_of_the_person(crossed):
    k = crossed.times.index(stops(crossed)[0])
    (person,) = crossed.people[k]
    x, y = crossed.positions[k]
    assert 0.0 < person[0] - x < 2.0
    assert abs(person[1] - y) < 1.2


def test_without_anybody_it_drives_through():
    people = {"count": 1, "routes": [{"waypoints": ["bathroom", "6.0,8.4"], "delay": 999.0}]}
    log = Drive(**ALONG, people=people).run(40.0)
    assert (log.state, stops(log)) == ("arrived", [])


@pytest.mark.parametrize("delay", [3.0, 4.0])
def test_polite_people_and_the_robot_never_touch(delay):
    people = {"count": 1, "routes": [{**CROSSING, "delay": delay}]}
    log = Drive(**ALONG, people=people).run(40.0)
    assert (log.state, log.touched) == ("arrived", False)
    assert min(log.gaps) > 0.05


# With 1.0 and 1.1 m/s they meet where the walk ends, and nobody turns back from there.
@pytest.mark.parametrize("speed", [0.9, 1.2])
def test_who_comes_head_on_in_the_corridor_turns_back_in_the_end(speed):
    people = {"count": 1, "routes": [{"waypoints": ["10.5,5.7", "4,5.7"], "speed": speed}]}
    log = Drive(**ALONG, people=people).run(60.0)
    assert (log.state, log.touched) == ("arrived", False)


@pytest.mark.parametrize("seed", range(5))
def test_three_people_and_the_robot_pass_each_other(seed):
    # Speeds and rests are drawn; two cross the corridor and one walks along it.
    people = {
        "count": 3,
        "seed": seed,
        "routes": [
            {"waypoints": ["kitchen", "bathroom"]},
            {"waypoints": ["study", "living_room"]},
            {"waypoints": ["13.5,6.0", "8.0,5.4"]},
        ],
    }
    log = Drive(**ALONG, people=people).run(90.0)
    assert (log.state, log.touched) == ("arrived", False)


def test_the_map_keeps_who_stands_behind_the_robot_until_it_looks_there():
    # It sees somebody ahead, and turns its only camera away to drive a little back.
    people = {
        "count": 1,
        "polite": False,
        "routes": [{"waypoints": ["4.1,5.7", "10.0,5.7"], "delay": 9.0}],
    }
    drive = Drive((3.0, 5.7, 0.0), (2.75, 5.7), people)
    log = drive.run(8.9, until_arrived=False)
    assert log.people[-1] == log.people[0]
    x, y = log.people[-1][0]
    assert drive.read(drive.navigation, "map").state_at(x, y) == "occupied"


def test_impolite_people_push_and_are_felt():
    # The robot stands; its goal is where it is.
    people = {
        "count": 1,
        "polite": False,
        "routes": [{"waypoints": ["6.0,5.7", "2.0,5.7"], "speed": 1.0}],
    }
    drive = Drive((3.5, 5.7, 0.0), (3.5, 5.7), people)
    log = drive.run(4.0, until_arrived=False)
    assert log.touched
    assert min(log.gaps) < 0.02
    contacts = drive.read(drive.station, "contact_results")
    force = contacts.point_pair_contact_info(0).contact_force()
    assert 20.0 < math.hypot(*force) < 400.0


def test_a_clone_walks_and_drives_alike():
    people = {"count": 2, "routes": [CROSSING]}
    drive = Drive(**ALONG, people=people)
    drive.simulator.AdvanceTo(3.0)
    other = Simulator(drive.diagram, drive.context.Clone())
    ends = []
    for simulator in (drive.simulator, other):
        simulator.AdvanceTo(6.0)
        plant = drive.station.GetSubsystemByName("plant")
        context = plant.GetMyContextFromRoot(simulator.get_context())
        ends.append(plant.GetPositionsAndVelocities(context))
    np.testing.assert_array_equal(*ends)
