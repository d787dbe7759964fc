"""``rules`` on single requests made by hand: what closes, what is chosen, what is grounded."""

import dataclasses
import json
import math

import pytest

from unilavira_drake.errors import MllmError
from unilavira_drake.messages import DIRECTIONS, TodoItem
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import (
    DecisionNote,
    LanguageVariables,
    MllmRequest,
    ViewNote,
    VisionVariables,
    WaypointNote,
)
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.mllm.rules.floor_camera import FloorCamera

MODEL = RulesModel()
CAMERA = FloorCamera(640, 480, 320 / math.tan(math.radians(39.5)))


def floor(view, room, number, near=1.1, u=320.0, distance=2.0):
    row = CAMERA.row(u, distance)
    bottom = 480.0 if near <= 1.1 else CAMERA.row(u, near)
    return Detection(
        id=f"{view}#{number}", category="floor", room=room, box=(0.0, 250.0, 640.0, bottom),
        point=(u, row), pixels=60000, distance=distance, point_distance=distance,
    )  # fmt: skip


def thing(view, number, category, color, u, distance, width=80.0):
    foot = CAMERA.row(u, distance)
    return Detection(
        id=f"{view}#{number}", category=category, color=color,
        box=(u - width / 2, max(foot - 150.0, 0.0), u + width / 2, foot),
        point=(u, foot - 40.0), pixels=5000, distance=distance, point_distance=distance,
    )  # fmt: skip


def evidence(room, **extra):
    return tuple(
        ViewEvidence(d, detections=(floor(d, room, 1), *extra.get(d, ()))) for d in DIRECTIONS
    )


def request(call, views, todo=(), free=3.0, **changes):
    variables = LanguageVariables(
        task=changes.pop("task", "Go to the sofa."),
        views=tuple(ViewNote(d, free) for d in DIRECTIONS),
        todo=tuple(TodoItem(*item) for item in todo),
        current_waypoint=1,
        waypoints=changes.pop("waypoints", (WaypointNote(id=1),)),
        **changes,
    )
    return MllmRequest(n=4, call=call, variables=variables, evidence=views)


def ask(*args, **kwargs):
    return json.loads(MODEL.complete(request(*args, **kwargs)).text)


def test_the_plan_names_the_room_it_leaves_and_tells_unused_words():
    reply = ask("plan_todo", evidence("kitchen"), task="Leave this room and yodel at the sofa.")
    assert reply["todo"] == ["Leave the kitchen", "Go to the sofa"]
    assert "yodel" in reply["reasoning"]


def test_a_task_without_any_step_is_ended_and_told():
    reply = ask("plan_todo", evidence("kitchen"), task="Sing a song!")
    (item,) = reply["todo"]
    assert "understood" in item
    assert ask("decide", evidence("kitchen"), [(item,)])["action"] == {"tool": "double_check"}
    check = ask("double_check", evidence("kitchen"), [(item,)])
    assert "no step" in check["reasoning"]


def test_a_visible_target_of_the_right_colour_is_chosen():
    views = evidence(
        "living room",
        left=(thing("left", 2, "couch", "blue", 320, 2.0),),
        back=(thing("back", 2, "sofa", "red", 320, 4.0),),
    )
    reply = ask("decide", views, [("Go to the red sofa",)])
    assert reply["action"] == {"tool": "turn", "direction": "back"}
    assert "red sofa" in reply["reasoning_action"]


BESIDE_PIANO = [("Go to the chair near the piano",)]


def test_a_thing_at_hand_without_its_landmark_is_another_one():
    views = evidence("study", left=(thing("left", 2, "chair", "green", 320, 1.2),))
    reply = ask("decide", views, BESIDE_PIANO)
    assert reply["todo_updates"] == []
    assert reply["action"] != {"tool": "double_check"}
    check = ask("double_check", views, [(*BESIDE_PIANO[0], "completed", "seen")])
    assert check["confirmed"] is False


def test_the_thing_beside_its_landmark_is_meant_even_if_another_is_nearer():
    views = evidence(
        "dining room",
        left=(thing("left", 2, "chair", "green", 320, 1.2),),
        back=(
            thing("back", 2, "chair", "brown", 320, 2.2),
            thing("back", 3, "piano", "black", 420, 3.0),
        ),
    )
    reply = ask("decide", views, BESIDE_PIANO)
    assert reply["action"] == {"tool": "turn", "direction": "back"}
    assert "brown chair" in reply["reasoning_action"]


def test_a_move_that_was_none_is_not_repeated():
    views = evidence(
        "living room",
        left=(thing("left", 2, "sofa", "red", 320, 3.0),),
        back=(thing("back", 2, "sofa", "red", 320, 4.0),),
    )
    todo = [("Go to the red sofa",)]
    assert ask("decide", views, todo)["action"]["direction"] == "left"
    here = WaypointNote(id=1, tried=("left: arrived: already there",))
    assert ask("decide", views, todo, waypoints=(here,))["action"]["direction"] == "back"


def test_a_target_at_hand_closes_its_item_with_the_detection_and_asks_for_the_check():
    views = evidence("living room", left=(thing("left", 2, "sofa", "red", 320, 1.2),))
    reply = ask("decide", views, [("Stop next to the red sofa",)])
    (update,) = reply["todo_updates"]
    assert update["status"] == "completed"
    assert "left#2" in update["result"]
    assert reply["action"] == {"tool": "double_check"}
    check = ask("double_check", views, [("Stop next to the red sofa", "completed", "seen")])
    assert check["confirmed"] is True


def test_the_check_is_rejected_away_from_the_target_and_the_item_is_opened_again():
    views = evidence("living room", left=(thing("left", 2, "sofa", "red", 320, 3.0),))
    todo = [("Stop next to the red sofa", "completed", "seen")]
    check = ask("double_check", views, todo)
    assert check["confirmed"] is False
    assert "red sofa" in check["reason"]
    reply = ask("decide", views, todo, rejection=check["reason"])
    assert [u["status"] for u in reply["todo_updates"]] == ["pending"]
    assert reply["action"] == {"tool": "turn", "direction": "left"}


def test_an_open_item_rejects_the_check():
    reply = ask("double_check", evidence("kitchen"), [("Enter the kitchen",)])
    assert reply == {
        "reasoning": "not done: Enter the kitchen",
        "confirmed": False,
        "reason": "not done: Enter the kitchen",
    }


def test_leave_and_enter_close_together_and_the_turn_is_taken_with_the_next_move():
    todo = [("Leave the bedroom",), ("Enter the corridor",), ("Turn left",), ("Enter the study",)]
    reply = ask("decide", evidence("corridor"), todo)
    assert [u["index"] for u in reply["todo_updates"]] == [1, 2, 3]
    assert all(u["status"] == "completed" for u in reply["todo_updates"])
    assert reply["action"] == {"tool": "turn", "direction": "left"}


def test_a_turn_that_nothing_follows_moves_nothing():
    reply = ask("decide", evidence("corridor"), [("Turn around",)])
    assert reply["action"] == {"tool": "double_check"}


@pytest.mark.parametrize(("side", "direction"), [("left", "left"), ("right", "right")])
def test_the_door_on_the_said_side_is_taken(side, direction):
    views = evidence(
        "corridor",
        left=(thing("left", 2, "door", "white", 320, 1.5, 200),),
        right=(thing("right", 2, "door", "white", 320, 1.5, 200),),
    )
    reply = ask("decide", views, [(f"Go through the door on the {side}",)])
    assert reply["action"] == {"tool": "turn", "direction": direction}


@pytest.mark.parametrize(("ordinal", "distance"), [("first", 2.0), ("second", 4.0)])
def test_doors_on_a_side_are_counted_in_the_direction_of_travel(ordinal, distance):
    views = evidence(
        "corridor",
        front=(
            thing("front", 2, "door", "white", 150, 2.0),
            thing("front", 3, "door", "white", 240, 4.0),
            thing("front", 4, "door", "white", 500, 1.5),
        ),
    )
    reply = ask("decide", views, [(f"Go through the {ordinal} door on the left",)])
    assert f"about {distance:.1f} m" in reply["reasoning_action"]


def test_a_dead_end_is_left_by_a_backtrack_to_the_corridor_when_that_is_offered():
    views = evidence("bathroom", back=(thing("back", 2, "door", "white", 320, 1.5, 200),))
    notes = (
        WaypointNote(
            id=2, distance=2.5, bearing=180.0, heading=0.0, offered=True,
            target="open floor",
            scene="In the corridor; exits: bathroom +0 deg 1.0 m, ? +90 deg 3.0 m",
            tried=("front: arrived at waypoint 1",),
        ),
        WaypointNote(id=1),
    )  # fmt: skip
    reply = ask("decide", views, [("Go to the sofa",)], waypoints=notes)
    assert reply["action"] == {"tool": "backtrack", "waypoint": 2}
    reply = ask("decide", views, [("Go to the sofa",)], waypoints=notes, second_chance=False)
    assert reply["action"]["tool"] == "turn"
    refused = (DecisionNote(3, "at waypoint 1: backtrack 2: failed: unreachable"),)
    reply = ask("decide", views, [("Go to the sofa",)], waypoints=notes, decisions=refused)
    assert reply["action"]["tool"] == "turn"


@pytest.mark.parametrize("failed", DIRECTIONS)
def test_after_a_backtrack_the_failed_direction_is_not_taken_again(failed):
    views = evidence("corridor", front=(thing("front", 2, "sofa", "red", 320, 3.0),))
    for free in (3.0, 0.2):
        todo = [("Go to the sofa",)]
        reply = ask("recover", views, todo, free=free, failed_direction=failed)
        assert reply["action"]["direction"] != failed


def test_the_caption_is_short_and_is_read_back_as_a_place():
    views = evidence(
        "corridor",
        front=tuple(thing("front", i, "door", "white", 60 * i, 2.0 + i) for i in range(2, 9)),
        left=tuple(thing("left", i, "cabinet", "purple", 60 * i, 3.0) for i in range(2, 9)),
    )
    scene = ask("decide", views, [("Go to the sofa",)])["scene"]
    assert scene.startswith("In the corridor; exits: ? ")
    assert len(scene) <= 110


@pytest.mark.parametrize(
    ("question", "answer"),
    [("What colour is the sofa?", "red"), ("In which room is the sofa?", "living room"),
     ("How many sofas are there?", "1"), ("Is there a sofa?", "yes"),
     ("What colour is the piano?", "unknown"), ("Who owns the sofa?", "unknown")],
)  # fmt: skip
def test_answers(question, answer):
    views = evidence("living room", left=(thing("left", 2, "sofa", "red", 320, 1.2),))
    assert ask("answer", views, task=question, family="eqa")["answer"] == answer


def test_vision_returns_the_box_of_the_thing_and_the_floor_of_a_place():
    view = ViewEvidence(
        "left",
        detections=(
            floor("left", "corridor", 1),
            thing("left", 2, "sofa", "red", 200, 3.0),
            thing("left", 3, "sofa", "red", 500, 5.0),
        ),
    )

    def ground(order):
        variables = VisionVariables(direction="left", reasoning_action=order)
        asked = MllmRequest(role="vision", call="ground", variables=variables, evidence=(view,))
        return json.loads(MODEL.complete(asked).text)

    order = "Target: red sofa, about 5.0 m, 24 deg right of the left view's axis."
    # It fills less than half of its box: a point on it is surer than the box.
    assert ground(order)["point"] == list(view.detections[2].point)
    u_min, v_min, u_max, v_max = view.detections[2].box
    full = dataclasses.replace(view.detections[2], pixels=int((u_max - u_min) * (v_max - v_min)))
    view = dataclasses.replace(view, detections=(*view.detections[:2], full))
    assert ground(order)["box"] == list(full.box)
    reply = ground("Target: open floor, about 3.0 m, 0 deg left of the left view's axis.")
    u, v = reply["point"]
    assert CAMERA.reach(u, v) == pytest.approx(3.0, rel=0.02)
    reply = ground("Target: blue sofa, about 3.0 m, 0 deg left of the left view's axis.")
    assert reply["box"] is None
    assert "blue sofa" in reply["reason"]
    assert ground("I would walk over to the settee.")["target_desc"] == "red sofa"


def test_a_request_without_evidence_or_with_an_unknown_call_is_an_error():
    asked = request("decide", evidence("kitchen"))
    with pytest.raises(MllmError, match="no labelled detections"):
        MODEL.complete(dataclasses.replace(asked, evidence=None))
    with pytest.raises(MllmError, match="sing"):
        MODEL.complete(dataclasses.replace(asked, call="sing"))


def test_the_camera_is_learned_from_the_floor():
    true = FloorCamera(640, 480, CAMERA.focal, 0.8, math.radians(17))
    pairs = [((u, v), true.reach(u, v)) for u in (100, 320, 500) for v in (300, 380, 460)]
    detections = tuple(
        Detection(category="floor", point=point, point_distance=distance)
        for point, distance in pairs
    )
    found = FloorCamera.fit([ViewEvidence(detections=detections)])
    assert found.above_floor == pytest.approx(0.8, rel=0.02)
    assert math.degrees(found.pitch) == pytest.approx(17, abs=1)
