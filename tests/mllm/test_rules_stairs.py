"""``rules`` and stairs: what a text asks, when they are taken, what is marked."""

import dataclasses
import json

import pytest
from rules_requests import request

from unilavira_drake.mllm.evidence import Detection
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import DecisionNote, VisionVariables, WaypointNote
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.mllm.rules.clauses import describe
from unilavira_drake.mllm.rules.parser import parse

MODEL = RulesModel()


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("Go upstairs and enter the bedroom.", ["Go upstairs", "Enter the bedroom"]),
        (
            "Walk down the stairs, then stop at the sofa.",
            ["Go downstairs", "Stop next to the sofa"],
        ),
        (
            "Leave the kitchen and take the stairs to the upper floor.",
            ["Leave the kitchen", "Go upstairs"],
        ),
        ("Go to the bed upstairs.", ["Go upstairs", "Go to the bed"]),
        (
            "Find the refrigerator downstairs and go to it.",
            ["Go downstairs", "Go to the refrigerator"],
        ),
        ("Go up the staircase. Go into the library.", ["Go upstairs", "Enter the library"]),
    ],
)
def test_what_a_text_asks(text, plan) -> None:
    said = [describe(clause) for clause in parse(text)]
    assert said == plan
    assert [describe(clause) for item in said for clause in parse(item)] == plan


def seeing_stairs(text, *, can_climb=True, direction="left", **changes):
    asked = request(4)
    stairs = Detection(
        id=f"{direction}#9", category="stairs", color="white", pixels=20000,
        box=(200.0, 100.0, 400.0, 400.0), point=(300.0, 300.0), distance=3.0, point_distance=3.0,
    )  # fmt: skip
    evidence = tuple(
        dataclasses.replace(view, detections=(*view.detections, stairs))
        if view.direction == direction
        else view
        for view in asked.evidence
    )
    variables = dataclasses.replace(
        asked.variables, task=text, todo=None, can_climb=can_climb, **changes
    )
    return dataclasses.replace(asked, variables=variables, evidence=evidence)


def decision(asked):
    return json.loads(MODEL.complete(asked).text)["action"]


def test_stairs_in_view_are_taken_when_told() -> None:
    action = decision(seeing_stairs("Go upstairs and enter the bedroom."))
    assert action == {"tool": "go_stair", "stair": "up", "direction": "left"}
    action = decision(seeing_stairs("Go downstairs and enter the bedroom.", direction="back"))
    assert action == {"tool": "go_stair", "stair": "down", "direction": "back"}


def test_never_by_a_robot_that_cannot_climb() -> None:
    action = decision(seeing_stairs("Go upstairs and enter the bedroom.", can_climb=False))
    assert action["tool"] == "turn"


def test_not_again_where_they_have_failed() -> None:
    failed = DecisionNote(3, "at waypoint 1: go_stair up: failed: no stairs: none are seen")
    action = decision(seeing_stairs("Go upstairs.", decisions=(failed,)))
    assert action["tool"] != "go_stair"


@pytest.mark.parametrize(("rooms", "tool"), [(3, "turn"), (5, "go_stair")])
def test_another_floor_is_tried_once_this_one_was_searched(rooms, tool) -> None:
    kinds = ("kitchen", "bedroom", "study", "corridor", "library")[:rooms]
    places = tuple(
        WaypointNote(id=i, distance=9.0, bearing=90.0 * i, scene=f"In the {kind}; sees red chair")
        for i, kind in enumerate(kinds, start=1)
    )
    asked = seeing_stairs("Find the bathtub.", waypoints=places)
    assert decision(asked)["tool"] == tool
    climbed = DecisionNote(3, "at waypoint 1: go_stair up: arrived: one floor up")
    again = seeing_stairs("Find the bathtub.", waypoints=places, decisions=(climbed,))
    assert decision(again)["tool"] != "go_stair"


def test_the_vision_prompt_asks_for_the_steps_and_rules_mark_them() -> None:
    asked = seeing_stairs("Go upstairs.")
    variables = VisionVariables(direction="left", stair="up", reasoning_action="Next: go upstairs.")
    vision = dataclasses.replace(
        asked, role="vision", call="ground", variables=variables, images=()
    )
    assert "take the staircase up: mark its nearest step" in compose_prompt(vision).text
    reply = json.loads(MODEL.complete(vision).text)
    assert (reply["target_desc"], reply["box"]) == ("stairs", [200.0, 100.0, 400.0, 400.0])
    elsewhere = dataclasses.replace(variables, direction="front")
    reply = json.loads(MODEL.complete(dataclasses.replace(vision, variables=elsewhere)).text)
    assert reply["box"] is reply["point"] is None
    assert reply["reason"]


def places(*rooms):
    return tuple(
        WaypointNote(id=i, distance=9.0, bearing=40.0 * i, scene=f"In the {room}; sees red chair")
        for i, room in enumerate(rooms, start=1)
    )


NOTHING_NEW = ("kitchen", "corridor", "study", *["corridor", "study"] * 5)
STILL_NEW = ("kitchen", "corridor", *["corridor"] * 5, "study", "corridor", "study", "bathroom")


@pytest.mark.parametrize(
    ("text", "rooms", "why"),
    [
        ("Go upstairs and enter the bedroom.", (), "The next step is to go upstairs, and"),
        ("Find the bed.", NOTHING_NEW, "No bed was seen so far,"),
        ("Enter the bedroom.", NOTHING_NEW, "No bedroom was seen so far,"),
        ("Find the bed.", STILL_NEW, ""),
        ("Find the bed.", NOTHING_NEW[:8], ""),
        ("Find the red sofa.", NOTHING_NEW, ""),
    ],
)
def test_a_robot_told_that_it_takes_no_stairs_stops_with_a_reason(text, rooms, why) -> None:
    changes = {"waypoints": places(*rooms), "current_waypoint": len(rooms)}
    asked = seeing_stairs(text, can_climb=False, stairs_barred=True, **changes)
    reply = json.loads(MODEL.complete(asked).text)
    check = json.loads(MODEL.complete(dataclasses.replace(asked, call="double_check")).text)
    assert reply["reasoning_action"].startswith(why)
    assert (reply["action"]["tool"] == "double_check") == bool(why)
    assert check["confirmed"] == bool(why)
    if why:
        assert check["reason"].startswith(f"Not done, given up: {why}")
        assert check["reason"].endswith("this robot cannot take stairs.")
    untold = seeing_stairs(text, can_climb=False, **changes)
    assert decision(untold)["tool"] != "double_check"
