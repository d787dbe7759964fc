"""``random``, ``frontier``, ``fixed`` and the choice of a backend by its spec."""

import dataclasses
import json

import pytest

from unilavira_drake.errors import MllmError, ScenarioError
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.baselines import (
    FIXED_DECISIONS,
    FRONTIER_DECISIONS,
    FixedModel,
    FrontierModel,
    RandomModel,
)
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


@pytest.mark.parametrize("model", [RandomModel(), FrontierModel(), FixedModel()])
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


def sequence(seed, task="Go to the sofa."):
    """Returns what ``fixed`` does along a corridor that is blocked at every third decision."""
    actions = []
    for n in range(1, FIXED_DECISIONS + 2):
        views = (ViewNote("front", 0.9 if n % 3 == 0 else 1.0), *VIEWS[1:])
        variables = LanguageVariables(task=task, views=views)
        request = MllmRequest(n=n, seed=seed, call="decide", variables=variables)
        actions.append(json.loads(FixedModel().complete(request).text)["action"])
    return actions


def test_fixed_goes_ahead_turns_where_it_is_blocked_and_stops_after_its_count():
    actions = sequence(seed=0)
    *turns, last = actions
    assert [a["direction"] for a in turns] == ["front", "front", "left"] * (FIXED_DECISIONS // 3)
    assert last == {"tool": "double_check"}
    assert actions == sequence(seed=5) == sequence(seed=0, task="Stop at once.")


def test_fixed_turns_to_the_freest_side_and_to_the_first_of_equals():
    for free, direction in (
        ((0.5, 1.0, 3.0, 2.0), "right"),
        ((0.5, 2.0, 2.0, 2.0), "left"),
        ((0.5, 0.0, 0.0, 0.1), "back"),
    ):
        names = ("front", "left", "right", "back")
        views = tuple(ViewNote(d, x) for d, x in zip(names, free, strict=True))
        variables = LanguageVariables(views=views)
        reply = FixedModel().complete(MllmRequest(n=1, call="decide", variables=variables)).text
        assert json.loads(reply)["action"] == {"tool": "turn", "direction": direction}


@pytest.mark.parametrize("model", [RandomModel(), FrontierModel(), FixedModel()])
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
    for spec, kind in (
        ("random", RandomModel),
        ("frontier", FrontierModel),
        ("fixed", FixedModel),
    ):
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
