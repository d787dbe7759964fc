"""The things to find and the questions of the apartment hold for the world as it is."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from unilavira_drake import load_scenario
from unilavira_drake.evaluation.answers import is_correct
from unilavira_drake.evaluation.scoring import make_goal_field, shortest_path
from unilavira_drake.scenario import NamedTask
from unilavira_drake.task_choice import choose_task
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start
from unilavira_drake.worlds.world import WorldObject

WORLD = load_world("apartment")
FINDS = load_scenario("apartment_objectnav")
QUESTIONS = load_scenario("apartment_eqa")
KINDS = {"color": 5, "location": 5, "color_room": 5, "count": 5, "existence": 4}
SOUGHT = {
    "television_in_bedroom": "television",
    "washing_machine_in_bathroom": "washing machine",
    "dining_room_chairs": "chair",
    "living_room_sofas": "sofa",
    "storage_room_boxes": "box",
    "bedroom_nightstands": "nightstand",
    "apartment_armchairs": "armchair",
}


def start_and_way(scenario_task: NamedTask) -> tuple[str, float]:
    x, y, _ = parse_start(scenario_task.start, WORLD, radius=FINDS.robot.turning_radius)
    room = WORLD.room_at(x, y)
    assert room is not None
    goal = make_goal_field(scenario_task.goal, WORLD, radius=FINDS.robot.radius)
    return room.name, shortest_path(goal, x, y)


def thing(name: str) -> WorldObject:
    found = WORLD.object(name)
    assert found is not None, name
    return found


def place(name: str) -> tuple[float, float]:
    x, y = np.mean([box.center[:2] for box in thing(name).boxes], axis=0)
    return float(x), float(y)


def test_ten_things_are_each_eight_metres_away_in_another_room() -> None:
    assert len(FINDS.tasks) == 10
    for name, task in FINDS.tasks.items():
        room, way = start_and_way(task)
        assert task.family == "objectnav"
        assert 8.0 <= way < 25.0, name
        assert all(thing(goal).room != room for goal in task.goal.split("|")), name


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("refrigerator", "refrigerator"),
        ("toilet", "toilet"),
        ("bed", "bed"),
        ("couch", "sofa"),
        ("bike", "bicycle"),
        ("computer_screen", "monitor"),
    ],
)
def test_every_instance_of_a_category_is_a_goal(name: str, category: str) -> None:
    instances = {thing.name for thing in WORLD.objects if thing.category == category}
    assert set(FINDS.tasks[name].goal.split("|")) == instances


@pytest.mark.parametrize(
    ("name", "category", "color"),
    [("red_chair", "chair", "red"), ("orange_armchair", "armchair", "orange")],
)
def test_an_attribute_tells_one_from_others(name: str, category: str, color: str) -> None:
    same = [thing for thing in WORLD.objects if thing.category == category]
    assert len(same) > 2
    assert [thing.name for thing in same if thing.color == color] == [FINDS.tasks[name].goal]


def test_a_relation_tells_one_from_others() -> None:
    chairs = [thing.name for thing in WORLD.objects if thing.category == "chair"]
    ways = {name: math.dist(place(name), place("piano_1")) for name in chairs}
    nearest, second = sorted(ways, key=lambda name: ways[name])[:2]
    assert FINDS.tasks["chair_next_to_piano"].goal == nearest
    assert ways[nearest] < 1.6 < 1.3 * ways[nearest] < ways[second]
    lamp = place("table_lamp_1")
    under = [
        thing.name
        for thing in WORLD.objects
        if thing.category == "nightstand" and math.dist(place(thing.name), lamp) < 0.2
    ]
    assert under == [FINDS.tasks["nightstand_with_lamp"].goal]


def test_there_are_twenty_four_questions_of_five_kinds() -> None:
    assert Counter(task.question_type for task in QUESTIONS.tasks.values()) == KINDS
    texts = [task.text for task in QUESTIONS.tasks.values()]
    assert len(set(texts)) == 24
    assert all(text.endswith("?") for text in texts)
    for name, task in QUESTIONS.tasks.items():
        room, _ = start_and_way(task)
        assert room not in task.goal, name


@pytest.mark.parametrize("name", QUESTIONS.tasks)
def test_an_answer_is_one_of_its_choices_and_accepted(name: str) -> None:
    QUESTIONS.task.text = f"@{name}"
    task = choose_task(QUESTIONS)
    assert task.rule.by_answer
    assert task.spec.answer_type == ("open" if name in COUNTS else "closed")
    assert name in COUNTS or task.answers[0] in task.spec.choices
    for answer in task.answers:
        assert is_correct(f"It is {answer}.", task.answers, task.spec.choices)
    others = [choice for choice in task.spec.choices if choice != task.answers[0]]
    assert not any(is_correct(choice, task.answers, task.spec.choices) for choice in others)


COUNTS = [n for n, task in QUESTIONS.tasks.items() if task.question_type == "count"]


def of_kind(*kinds: str) -> list[str]:
    return [name for name, task in QUESTIONS.tasks.items() if task.question_type in kinds]


@pytest.mark.parametrize("name", of_kind("color", "color_room"))
def test_a_color_is_that_of_the_only_such_thing_there(name: str) -> None:
    task = QUESTIONS.tasks[name]
    asked = thing(task.goal)
    assert task.answer == asked.color
    rooms = (asked.room,) if task.question_type == "color_room" else WORLD_ROOMS
    same = [t for t in WORLD.objects if t.category == asked.category and t.room in rooms]
    assert same == [asked]
    if task.question_type == "color_room":
        others = {t.color for t in WORLD.objects if t.category == asked.category}
        assert len(others) > 1


WORLD_ROOMS = tuple(room.name for room in WORLD.rooms)


@pytest.mark.parametrize("name", of_kind("location"))
def test_a_location_is_the_room_of_the_only_such_thing(name: str) -> None:
    task = QUESTIONS.tasks[name]
    asked = thing(task.goal)
    room = WORLD.room(asked.room)
    assert room is not None
    assert task.answer == room.kind
    assert [t for t in WORLD.objects if t.category == asked.category] == [asked]
    assert set(task.choices) == {room.kind for room in WORLD.rooms}


@pytest.mark.parametrize("name", of_kind("count", "existence"))
def test_a_count_and_a_presence_are_those_of_the_world(name: str) -> None:
    task = QUESTIONS.tasks[name]
    if name in SOUGHT:
        rooms = WORLD_ROOMS if "apartment" in name else (task.goal,)
        number = sum(t.category == SOUGHT[name] and t.room in rooms for t in WORLD.objects)
    else:
        asked = thing(task.goal)
        assert asked.category in task.text
        number = 1
    assert task.answer == (str(number) if task.question_type == "count" else ("no", "yes")[number])
