"""Who walks where: seeds, free floor, and what a wrong walk is told."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from unilavira_drake.errors import ScenarioError
from unilavira_drake.people.config import PeopleConfig, WalkRoute
from unilavira_drake.people.crowd import (
    CLEARANCE,
    SHORTEST_WALK,
    START_DISTANCE,
    make_crowd,
    with_people,
)
from unilavira_drake.people.figure import figure
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.load import load_world

APARTMENT = load_world("apartment")
ROBOT = (2.9, 8.2)


def crowd(config, world=APARTMENT, seed=0):
    return make_crowd(config, with_people(world, config), seed=seed, robot=ROBOT)


def dense(walk):
    """Points every 2 cm of a walk."""
    points = []
    for a, b in itertools.pairwise(walk):
        count = max(2, math.ceil(math.dist(a, b) / 0.02))
        points.append(np.linspace(a, b, count))
    return np.concatenate(points)


def test_nobody_leaves_the_world_as_it_is():
    config = PeopleConfig()
    assert with_people(APARTMENT, config) is APARTMENT
    assert crowd(config) == ()


def test_people_get_labels_of_their_own():
    world = with_people(APARTMENT, PeopleConfig(count=2))
    new = {k: entry for k, entry in world.labels.items() if k not in APARTMENT.labels}
    assert [(e.category, e.instance) for e in new.values()] == [
        ("person", "person_1"),
        ("person", "person_2"),
    ]
    assert {k: world.labels[k] for k in APARTMENT.labels} == APARTMENT.labels


@pytest.mark.parametrize("seed", range(3))
def test_drawn_walks_keep_clear_of_everything_and_of_the_robot(seed):
    people = crowd(PeopleConfig(count=4), seed=seed)
    for person in people:
        # Half a cell: the ways run through the middles of free cells.
        assert clearance(APARTMENT, dense(person.walk)).min() > CLEARANCE - 0.06
        assert math.dist(person.walk[0], ROBOT) >= START_DISTANCE
        assert math.dist(person.walk[0], person.walk[-1]) >= SHORTEST_WALK
        assert 0.6 <= person.speed <= 1.2
    assert len({person.color for person in people}) == len(people)


def test_the_seed_decides_and_its_own_one_comes_first():
    config = PeopleConfig(count=3)
    assert crowd(config, seed=1) == crowd(config, seed=1)
    assert crowd(config, seed=1) != crowd(config, seed=2)
    own = dataclasses.replace(config, seed=5)
    assert crowd(own, seed=1) == crowd(own, seed=2) == crowd(config, seed=5)


def test_a_named_walk_leads_through_the_doors():
    route = WalkRoute(waypoints=["kitchen", "9.2,8.4"], speed=1.1, pause=2.0, color="red")
    (person,) = crowd(PeopleConfig(count=1, routes=[route]))
    rooms = [APARTMENT.room_at(x, y).name for x, y in dense(person.walk)]
    assert list(dict.fromkeys(rooms)) == ["kitchen", "corridor", "study"]
    assert (person.speed, person.pauses, person.color) == (1.1, (2.0,), "red")


def test_a_mirrored_world_mirrors_named_walks():
    config = PeopleConfig(count=1, routes=[WalkRoute(waypoints=["6.0,5.7", "12.0,5.7"])])
    world = with_people(load_world("apartment", mirror=True), config)
    (person,) = make_crowd(config, world, seed=0, robot=(2.9, -8.2))
    assert person.walk[0] == (6.0, -5.7)
    assert person.walk[-1] == (12.0, -5.7)


@pytest.mark.parametrize(
    ("config", "words"),
    [
        (PeopleConfig(count=1, routes=[WalkRoute(["kitchen"])]), "two waypoints"),
        (PeopleConfig(count=1, routes=[WalkRoute(["kitchen", "cellar"])]), "cellar"),
        (PeopleConfig(count=1, routes=[WalkRoute(["kitchen", "1,a"])]), "not X,Y"),
        (PeopleConfig(count=1, routes=[WalkRoute(["kitchen", "2.6,2.0"])]), "not free floor"),
        (PeopleConfig(count=0, routes=[WalkRoute(["kitchen", "study"])]), ""),
        (PeopleConfig(count=1, routes=[WalkRoute(["kitchen", "study"])] * 2), "people.count: 2"),
        (
            PeopleConfig(count=1, routes=[WalkRoute(["kitchen", "study"], color="mauve")]),
            "mauve",
        ),
    ],
)
def test_what_is_wrong_is_said(config, words):
    if not words:
        assert crowd(config) == ()
        return
    with pytest.raises(ScenarioError, match=words):
        crowd(config)


def test_a_waypoint_upstairs_is_refused():
    house = load_world("two_storey")
    route = WalkRoute(waypoints=["hall", "library"])
    with pytest.raises(ScenarioError, match=r"library.* 2\.8 m.*study") as error:
        crowd(PeopleConfig(count=1, routes=[route]), house)
    assert "people.routes.0.waypoints" in str(error.value)
    assert "bathroom" not in str(error.value)


def test_drawn_walks_lead_from_room_to_room_of_the_ground_floor_alone():
    house = load_world("two_storey")
    ground = tuple(room for room in house.rooms if room.elevation == 0.0)
    alone = dataclasses.replace(house, rooms=ground)
    config = PeopleConfig(count=4)
    for seed in range(3):
        assert crowd(config, house, seed) == crowd(config, alone, seed)


def test_a_figure_stands_on_the_floor_and_is_as_tall_as_it_says():
    (person,) = crowd(PeopleConfig(count=1))
    z = [ring[0] for part in figure(person) if part.limb == "body" for ring in part.rings]
    assert max(z) == pytest.approx(1.78, abs=0.02)
    legs = [ring[0] for part in figure(person) if part.limb == "left_leg" for ring in part.rings]
    assert min(legs) == pytest.approx(-0.88)
    assert {part.limb for part in figure(person)} == {
        "body",
        "left_leg",
        "right_leg",
        "left_arm",
        "right_arm",
    }
