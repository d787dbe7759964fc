"""What prompts tell of people: where the tracker puts them, and in which words."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake import load_scenario
from unilavira_drake.language.people_notes import FORGOTTEN, people_in_view
from unilavira_drake.messages import Panorama
from unilavira_drake.messages.people import PeopleTracks, PersonTrack
from unilavira_drake.people.crowd import with_people
from unilavira_drake.people.tracker import PeopleTracker, follow
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.load import load_world

HERE = Panorama(n=1, X_WB=np.eye(4))


def said(position, velocity=None, view="front", age=0.0):
    track = PersonTrack(7, "blue", position, velocity, 100.0 - age)
    return people_in_view(PeopleTracks((track,)), HERE, view, 100.0)


@pytest.mark.parametrize(
    ("position", "velocity", "words"),
    [
        ((2.0, 0.0), None, "person in blue, 2.0 m"),
        ((2.0, 0.0), (0.0, 0.05), "person in blue, 2.0 m, standing"),
        ((2.0, 0.0), (-1.0, 0.2), "person in blue, 2.0 m, walking towards you"),
        ((2.0, 0.0), (0.8, 0.2), "person in blue, 2.0 m, walking away from you"),
        ((2.0, 0.0), (0.1, 0.9), "person in blue, 2.0 m, walking to the left"),
        ((2.0, 0.0), (0.1, -0.9), "person in blue, 2.0 m, walking to the right"),
        ((3.0, 0.53), (0.0, 0.0), "person in blue, 3.0 m, 10 degrees to the left, standing"),
        ((3.0, -0.53), (0.0, 0.0), "person in blue, 3.0 m, 10 degrees to the right, standing"),
    ],
)
def test_words(position, velocity, words):
    assert said(position, velocity) == (words,)
    # A quarter turn on, the same is said of the next view.
    turned = (-position[1], position[0])
    moved = None if velocity is None else (-velocity[1], velocity[0])
    assert said(turned, moved, "left") == (words,)
    assert said(turned, moved, "front") == ()


def test_who_was_seen_before_is_told_with_the_time_and_then_forgotten():
    assert said((2.0, 0.0), age=4.0) == ("person in blue, 2.0 m, seen 4 s ago",)
    assert said((2.0, 0.0), age=FORGOTTEN + 0.1) == ()


def test_the_nearest_comes_first():
    tracks = PeopleTracks((PersonTrack(1, "red", (4.0, 0.0)), PersonTrack(2, "blue", (2.0, 0.0))))
    first, second = people_in_view(tracks, HERE, "front", 0.0)
    assert ("blue" in first, "red" in second) == (True, True)


def test_a_velocity_needs_two_looks_close_in_time():
    one = follow(None, 1, "red", (0.0, 0.0), 1.0)
    assert one.velocity is None
    two = follow(one, 1, "red", (0.5, 0.0), 1.5)
    assert two.velocity == (1.0, 0.0)
    assert follow(two, 1, "red", (0.5, 0.0), 2.0).velocity == (0.5, 0.0)
    assert follow(two, 1, "red", (0.5, 0.0), 9.0).velocity is None


def test_the_tracker_finds_who_walks_in_view():
    route = {"waypoints": ["6.0,5.2", "10.0,6.0"], "speed": 0.9, "color": "red"}
    scenario = load_scenario("apartment", json.dumps({"people": {"count": 1, "routes": [route]}}))
    world = with_people(load_world("apartment"), scenario.people)
    builder = DiagramBuilder()
    station = builder.AddSystem(make_navigation_station(scenario, start=(3.0, 5.7, 0.0)))
    tracker = builder.AddSystem(
        PeopleTracker(
            clothes={world.label_of("person_1"): "red"},
            intrinsics=front_intrinsics(scenario.robot),
        )
    )
    for port in ("front.depth_image", "front.label_image", "front.X_BC", "pose_estimate"):
        builder.Connect(station.GetOutputPort(port), tracker.GetInputPort(port))
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    inside = station.GetMyMutableContextFromRoot(context)
    station.GetInputPort("base_command").FixValue(inside, np.zeros(3))
    simulator.AdvanceTo(3.0)
    (person,) = station.GetOutputPort("cheat_people").Eval(inside).people
    tracks = tracker.GetOutputPort("people").Eval(tracker.GetMyContextFromRoot(context))
    (track,) = tracks.tracks
    # The look is up to half a second old.
    assert math.dist(track.position, person.position) < 0.6
    assert math.hypot(*track.velocity) == pytest.approx(0.9, abs=0.15)
    assert AbstractValue.Make(tracks).Clone().get_value() is tracks
