"""Second Chance Backtrack in the ring (paper III-D): the real agent around a dummy body.

The walls of the dummy world are two metres away in every view, and each turn goes there.
"""

from __future__ import annotations

import pytest
from dummy_levels import (
    ScriptedModel,
    decide,
    make_ring,
    plan,
    run_until_stop,
    select,
    verdict,
)

from unilavira_drake.memory.pictures import BLOCK, LEAST_OF_LEG
from unilavira_drake.memory.waypoint_system import WaypointMemory
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, WaypointNote

DONE = {"op": "update", "index": 1, "status": "completed", "result": "the door is behind me"}
OPEN = {"op": "update", "index": 1, "status": "pending", "result": ""}
SHARPER = {"op": "rewrite", "index": 2, "content": "find the table, not behind the first door"}
MORE = {"op": "add", "content": "look to the left first", "index": 2}

# Places: 1 the start; 2 ahead of it; 3 ahead, 4 left and 5 right of 2; 6 left of 1.
SCRIPT = {
    1: plan("leave the room", "find the table"),
    2: decide("turn", direction="front"),
    3: decide("turn", [DONE], direction="front"),
    4: decide("backtrack", waypoint=2),
    (5, 0): decide("turn", [OPEN], direction="front"),  # has just failed: asked again
    (5, 1): decide("turn", [OPEN, SHARPER, MORE], direction="left"),
    6: decide("backtrack", waypoint=2),
    7: decide("turn", direction="right"),
    8: decide("backtrack", waypoint=2),
    9: decide("backtrack", waypoint=1),  # from one second chance to another
    10: decide("turn", direction="left"),
    11: decide("backtrack", waypoint=5),  # no way
    12: decide("backtrack", waypoint=2),  # the way is blocked before its end
    13: decide("double_check"),
    14: verdict(True),
}
FAILURES = {11: "unreachable", 12: "stuck"}


@pytest.fixture(scope="module")
def asked() -> ScriptedModel:
    """The language model with all that it was asked in the episode of the script."""
    model = ScriptedModel(SCRIPT)
    run_until_stop(make_ring(model, ScriptedModel({}, select()), failures=FAILURES))
    return model


def variables(request: MllmRequest) -> LanguageVariables:
    assert isinstance(request.variables, LanguageVariables)
    return request.variables


def views(request: MllmRequest) -> dict[str, bytes]:
    return {i.label: i.jpeg for i in request.images if i.label.startswith("view ")}


def past(request: MllmRequest) -> dict[str, str]:
    """Returns what each picture of the past shows, by its name."""
    labels = [i.label.partition(": ") for i in request.images if not i.label.startswith("view ")]
    return {name: what for name, _, what in labels}


def place(request: MllmRequest, number: int) -> WaypointNote:
    return next(note for note in variables(request).waypoints if note.id == number)


def contents(request: MllmRequest) -> list[tuple[str, str]]:
    todo = variables(request).todo
    assert todo is not None
    return [(item.content, item.status) for item in todo]


def test_a_second_chance_follows_each_backtrack_that_arrives_and_no_other(
    asked: ScriptedModel,
) -> None:
    assert [(r.n, r.attempt, r.call) for r in asked.requests] == [
        (1, 0, "plan_todo"),
        (2, 0, "decide"),
        (3, 0, "decide"),
        (4, 0, "decide"),
        (5, 0, "recover"),
        (5, 1, "recover"),
        (6, 0, "decide"),
        (7, 0, "recover"),
        (8, 0, "decide"),
        (9, 0, "recover"),
        (10, 0, "recover"),
        (11, 0, "decide"),
        (12, 0, "decide"),
        (13, 0, "decide"),
        (14, 0, "double_check"),
    ]


def test_the_robot_is_driven_back_before_it_is_asked_and_sees_what_is_there_now(
    asked: ScriptedModel,
) -> None:
    back, first, away = asked.request(5), asked.request(3), asked.request(4)
    assert variables(back).current_waypoint == variables(first).current_waypoint == 2
    assert place(away, 2).distance == pytest.approx(2.0, abs=0.3)
    assert place(back, 2).distance < 0.1
    # The four words mean the same views again: front is as it was when the place was reached.
    assert list(views(back)) == ["view front", "view left", "view right", "view back"]
    assert views(back) == views(first)
    assert views(back) != views(away)


def test_the_prompt_holds_the_task_the_failed_direction_and_its_pictures(
    asked: ScriptedModel,
) -> None:
    request = asked.request(5)
    told = variables(request)
    assert told.failed_direction == "front"
    assert told.failed_edges == ("waypoint 2, front: given up after waypoint 3",)
    shown = past(request)
    assert told.failed_pictures
    leg = [shown[name] for name in told.failed_pictures]
    assert leg[-1] == "front view at waypoint 3"
    assert set(leg[:-1]) <= {"leaving waypoint 2 by its front view"}
    prompt = compose_prompt(request)
    assert prompt.images == request.images
    for sentence in (
        'Task: "Go to the wall."',
        "THIS CALL: SECOND CHANCE",
        "From here it had gone to the front, and has given that way up.",
        f"Pictures of that way, oldest first: {', '.join(told.failed_pictures)}.",
        '"front" is not accepted',
        "this way was given up",
        "TODO LIST NOW",
    ):
        assert sentence in prompt.text
    (failed,) = (line for line in prompt.text.splitlines() if line.startswith("View front:"))
    assert 'tried from here: "front: given up after waypoint 3"' in failed
    others = [line for line in prompt.text.splitlines() if line.startswith("View ")]
    assert len(others) == 4
    assert sum("was given up" in line for line in others) == 1


def test_the_failed_direction_is_refused_and_asked_for_again(asked: ScriptedModel) -> None:
    again = asked.request(5, 1)
    assert again.feedback.startswith("front is the direction that has just failed from here")
    assert "left, right, back" in again.feedback
    assert again.feedback in compose_prompt(again).text
    assert again.variables == asked.request(5).variables
    assert place(asked.request(6), 4).distance < 0.1


def test_the_list_survives_the_way_back_and_the_second_chance_may_change_it(
    asked: ScriptedModel,
) -> None:
    done = [("leave the room", "completed"), ("find the table", "pending")]
    assert contents(asked.request(4)) == contents(asked.request(5)) == done
    changed = [
        ("leave the room", "pending"),
        ("look to the left first", "pending"),
        ("find the table, not behind the first door", "pending"),
    ]
    assert contents(asked.request(6)) == changed
    # The reply that was refused changed nothing, and no later way back does.
    for n in range(7, 15):
        assert contents(asked.request(n)) == changed


def test_repeated_and_nested_second_chances_each_name_their_own_way(asked: ScriptedModel) -> None:
    told = {n: variables(asked.request(n)) for n in (5, 7, 9, 10)}
    assert {n: (v.current_waypoint, v.failed_direction) for n, v in told.items()} == {
        5: (2, "front"),
        7: (2, "left"),
        9: (2, "right"),
        10: (1, "front"),
    }
    given_up = [
        "waypoint 2, front: given up after waypoint 3",
        "waypoint 2, left: given up after waypoint 4",
        "waypoint 2, right: given up after waypoint 5",
        "waypoint 1, front: given up after waypoint 2",
    ]
    for n, count in ((5, 1), (7, 2), (9, 3), (10, 4)):
        assert sorted(told[n].failed_edges) == sorted(given_up[:count])
    # Whoever stands elsewhere is still told of them.
    assert sorted(variables(asked.request(12)).failed_edges) == sorted(given_up)
    text = compose_prompt(asked.request(12)).text
    for words in ("front: given up after waypoint 3", "right: given up after waypoint 5"):
        assert f'tried from there: "{words}"' in text
    for n, seen in ((7, "waypoint 4"), (9, "waypoint 5")):
        shown = past(asked.request(n))
        leg = [shown[name] for name in told[n].failed_pictures]
        assert leg[-1] == f"front view at {seen}"
        assert all("at waypoint 3" not in what for what in leg)
    # The way that failed from the start holds all that was seen on it, as far as there is room.
    shown = past(asked.request(10))
    leg = [shown[name] for name in told[10].failed_pictures]
    assert leg[-1] == "front view at waypoint 5"
    assert "front view at waypoint 2" in leg


@pytest.mark.parametrize(("n", "reason"), [(12, "unreachable"), (13, "stuck")])
def test_a_backtrack_that_cannot_arrive_is_told_and_decided_anew(
    asked: ScriptedModel, n: int, reason: str
) -> None:
    request = asked.request(n)
    told = variables(request)
    assert (request.call, told.outcome) == ("decide", f"failed: {reason}")
    assert (told.failed_direction, told.failed_pictures) == ("", ())
    assert told.current_waypoint == 6
    assert told.failed_edges == variables(asked.request(11)).failed_edges
    goal = {12: 5, 13: 2}[n]
    assert told.last_action == f"at waypoint 6: backtrack {goal}: failed: {reason}"
    assert place(request, goal).offered
    text = compose_prompt(request).text
    assert f'It did not succeed: "failed: {reason}"' in text
    assert "SECOND CHANCE" not in text


def test_whoever_insists_on_the_failed_direction_does_not_get_it() -> None:
    model = ScriptedModel(
        {
            1: plan("go"),
            2: decide("turn", direction="front"),
            3: decide("backtrack", waypoint=1),
            4: decide("turn", direction="front"),  # twice: refused, and refused again
            5: decide("double_check"),
            6: verdict(True),
        }
    )
    vision = ScriptedModel({}, select())
    run_until_stop(make_ring(model, vision))
    assert [(r.n, r.attempt, r.call) for r in model.requests][3:] == [
        (4, 0, "recover"),
        (4, 1, "recover"),
        (5, 0, "decide"),
        (6, 0, "double_check"),
    ]
    assert [request.n for request in vision.requests] == [2]
    told = variables(model.request(5))
    assert told.outcome.startswith("failed: model error: front is the direction")
    assert told.current_waypoint == 1
    # What failed from here is still known.
    assert told.failed_edges == ("waypoint 1, front: given up after waypoint 2",)


def test_pictures_of_the_failed_way_are_sent_though_the_history_has_dropped_them() -> None:
    memory = WaypointMemory(
        period=0.1, waypoints=32, decisions=8, keyframes=0, keyframe_travel=1.5, merge_distance=0.5
    )
    model = ScriptedModel(
        {
            1: plan("go"),
            2: decide("turn", direction="front"),
            3: decide("turn", direction="front"),
            4: decide("turn", direction="left"),
            5: decide("backtrack", waypoint=1),
            6: decide("double_check"),
            7: verdict(True),
        }
    )
    vision = ScriptedModel({}, select())
    run_until_stop(make_ring(model, vision, replace={"waypoint_memory": memory}))
    request = model.request(6)
    assert (request.call, variables(request).failed_direction) == ("recover", "front")
    named, sent = variables(request).failed_pictures, past(request)
    assert len(named) == LEAST_OF_LEG
    assert set(named) <= set(sent)
    # All but these few have gone, and none is sent twice.
    assert len(sent) <= LEAST_OF_LEG + BLOCK - 1
    assert len({image.jpeg for image in request.images}) == len(request.images)
    assert set(sent) - set(past(model.request(5)))


def test_second_chances_do_not_need_the_list() -> None:
    model = ScriptedModel(
        {
            1: decide("turn", direction="front"),
            2: decide("turn", direction="left"),
            3: decide("backtrack", waypoint=2),
            4: decide("backtrack", waypoint=1),
            5: decide("double_check"),
            6: verdict(True),
        }
    )
    run_until_stop(make_ring(model, ScriptedModel({}, select()), ablation="no_tdm"))
    chances = [r for r in model.requests if r.call == "recover"]
    assert [variables(r).failed_direction for r in chances] == ["left", "front"]
    for request in chances:
        assert variables(request).todo is None
        assert "TODO" not in compose_prompt(request).text
