"""``random``, ``frontier`` and the choice of a backend by its spec."""

import dataclasses
import json

import pytest

from unilavira_drake.errors import MllmError, ScenarioError
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.baselines import FRONTIER_DECISIONS, FrontierModel, RandomModel
from unilavira_drake.mllm.request import (
    LanguageVariables,
    MllmRequest,
    ViewNote,
    VisionVariables,
    WaypointNote,
)
from unilavira_drake.mllm.rules import RulesModel

VIEWS = tuple(
    ViewNote(word, free)
    for word, free in (("front", 2.0), ("left", 4.5), ("right", 0.5), ("back", 4.0))
)


def decide(model, **changes):
    variables = LanguageVariables(task="Go to the sofa.", views=VIEWS, **changes)
    request = MllmRequest(n=3, seed=5, call="decide", variables=variables)
    return json.loads(model.complete(request).text)


@pytest.mark.parametrize("model", [RandomModel(), FrontierModel()])
def test_the_task_is_never_read(model):
    for n in range(1, 30):
        replies = set()
        for task in ("Go to the sofa.", "Leave the room."):
            variables = LanguageVariables(task=task, views=VIEWS)
            request = MllmRequest(n=n, call="decide", variables=variables)
            replies.add(model.complete(request).text)
        assert len(replies) == 1


def test_random_goes_everywhere_and_stops_sometimes():
    actions = [
        json.loads(
            RandomModel()
            .complete(MllmRequest(n=n, call="decide", variables=LanguageVariables()))
            .text
        )["action"]
        for n in range(300)
    ]
    turns = [a["direction"] for a in actions if a["tool"] == "turn"]
    assert set(turns) == {"front", "left", "right", "back"}
    assert 10 <= len(actions) - len(turns) <= 60


def test_frontier_takes_the_freest_direction_without_a_visited_place():
    assert decide(FrontierModel())["action"] == {"tool": "turn", "direction": "left"}
    note = WaypointNote(id=1, distance=3.0, bearing=85.0)
    seen = decide(FrontierModel(), waypoints=(note,), current_waypoint=2)
    assert seen["action"] == {"tool": "turn", "direction": "back"}


def test_frontier_stops_after_its_count():
    request = MllmRequest(n=FRONTIER_DECISIONS + 1, call="decide", variables=LanguageVariables())
    reply = json.loads(FrontierModel().complete(request).text)
    assert reply["action"] == {"tool": "double_check"}


@pytest.mark.parametrize("model", [RandomModel(), FrontierModel()])
def test_other_calls(model):
    request = MllmRequest(role="vision", call="ground", variables=VisionVariables())
    u, v = json.loads(model.complete(request).text)["point"]
    assert 0 <= u < 640
    assert 0 <= v < 480
    check = MllmRequest(call="double_check", variables=LanguageVariables())
    assert json.loads(model.complete(check).text)["confirmed"] is True
    assert json.loads(model.complete(dataclasses.replace(check, call="plan_todo")).text)["todo"]
    assert json.loads(model.complete(dataclasses.replace(check, call="answer")).text)["answer"]
    with pytest.raises(MllmError):
        model.complete(dataclasses.replace(check, call="sing"))


def test_backends_say_what_they_are():
    rules = make_backend("rules", role="language", place="language_model")
    assert isinstance(rules, RulesModel)
    assert (rules.perception, rules.reasoning) == ("ground_truth", "rules")
    assert "not a multimodal LLM" in rules.description
    assert isinstance(make_backend("rules:default", role="language", place="here"), RulesModel)
    for spec, kind in (("random", RandomModel), ("frontier", FrontierModel)):
        model = make_backend(spec, role="language", place="here")
        assert isinstance(model, kind)
        assert "lower bound" in model.description


@pytest.mark.parametrize(
    ("spec", "near"),
    [("rule", "'rules'"), ("fronteer", "'frontier'"), ("rules:defalt", "'default'"),
     ("random:x", "random"), ("", "valid")],
)  # fmt: skip
def test_an_unknown_spec_names_the_nearest(spec, near):
    with pytest.raises(ScenarioError, match=near) as error:
        make_backend(spec, role="language", place="vision_model")
    assert "vision_model" in str(error.value)
