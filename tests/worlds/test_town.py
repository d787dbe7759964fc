"""The town: what its file promises, and what its tasks say."""

import math
from itertools import combinations

import numpy as np
import pytest

from unilavira_drake.evaluation.air_goal import AirGoal, make_goal, path_type
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.sensors.color_names import color_word
from unilavira_drake.tasks import success_rule
from unilavira_drake.worlds.air_clearance import box_distances, solids
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.outdoors.materials import FACADES, ROOFS
from unilavira_drake.worlds.outdoors.things import Building
from unilavira_drake.worlds.scenery import scenery_triangles
from unilavira_drake.worlds.start import parse_start, parse_start_pose

TOWN = load_world("town")
TASKS = load_scenario("town").tasks
RADIUS = 0.6
RULE = success_rule("aerial_vln")


def goal_of(name):
    goal = make_goal(TASKS[name].goal, TOWN, RULE, radius=0.3)
    assert isinstance(goal, AirGoal)
    return goal


def start_of(name):
    return parse_start_pose(TASKS[name].start, TOWN, radius=RADIUS)


def test_it_is_large_enough_and_full():
    x_min, y_min, x_max, y_max = TOWN.bounds
    assert x_max - x_min >= 300.0
    assert y_max - y_min >= 300.0
    assert len(TOWN.objects) >= 180
    assert len({thing.category for thing in TOWN.objects}) >= 40
    assert sum(isinstance(thing.visual, Building) for thing in TOWN.objects) >= 80


def test_districts_tile_the_town():
    x_min, y_min, x_max, y_max = TOWN.bounds
    area = sum((r[2] - r[0]) * (r[3] - r[1]) for r in (room.rectangle for room in TOWN.rooms))
    assert area == pytest.approx((x_max - x_min) * (y_max - y_min))
    for x, y in np.random.default_rng(0).uniform((x_min, y_min), (x_max, y_max), (300, 2)):
        assert sum(room.contains(x, y) for room in TOWN.rooms) == 1


def test_every_thing_and_every_piece_of_ground_has_its_label():
    names = [entry.instance for entry in TOWN.labels.values()]
    assert len(set(names)) == len(names)
    assert {thing.name for thing in TOWN.objects} <= set(names)
    for thing in TOWN.objects:
        label = TOWN.label_of(thing.name)
        assert TOWN.labels[label].category == thing.category
        assert thing.color
        assert thing.room


def test_buildings_and_vehicles_keep_apart():
    solid = {
        thing.name: np.array([corner for box in thing.boxes for corner in box.corners()])
        for thing in TOWN.objects
        if isinstance(thing.visual, Building) or thing.category in ("car", "van", "truck", "bus")
    }
    boxes = {name: (p.min(axis=0), p.max(axis=0)) for name, p in solid.items()}
    for (a, (a_low, a_high)), (b, (b_low, b_high)) in combinations(boxes.items(), 2):
        gap = np.maximum(a_low - b_high, b_low - a_high).max()
        # The wing of the school and the tower of the fire station lean on their houses.
        assert gap > -0.01 or {a, b} == {"school", "school_wing"}, (a, b, gap)


def test_no_building_stands_on_a_road():
    roads = [patch.rectangle for patch in TOWN.ground if patch.category in ("road", "pavement")]
    for thing in TOWN.objects:
        if isinstance(thing.visual, Building):
            corners = np.array([corner for box in thing.boxes for corner in box.corners()])
            (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
            for a0, b0, a1, b1 in roads:
                assert x0 >= a1 or x1 <= a0 or y0 >= b1 or y1 <= b0, thing.name


def test_materials_show_their_colour_words():
    for material in FACADES.values():
        for shade in (0.78, 0.9, 1.0):
            assert color_word(tuple(shade * part for part in material.color)) == material.word
    for word, color in ROOFS.items():
        assert color_word(color) == word


def test_what_has_to_be_drawn_is_bounded():
    assert scenery_triangles(TOWN) < 80_000
    assert len(solids(TOWN)) < 1500


def test_the_parks_look_alike_from_above_and_differ_below():
    def content(park, x0, y0):
        middles = [(t, t.boxes[0].center) for t in TOWN.objects if t.name.startswith(f"{park}_")]
        return {(t.category, round(x - x0, 3), round(y - y0, 3)) for t, (x, y, _) in middles}

    west, east = content("west", 2.0, 76.0), content("east", 345.0, 214.0)
    high = {"tree", "conifer", "pavilion", "boat", "bench", "bush"}
    shared = {entry for entry in west & east if entry[0] in high}
    assert len(shared) >= 10
    assert TOWN.object("west_statue").color != TOWN.object("east_statue").color
    assert TOWN.object("west_boat").color != TOWN.object("east_boat").color
    assert TOWN.object("west_park_swings").category != TOWN.object("east_park_stalls").category


def test_there_are_easy_and_hard_directives():
    assert len(TASKS) >= 10
    kinds = [name.split("_")[0] for name in TASKS]
    assert min(kinds.count("easy"), kinds.count("hard")) >= 5
    assert set(kinds) == {"easy", "hard"}
    assert all(task.family == "aerial_vln" for task in TASKS.values())


@pytest.mark.parametrize("name", TASKS)
def test_a_directive_is_as_long_as_its_name_and_its_text_say(name):
    x, y, z, yaw = start_of(name)
    goal = goal_of(name)
    way = goal.way_from(x, y, z)
    straight = goal.distance(x, y, z)
    assert straight <= way + 1e-9 < 1.2 * straight
    assert 80.0 <= way <= 450.0
    assert path_type(way) == name.split("_")[0]
    words = TASKS[name].text.split()
    told = float(words[words.index("metres") - 1])
    assert abs(told - straight) <= max(10.0, 0.05 * straight)
    place_x, place_y = goal.places[0]
    left = math.degrees(math.remainder(math.atan2(place_y - y, place_x - x) - yaw, math.tau))
    text = TASKS[name].text.split(".")[0]
    said = 0.0
    if "degrees to your" in text:
        side = 1.0 if "to your left" in text else -1.0
        said = side * float(text.split(" degrees")[0].split()[-1])
    elif "a little" in text:
        said = 15.0 if "left" in text else -15.0
    assert abs(said - left) <= 16.0


@pytest.mark.parametrize("name", TASKS)
def test_a_start_is_in_free_air_and_a_goal_can_be_flown_to(name):
    x, y, z, _ = start_of(name)
    assert box_distances(np.array([[x, y, z]]), (box for _, box in solids(TOWN)))[0] >= RADIUS
    assert z >= 5.0
    goal = goal_of(name)
    assert goal.targets[0].kind == "instance"
    assert goal.distance(x, y, z) > RULE.radius + 30.0


def test_landmarks_named_in_the_texts_are_the_only_ones_of_their_kind():
    for category in ("church", "town hall", "supermarket", "water tower", "bank", "barn", "cinema"):
        assert [t.category for t in TOWN.objects].count(category) == 1, category
    for category, color in (("van", "red"), ("van", "purple"), ("car", "green"), ("car", "orange")):
        same = [t.name for t in TOWN.objects if (t.category, t.color) == (category, color)]
        assert len(same) == 1, (category, color, same)


def test_a_mirrored_town_is_the_town_with_y_negated():
    mirror = load_world("town", mirror=True)
    for patch, image in zip(TOWN.ground, mirror.ground, strict=True):
        x0, y0, x1, y1 = patch.rectangle
        assert image.rectangle == (x0, -y1, x1, -y0)
    for thing, image in zip(TOWN.objects, mirror.objects, strict=True):
        for box, other in zip(thing.boxes, image.boxes, strict=True):
            assert other.center == (box.center[0], -box.center[1], box.center[2])
    for name, task in TASKS.items():
        x, y, z, yaw = start_of(name)
        assert parse_start_pose(task.start, mirror, radius=RADIUS) == (x, -y, z, -yaw)


def test_a_robot_on_the_ground_can_stand_there():
    x, y, _ = parse_start("market_quarter", TOWN, radius=0.36)
    assert TOWN.room_at(x, y).name == "market_quarter"
    assert parse_start("210,40,1.57", TOWN, radius=0.36) == (210.0, 40.0, 1.57)
