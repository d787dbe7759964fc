"""The predecessor's wiring: no TODO list, one step back at most, nothing told of what failed."""

from __future__ import annotations

from dummy_levels import (
    ScriptedModel,
    decide,
    make_ring,
    run_until_stop,
    select,
    verdict,
)

from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import LanguageVariables

SCRIPT = {
    1: decide("turn", direction="front"),
    2: decide("turn", direction="left"),
    3: decide("turn", direction="left"),  # stuck where it began
    4: decide("backtrack", waypoint=1),  # two steps back: not offered
    (4, 1): decide("turn", direction="front"),
    5: decide("backtrack", waypoint=3),
    6: decide("backtrack", waypoint=4),  # a revert is not reverted
    (6, 1): decide("turn", direction="right"),
    7: decide("double_check"),
    8: verdict(True),
}


def shown() -> ScriptedModel:
    language = ScriptedModel(SCRIPT)
    vision = ScriptedModel({}, default=select())
    run_until_stop(make_ring(language, vision, ablation="lavira", failures={3: "unreachable"}))
    return language


def offers(model: ScriptedModel, n: int) -> tuple[int, ...]:
    variables = model.request(n).variables
    assert isinstance(variables, LanguageVariables)
    return tuple(note.id for note in variables.waypoints if note.offered)


def test_it_goes_back_one_step_and_decides_as_if_nothing_had_been() -> None:
    model = shown()
    calls = [(r.n, r.attempt, r.call) for r in model.requests]
    assert calls == [
        (1, 0, "decide"),
        (2, 0, "decide"),
        (3, 0, "decide"),
        (4, 0, "decide"),
        (4, 1, "decide"),
        (5, 0, "decide"),
        (6, 0, "decide"),
        (6, 1, "decide"),
        (7, 0, "decide"),
        (8, 0, "double_check"),
    ]
    assert [offers(model, n) for n in (1, 2, 3, 4, 5, 6, 7)] == [(), (1,), (2,), (), (3,), (), (3,)]
    assert "choose among" in model.request(4, 1).feedback or "no waypoint" in (
        model.request(4, 1).feedback
    )


def test_no_failure_is_told_but_the_last_one() -> None:
    model = shown()
    variables = model.request(6).variables
    assert isinstance(variables, LanguageVariables)
    assert variables.second_chance
    assert variables.failed_edges == ()
    assert variables.failed_direction == ""
    tried = [text for note in variables.waypoints for text in note.tried]
    assert tried
    assert all(": arrived" in text for text in tried)
    prompt = compose_prompt(model.request(6)).text
    assert "TODO" not in prompt
    assert "given up" not in prompt
    assert "backtrack(waypoint)" in prompt
