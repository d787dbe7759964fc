"""``rules`` in flight: directives are read, flown in a town of boxes, and checked at the end."""

import dataclasses
import json
import math

import pytest
from flight_town import CENTERS, Town, run

from unilavira_drake.messages import DOWN, TodoItem
from unilavira_drake.mllm.evidence import Detection
from unilavira_drake.mllm.request import LanguageVariables
from unilavira_drake.mllm.rules import RulesDials, RulesModel
from unilavira_drake.mllm.rules.flight.legs import Leg, describe
from unilavira_drake.mllm.rules.flight.parser import parse_directive, plan_legs
from unilavira_drake.mllm.rules.flight.scene import AirScene, LandmarkSight
from unilavira_drake.mllm.rules.flight.words import looks

REACH = 20.0
"""What the judge of the family calls success, metres."""


@pytest.fixture(scope="module")
def town():
    return Town()


LEGS = {
    "Climb to 20 m, fly over the roof of the school, then follow the road until the fountain and "
    "stop next to the red car.": [
        "Climb to 20 m", "Fly over the school", "Fly along the road", "Fly to the fountain",
        "Stop at the red car",
    ],
    "The target is 120 m at 30 degrees from you. It is a red car near the church. Please control "
    "the drone and find the target.": [
        "Fly 120 m at 30 degrees to the right of the start", "Stop at the red car near the church",
    ],
    "Take off and climb by 15 m. Fly along the main street until you reach the church, turn left "
    "at the church and fly over the park. Descend and hover above the pond.": [
        "Climb to 25 m", "Fly along the road", "Fly past the church", "Turn left",
        "Fly over the park", "Descend to 8 m", "Stop at the pond",
    ],
    "Fly past the white tower on your right, cross the river, and land beside the blue bus at the "
    "car park.": [
        "Fly past the white tower on the right", "Fly over the river",
        "Stop at the blue bus near the car park",
    ],
    "Fly straight ahead over the houses to the park, then descend to 5 metres over the fountain.": [
        "Fly over the house", "Fly to the park", "Fly over the fountain", "Descend to 5 m",
    ],
    "Turn right and follow the street to the yellow bus. The bus is 200 m away, 60 degrees to your "
    "left.": [
        "Fly 200 m at 60 degrees to the left of the start", "Turn right", "Fly along the road",
        "Stop at the yellow bus",
    ],
    "Head to the left of the church, pass the school, and stop at the parking lot.": [
        "Fly to the church", "Fly past the school", "Stop at the car park",
    ],
    "Fly past the hall with the blue roof and two greenhouses with white roofs. In the yard stands "
    "a wooden barn with its red roof, beside a house with a black roof: stop over the barn.": [
        "Fly past the greenhouse with a white roof", "Stop at the brown barn with a red roof",
    ],
    "Pass the fire station with a flat roof and gates, and stop at the pavilion with the red roof "
    "on your left.": [
        "Fly past the fire station", "Stop at the pavilion with a red roof on the left",
    ],
}  # fmt: skip


@pytest.mark.parametrize("text", LEGS, ids=lambda text: text[:30])
def test_directives_are_read_leg_by_leg(text):
    assert [describe(leg) for leg in plan_legs(text, 10.0)] == LEGS[text]


@pytest.mark.parametrize(
    "leg",
    [
        Leg("climb", height=20.0),
        Leg("descend", height=6.0),
        *(Leg("turn", side=side) for side in ("left", "right", "around")),
        Leg("heading", distance=120.0, bearing=-30.0),
        Leg("heading", distance=80.0, bearing=45.0),
        Leg("along", "road"),
        *(
            Leg(kind, landmark, color, beside, side)
            for kind in ("over", "past", "go", "stop")
            for landmark in ("church", "street lamp", "car park", "sports field")
            for color in ("", "red")
            for beside in ("", "fountain")
            for side in ("", "left")
        ),
        Leg("stop", "barn", "brown", "house", "left", roof="red"),
        Leg("over", "town hall", roof="green"),
    ],
    ids=describe,
)
def test_a_leg_is_read_back_from_its_own_words(leg):
    assert parse_directive(describe(leg)) == (leg,)


@pytest.mark.parametrize("text", ["", "Hello!", "Do a somersault.", "fly fly fly", "120 m", "."])
def test_what_is_no_directive_has_no_legs(text):
    assert parse_directive(text) == ()


FLIGHTS = {
    "Climb to 20 m, fly over the roof of the school, then follow the road until the bus and stop "
    "next to the red car.": "car",
    "The target is 122 m at 30 degrees from you. It is a white church. Please control the drone "
    "and find the target.": "church",
    "Fly past the school on your left, turn left and fly to the fountain in the park. Descend and "
    "hover above the fountain.": "fountain",
    "Climb to 30 m, follow the road until the yellow bus, then stop next to the blue car at the "
    "park.": "blue_car",
}


@pytest.mark.parametrize("text", FLIGHTS, ids=lambda text: text[:30])
def test_directives_are_flown(town, text):
    flight = run(town, RulesModel(), text)
    assert flight.stopped
    assert flight.away(FLIGHTS[text]) <= REACH
    assert all(item.status == "completed" for item in flight.todo.items)
    assert min(pose[2] for *_, pose in flight.steps) > 3.0


def test_a_thing_out_of_sight_is_searched_from_higher_up(town):
    flight = run(town, RulesModel(), "Fly to the red car and stop.", start=(-60.0, 40.0, 10.0, 2.0))
    assert flight.stopped
    assert flight.away("car") <= REACH
    assert max(pose[2] for *_, pose in flight.steps) >= 22.0


def test_what_looks_the_same_far_from_the_stated_place_is_not_the_goal(town):
    """A red car stands beside the start, the blue one where the task says."""
    start = (50.0, 0.0, 12.0, 0.0)
    text = "The target is about 135 metres away, 26 degrees to your left. It is a car."
    flight = run(town, RulesModel(), text, start=start)
    assert flight.stopped
    assert flight.away("blue_car") <= REACH
    assert run(town, RulesModel(), "Find the car.", start=start).away("car") <= REACH


def test_the_search_around_a_stated_place_goes_to_all_sides(town):
    text = "The target is about 60 metres away, straight ahead. It is a yellow boat."
    flight = run(town, RulesModel(), text, budget=16)
    sides = {(x > 75.0) - (x < 45.0) for *_, (x, *_) in flight.steps[4:]}
    sides |= {10 * ((y > 20.0) - (y < -20.0)) for *_, (_, y, *_) in flight.steps[4:]}
    assert {1, -1, 10, -10} <= sides
    assert all(math.hypot(x - 60.0, y) <= 80.0 for *_, (x, y, *_) in flight.steps)


@pytest.mark.parametrize(
    ("color", "roof", "seen", "above", "expected"),
    [
        ("black", "", "black", False, 2),
        ("black", "", "white", False, 0),
        ("black", "", "white", True, 1),
        ("red", "", "white", True, 0),
        ("brown", "red", "red", False, 2),
        ("brown", "red", "brown", True, 2),
        ("brown", "red", "green", True, 0),
        ("", "red", "green", False, 2),
    ],
)
def test_the_colour_of_a_thing_is_that_of_its_body_its_roof_or_its_light(
    color, roof, seen, above, expected
):
    assert looks(color, roof, seen, above=above) == expected


def test_a_thing_with_the_very_colour_is_preferred_to_one_that_only_the_light_may_have_made():
    pale, exact = _sight("white", DOWN, 5.0), _sight("black", "front", 30.0)
    leg = Leg("stop", "statue", "black")
    assert AirScene((pale, exact), {}).matching(leg) == [exact]
    assert AirScene((pale,), {}).matching(leg) == [pale]
    assert AirScene((_sight("white", "front", 5.0),), {}).matching(leg) == []


def _sight(color, direction, distance):
    seen = Detection(id=direction, category="statue", color=color)
    return LandmarkSight(direction, "statue", color, direction, 0.0, distance, 5.0, False, seen)


def test_without_a_list_it_flies_on_what_the_history_tells(town):
    flight = run(
        town, RulesModel(), "Fly past the school and stop at the white church.", todo=False
    )
    assert flight.stopped
    assert flight.away("church") <= REACH


def test_where_nothing_can_be_marked_it_flies_by_the_stated_direction(town):
    start = (0.0, 0.0, 95.0, 0.0)  # too high for the depth camera and too far for any landmark
    text = "The target is 60 m at 6 degrees to your left. It is a red car."
    flight = run(town, _Blind(), text, start=start, budget=4)
    fly = next(action for _, action, _, _ in flight.steps if action.tool == "fly")
    assert fly.bearing == pytest.approx(6.0)
    assert 5.0 <= fly.distance <= 40.0
    asked = next(request for request, action, *_ in flight.steps if action.tool == "fly")
    assert asked.variables.bearings.goal_distance == pytest.approx(60.0)


class _Blind(RulesModel):
    """Sees nothing at all."""

    def complete(self, request):
        views = tuple(dataclasses.replace(v, detections=()) for v in request.evidence)
        return super().complete(dataclasses.replace(request, evidence=views))


@pytest.mark.parametrize(
    ("last", "height", "climb"),
    [
        ("turn front to 'yellow boat': on the way", 30.0, -15.0),
        ("turn front to 'yellow boat': arrived", 30.0, None),
        ("turn front to 'red car': on the way", 30.0, None),
        ("turn front to 'yellow boat': on the way", 15.0, 10.0),
    ],
)
def test_what_was_lost_on_the_way_is_looked_for_from_lower(town, last, height, climb):
    request = run(
        town, RulesModel(), "Stop at the yellow boat.", start=(0.0, 0.0, height, 0.0), budget=1
    ).steps[0][0]
    todo = (TodoItem("Stop at the yellow boat"),)
    variables = dataclasses.replace(
        request.variables, todo=todo, last_action=f"at waypoint 1: {last}", outcome="arrived"
    )
    asked = dataclasses.replace(request, call="decide", variables=variables)
    action = json.loads(RulesModel().complete(asked).text)["action"]
    assert action["climb"] == (climb if climb is None else pytest.approx(climb, abs=0.2))
    assert (action["direction"] == DOWN) == (climb is not None)


def test_a_stop_far_from_the_last_landmark_is_rejected(town):
    flight = run(town, RulesModel(), "Stop at the red car.", budget=2)
    request = flight.steps[-1][0]
    done = (TodoItem("Stop at the red car", "completed", "seen"),)
    variables = dataclasses.replace(request.variables, todo=done)
    asked = dataclasses.replace(request, call="double_check", variables=variables)
    reply = json.loads(RulesModel().complete(asked).text)
    assert reply["confirmed"] is False
    assert "red car" in reply["reason"]


def test_tasks_for_homes_are_read_as_on_the_ground(town):
    """An aircraft with another task uses the rules for homes, which know no view straight down."""
    request = run(town, RulesModel(), "Fly to the red car.", budget=1).steps[0][0]
    flown = dataclasses.replace(request.variables, family="vln", task="Go to the red sofa.")
    reply = json.loads(
        RulesModel().complete(dataclasses.replace(request, variables=flown, call="decide")).text
    )
    assert reply["action"]["tool"] in ("turn", "double_check")
    assert reply["action"].get("direction") != DOWN


def test_dials_err_in_flight_too(town):
    model = RulesModel(RulesDials(label_dropout=0.2, wrong_direction=0.3, box_jitter=0.1))
    flight = run(town, model, "Fly to the red car and stop.", budget=12)
    assert len(flight.steps) >= 3
    assert isinstance(flight.steps[0][0].variables, LanguageVariables)


def test_the_same_request_gets_the_same_reply(town):
    text = "Fly past the school and stop at the white church."
    first, second = (run(town, RulesModel(), text) for _ in range(2))
    assert [a for _, a, _, _ in first.steps] == [a for _, a, _, _ in second.steps]
    assert set(CENTERS) >= {"church"}
