"""The ring's protocol, row by row, with scripted models and a dummy body."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from dummy_levels import (
    ScriptedModel,
    decide,
    language_action,
    make_ring,
    plan,
    run_until_stop,
    select,
    verdict,
)
from pydrake.systems.analysis import Simulator

from unilavira_drake.errors import ReplyFormatError, ReplyRefused
from unilavira_drake.language.system import Language
from unilavira_drake.memory.todo_system import TodoMemory
from unilavira_drake.memory.waypoint_system import WaypointMemory
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.system import Vision

DONE = {"op": "update", "index": 1, "status": "completed", "result": "door behind me"}
ADD = {"op": "add", "content": "avoid the wall", "index": None}

# One episode through every row of the protocol; the test is what each call was shown.
SCRIPT = {
    1: plan("leave room", "find table"),
    2: decide("turn", direction="front"),
    3: decide("turn", [DONE], direction="left"),  # vision fails twice -> no target
    4: decide("turn", direction="right"),  # unreachable
    5: decide("turn", direction="front"),  # stuck
    6: decide("backtrack", waypoint=1),  # arrives -> recover
    7: decide("turn", [ADD], direction="left"),
    8: decide("go_stair", stair="up"),  # no stairs here -> failed
    9: decide("backtrack", waypoint=2),  # cannot arrive -> decide
    10: decide("double_check"),
    11: verdict(False, "table not seen"),
    (12, 0): "{oops",
    12: decide("double_check"),
    13: verdict(True),
}
FAILURES = {4: "unreachable", 5: "stuck", 9: "unreachable"}


def scripted() -> tuple[ScriptedModel, ScriptedModel]:
    vision = ScriptedModel({3: "nope", (2, 0): "nope"}, default=select())
    return ScriptedModel(SCRIPT), vision


def test_one_episode_through_every_row() -> None:
    language, vision = scripted()
    diagram = make_ring(language, vision, failures=FAILURES, latency=40.0)
    simulator = run_until_stop(diagram)
    assert language_action(diagram, simulator.get_context()).n == 13
    calls = [(r.n, r.attempt, r.call) for r in language.requests]
    assert calls == [
        (1, 0, "plan_todo"),
        (2, 0, "decide"),
        (3, 0, "decide"),
        (4, 0, "decide"),
        (5, 0, "decide"),
        (6, 0, "decide"),
        (7, 0, "recover"),
        (8, 0, "decide"),
        (9, 0, "decide"),
        (10, 0, "decide"),
        (11, 0, "double_check"),
        (12, 0, "decide"),
        (12, 1, "decide"),
        (13, 0, "double_check"),
    ]
    assert [(r.n, r.attempt) for r in vision.requests] == [
        (2, 0),
        (2, 1),
        (3, 0),
        (3, 1),
        (4, 0),
        (5, 0),
        (7, 0),
        (8, 0),
    ]


@pytest.fixture(scope="module")
def shown() -> ScriptedModel:
    language, vision = scripted()
    run_until_stop(make_ring(language, vision, failures=FAILURES))
    return language


@pytest.mark.parametrize(
    ("n", "outcome"),
    [
        (1, ""),
        (2, "arrived"),
        (3, "arrived"),
        (4, "failed: no target"),
        (5, "failed: unreachable"),
        (6, "failed: stuck"),
        (7, "arrived"),
        (8, "arrived"),
        (9, "failed: no stairs"),
        (10, "failed: unreachable"),
        (11, "arrived"),
        (12, "arrived"),
    ],
)
def test_outcome_travels_with_the_next_panorama(shown: ScriptedModel, n: int, outcome: str) -> None:
    assert shown.request(n).variables.outcome.startswith(outcome)


def test_todo_list_is_shown_after_its_update(shown: ScriptedModel) -> None:
    assert [i.content for i in shown.request(2).variables.todo] == ["leave room", "find table"]
    first = shown.request(4).variables.todo[0]
    assert (first.status, first.result) == ("completed", "door behind me")
    assert shown.request(8).variables.todo[-1].content == "avoid the wall"


def test_recover_names_the_failed_direction(shown: ScriptedModel) -> None:
    recover = shown.request(7)
    assert recover.variables.failed_direction == "front"
    assert any("waypoint 1, front" in edge for edge in recover.variables.failed_edges)
    named = {image.label.partition(":")[0] for image in recover.images}
    assert recover.variables.failed_pictures
    assert named.issuperset(recover.variables.failed_pictures)


def test_pictures_of_the_places_to_go_back_to_are_shown(shown: ScriptedModel) -> None:
    labels = [image.label for image in shown.request(6).images]
    offered = [w for w in shown.request(6).variables.waypoints if w.offered]
    assert offered
    assert {f"{w.picture}: front view at waypoint {w.id}" for w in offered} <= set(labels)


def test_a_picture_keeps_its_name_and_none_is_sent_twice(shown: ScriptedModel) -> None:
    first: dict[str, bytes] = {}
    for request in shown.requests:
        past = {i.label: i.jpeg for i in request.images if i.label.startswith("H")}
        assert len(past) == len(set(past.values())) == len(request.images) - 4
        for label, jpeg in past.items():
            assert first.setdefault(label, jpeg) == jpeg
        # Back at a place, its front looks as it did.
        revisited = {w.picture for w in request.variables.waypoints if w.distance < 0.1}
        front = request.images[-4].jpeg
        assert [label.partition(":")[0] in revisited for label in past if past[label] == front] in (
            [],
            [True],
        )
    assert len(first) >= 4


def test_rejected_stop_is_fed_back(shown: ScriptedModel) -> None:
    assert shown.request(12).variables.rejection == "table not seen"
    assert shown.request(11).variables.rejection == ""


def test_reask_says_what_was_wrong(shown: ScriptedModel) -> None:
    assert shown.request(12, 1).feedback != ""
    assert shown.request(12, 1).variables == shown.request(12, 0).variables


def test_unusable_replies_become_the_safe_action() -> None:
    language = ScriptedModel({1: plan("go"), 3: decide("double_check"), 4: verdict(True)}, "bad")
    diagram = make_ring(language, ScriptedModel({}, select()))
    run_until_stop(diagram)
    assert [r.attempt for r in language.requests if r.n == 2] == [0, 1]
    assert language.request(3).variables.outcome.startswith("failed: model error")


class RefusingModel(ScriptedModel):
    """Refuses to answer at one number."""

    refused = 2

    def complete(self, request: MllmRequest) -> Completion:
        completion = super().complete(request)
        if request.n == self.refused:
            raise ReplyRefused("the provider's filter: picture 3.")
        return completion


def test_a_refusal_is_not_asked_again() -> None:
    language = RefusingModel(
        {
            1: plan("go"),
            3: decide("turn", direction="front"),
            4: decide("double_check"),
            5: verdict(True),
        }
    )
    vision = RefusingModel({}, select())
    vision.refused = 3
    run_until_stop(make_ring(language, vision))
    assert [r.attempt for r in language.requests if r.n == 2] == [0]
    assert language.request(3).variables.outcome.startswith("failed: model error: ReplyRefused")
    assert [r.attempt for r in vision.requests] == [0]
    assert language.request(4).variables.outcome.startswith("failed: no target")


class SilentOnce(ScriptedModel):
    """Says nothing at its first attempt at one number, as a model does that only thinks."""

    silent = 2

    def complete(self, request: MllmRequest) -> Completion:
        completion = super().complete(request)
        if (request.n, request.attempt) == (self.silent, 0):
            raise ReplyFormatError("the reply is empty.")
        return completion


def test_an_empty_reply_is_asked_again() -> None:
    language = SilentOnce(
        {
            1: plan("go"),
            2: decide("turn", direction="front"),
            3: decide("double_check"),
            4: verdict(True),
        }
    )
    vision = SilentOnce({}, select())
    run_until_stop(make_ring(language, vision))
    for model in (language, vision):
        again = [r for r in model.requests if r.n == 2]
        assert [r.attempt for r in again] == [0, 1]
        assert again[1].feedback == "the reply is empty."
    assert language.request(3).variables.outcome == "arrived"


def test_unusable_plan_becomes_the_task_itself() -> None:
    language = ScriptedModel({2: decide("double_check"), 3: verdict(True)}, "bad")
    run_until_stop(make_ring(language, ScriptedModel({}, select())))
    assert [i.content for i in language.request(2).variables.todo] == ["Go to the wall."]


def test_unmoved_robot_sees_the_same_frames_under_the_new_number(shown: ScriptedModel) -> None:
    def views(n: int) -> list[bytes]:
        return [i.jpeg for i in shown.request(n).images if i.label.startswith("view")]

    assert views(4) == views(5)
    assert len(shown.request(5).variables.waypoints) == len(shown.request(4).variables.waypoints)


def test_question_is_answered_after_the_confirmed_stop() -> None:
    answer = '{"reasoning": "", "answer": "red"}'
    language = ScriptedModel(
        {1: plan("look"), 2: decide("double_check"), 3: verdict(True), 4: answer}
    )
    diagram = make_ring(language, ScriptedModel({}, select()), family="eqa")
    simulator = run_until_stop(diagram)
    assert [r.call for r in language.requests][-2:] == ["double_check", "answer"]
    assert language_action(diagram, simulator.get_context()).answer == "red"


def test_ablations_are_wiring() -> None:
    bare = ScriptedModel({1: decide("double_check"), 2: verdict(True)})
    run_until_stop(make_ring(bare, ScriptedModel({}, select()), ablation="no_both"))
    assert [r.call for r in bare.requests] == ["decide", "double_check"]
    variables = bare.request(1).variables
    assert variables.todo is None
    assert not variables.second_chance


def asked(request: MllmRequest) -> tuple[object, ...]:
    """Returns what a call asks, without the centimetres at which the body came to rest."""
    v = request.variables
    memory = [(w.id, w.caption, w.tried, w.offered) for w in v.waypoints]
    told = (v.outcome, v.todo, v.decisions, v.failed_edges, v.failed_direction, memory)
    return (request.n, request.attempt, request.call, *told)


def test_calls_do_not_depend_on_the_periods_of_the_levels() -> None:
    language, vision = scripted()
    run_until_stop(make_ring(language, vision, failures=FAILURES))
    expected = [asked(request) for request in language.requests]
    rng = np.random.default_rng(0)
    for _ in range(20):
        periods = rng.choice([0.05, 0.1, 0.15, 0.2, 0.35], size=6)
        language, vision = scripted()
        replace = {
            "language": Language(
                period=periods[0], seed=0, can_climb=True, free_distance=lambda frame: 2.0
            ),
            "vision": Vision(period=periods[1], seed=0),
            "todo_memory": TodoMemory(period=periods[2]),
            "waypoint_memory": WaypointMemory(
                period=periods[3],
                waypoints=32,
                decisions=4,
                keyframes=8,
                keyframe_travel=1.5,
                merge_distance=0.5,
            ),
        }
        diagram = make_ring(
            language,
            vision,
            failures=FAILURES,
            replace=replace,
            observer_period=periods[4],
            body_period=periods[5],
        )
        run_until_stop(diagram)
        assert [asked(request) for request in language.requests] == expected


@pytest.mark.parametrize("time", [3.0, 21.0, 47.3, 130.0, 260.0])
def test_clone_has_the_same_future_without_extra_calls(time: float) -> None:
    language, vision = scripted()
    diagram = make_ring(language, vision, failures=FAILURES, latency=40.0)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(time)
    clone = simulator.get_context().Clone()
    simulator.AdvanceTo(1000.0)
    calls = len(language.requests), len(vision.requests)
    branch = Simulator(diagram, clone)
    branch.AdvanceTo(1000.0)
    assert (len(language.requests), len(vision.requests)) == calls
    ends = [language_action(diagram, s.get_context()) for s in (simulator, branch)]
    assert ends[0] == ends[1]
    assert ends[0].tool == "stop"


def test_evidence_reaches_only_a_model_declared_ground_truth() -> None:
    for perception in ("images", "ground_truth"):
        language, vision = scripted()
        language.perception = perception
        run_until_stop(make_ring(language, vision, failures=FAILURES))
        given = language.request(1).evidence
        assert (given is not None) == (perception == "ground_truth")
        assert given is None or given[0] == ViewEvidence("front")
        assert vision.requests[0].evidence is None


def test_the_goal_of_the_episode_has_no_way_into_the_agent() -> None:
    agent = make_ring(*scripted()).GetSubsystemByName("agent")
    ports = {agent.get_input_port(i).get_name() for i in range(agent.num_input_ports())}
    assert ports == {"task", "panorama", "front.color_image", "pose_estimate"}
    assert [field.name for field in dataclasses.fields(TaskSpec)] == ["family", "text", "choices"]
