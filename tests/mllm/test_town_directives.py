"""The named flights of ``town``: the last leg that is read of each ends at its goal."""

import pytest

from unilavira_drake import load_scenario
from unilavira_drake.mllm.rules.flight.legs import describe
from unilavira_drake.mllm.rules.flight.parser import parse_directive, plan_legs
from unilavira_drake.mllm.rules.flight.words import color_match, landmark_class, landmark_match
from unilavira_drake.worlds.load import load_world

TOWN = load_scenario("town")
FLIGHTS = {name: task for name, task in TOWN.tasks.items() if task.family == "aerial_vln"}
WORLD = load_world("town")


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_last_landmark_is_the_goal(name):
    task = FLIGHTS[name]
    legs = plan_legs(task.text, 10.0)
    goal = next(thing for thing in WORLD.objects if thing.name == task.goal)
    last = next(leg for leg in reversed(legs) if leg.landmark and leg.hard)
    assert last.kind == "stop", [describe(leg) for leg in legs]
    assert landmark_match(last.landmark, landmark_class(goal.category)) == 2
    assert color_match(last.color, goal.color)
    assert legs[0].kind == "heading"
    assert all(parse_directive(describe(leg)) == (leg,) for leg in legs)


def test_every_category_of_the_town_can_be_named():
    for category in {label.category for label in WORLD.labels.values()} - {"floor"}:
        (leg,) = parse_directive(f"Stop at the {category}")
        assert landmark_match(leg.landmark, landmark_class(category)) == 2, category
