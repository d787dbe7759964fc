"""Where code of this kind departs from the paper's actions and answers, ours does not.

One test for each point; what the paper says stands above it (sections III-B and IV).
"""

from __future__ import annotations

import contextlib
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.evaluation.answers import is_correct
from unilavira_drake.evaluation.judge import judge
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.language.variables import language_request
from unilavira_drake.mapping.goal_selector import NO_STAIRS, select_goal
from unilavira_drake.messages import (
    DIRECTIONS,
    Frame,
    History,
    Intrinsics,
    LanguageAction,
    Outcome,
    Panorama,
    SecondChance,
    TodoList,
    VisionAction,
    Waypoint,
)
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.reply_schema import gemini_schema, openai_schema, request_schema
from unilavira_drake.mllm.request import MllmRequest, VisionVariables
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.reply import parse_vision_reply

LENS = Intrinsics(64, 48, 40.0, 40.0, 31.5, 23.5)
WALL = 3.0
X_WC = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
"""The camera looks along x from one metre above the floor."""


ARRIVED = Outcome()
TURNED = LanguageAction(3, "decide", "turn", "left")


def panorama(n: int, outcome: Outcome = ARRIVED) -> Panorama:
    depth = np.full((48, 64), WALL, np.float32)
    frames = tuple(
        Frame(view=d, jpeg=d.encode(), depth=depth, intrinsics=LENS, X_WC=X_WC) for d in DIRECTIONS
    )
    return Panorama(n=n, first=n, frames=frames, outcome=outcome)


def asked(
    call: str = "decide", n: int = 4, *, can_climb: bool = False, free: float = 2.0,
    failed: str = "", last: LanguageAction = TURNED, outcome: Outcome = ARRIVED,
) -> MllmRequest:  # fmt: skip
    history = History(n=n, current=2, waypoints=(Waypoint(1), Waypoint(2)))
    return language_request(
        call=call, seed=0, task=TaskSpec("vln", "Go upstairs."), panorama=panorama(n, outcome),
        history=history, second_chance=SecondChance(n, (1,), (), failed), todo=TodoList(n - 1),
        last_action=last, can_climb=can_climb, free_distance=lambda frame: free, detector=None,
    )  # fmt: skip


def reply(action: dict[str, Any]) -> str:
    said = dict.fromkeys(("progress_analysis", "reasoning_todo", "reasoning_action", "scene"), "")
    return json.dumps({**said, "todo_updates": [], "action": action})


def form_of(request: MllmRequest) -> dict[str, Any]:
    """Returns the form to which a server holds the reply."""
    form = request_schema(request)
    assert form is not None
    return form


@pytest.mark.parametrize("stair", ["up", "down"])
def test_row_go_stair_is_an_action(stair: str) -> None:
    """The paper: go_stair(up/down) is one of the four tools, beside turn, backtrack, double_check;
    no flag on another.
    """
    climber, roller = asked(can_climb=True), asked(can_climb=False)
    action = parse_language_reply(reply({"tool": "go_stair", "stair": stair}), climber)
    assert (action.tool, action.argument, action.direction) == ("go_stair", stair, "")
    # It is offered to a robot that climbs, and to no other.
    assert "go_stair(stair)" in compose_prompt(climber).text
    assert "stair" not in compose_prompt(roller).text.replace("Go upstairs.", "")
    for dialect in (openai_schema, gemini_schema):
        forms = [json.dumps(dialect(form_of(request))) for request in (climber, roller)]
        assert ["go_stair" in form for form in forms] == [True, False]
    with pytest.raises(ReplyFormatError, match="cannot climb"):
        parse_language_reply(reply({"tool": "go_stair", "stair": stair}), roller)
    # A turn has no stair, and a stair without a direction to climb is none.
    with pytest.raises(ReplyFormatError):
        parse_language_reply(reply({"tool": "go_stair"}), climber)
    # Where no stairs are seen, that is told: the action is never taken for another.
    blind = VisionAction(4, "front", reason="nothing but doors")
    goal = select_goal(action, blind, History(), panorama(4), max_range=10.0)
    assert (goal.kind, goal.reason) == ("none", f"{NO_STAIRS}: nothing but doors")


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    call=st.sampled_from(("decide", "recover")),
    n=st.integers(2, 40),
    free=st.sampled_from((0.0, 0.3, 0.83, 5.0, float("inf"))),
    failed=st.sampled_from(("", "front", "left", "right")),
    outcome=st.sampled_from((Outcome(), Outcome("failed", "stuck"))),
)
def test_row_behind_is_offered_at_every_decision(
    call: str, n: int, free: float, failed: str, outcome: Outcome
) -> None:
    """The paper: turn takes front, left, right or back, at every step; none is hidden."""
    failed = failed if call == "recover" else ""
    last = LanguageAction(n - 1, "decide", "backtrack" if call == "recover" else "turn", "left")
    request = asked(call, n, free=free, failed=failed, last=last, outcome=outcome)
    lines = compose_prompt(request).text.splitlines()
    for direction in DIRECTIONS:
        (line,) = (line for line in lines if line.startswith(f"View {direction}:"))
        assert "free distance" in line
        assert f"view {direction}" in [image.label for image in request.images]
    action = parse_language_reply(reply({"tool": "turn", "direction": "back"}), request)
    assert action.direction == "back"
    assert '"back"' in json.dumps(form_of(request)["properties"]["action"])


def test_row_select_takes_a_point() -> None:
    """The paper: select gives a box, or a pixel where a box is ill-defined."""
    variables = VisionVariables(width=64, height=48)
    request = MllmRequest("vision", 4, call="ground", variables=variables)
    mark = {"target_desc": "floor behind the door", "confidence": 0.9, "reason": ""}
    goals = {}
    for name, place in (("point", {"box": None, "point": [41, 30]}),
                        ("box", {"box": [36, 25, 46, 35], "point": None})):  # fmt: skip
        vision = parse_vision_reply(json.dumps({**mark, **place}), request)
        assert (vision.point is None, vision.box is None) == (name == "box", name == "point")
        action = LanguageAction(4, "decide", "turn", "front")
        goals[name] = select_goal(action, vision, History(), panorama(4), max_range=10.0)
        assert goals[name].kind == "go"
    # p = d K^-1 [u, v, 1], in the world.
    expected = X_WC @ [(41 - 31.5) / 40 * WALL, (30 - 23.5) / 40 * WALL, WALL, 1.0]
    assert goals["point"].p_WG == pytest.approx(expected[:3])
    assert goals["point"].pixel == (41.0, 30.0)
    assert goals["box"].p_WG == pytest.approx(expected[:3], abs=0.1)
    assert {"box", "point"} <= set(form_of(request)["properties"])
    assert "a point" in compose_prompt(request).text


class Examiner:
    """Gives the next of its marks."""

    name, perception, reasoning, box_space = "examiner", "images", "model", "pixels"
    description, deadline = "a script", 5.0

    def __init__(self, *marks: int) -> None:
        self.marks = list(marks)
        self.requests: list[MllmRequest] = []

    def complete(self, request: MllmRequest) -> Completion:
        self.requests.append(request)
        return Completion(json.dumps({"reasoning": "compared", "score": self.marks.pop(0)}))

    def close(self) -> None:
        """Does nothing."""


def test_row_answers_are_judged_by_a_model() -> None:
    """The paper: an answer in free words is judged by a model by the protocol of OpenEQA, a mark
    from 1 to 5; neither the answer nor the expected one need come from a list of words.
    """
    question, expected = "What stands beside the sofa?", ("a potted plant",)
    answers = ("some greenery in a pot", "a plant", "a lamp", "a potted plant")
    examiner = Examiner(5, 4, 1, 5)
    with contextlib.closing(Broker(examiner)) as broker:
        found = [judge(broker, question, answer, expected) for answer in answers]
    assert [one.score for one in found] == [1.0, 0.75, 0.0, 1.0]
    # Word for word most of them would be wrong.
    assert [is_correct(answer, expected) for answer in answers] == [False, False, False, True]
    for request, answer in zip(examiner.requests, answers, strict=True):
        text = compose_prompt(request).text
        for words in (question, expected[0], answer):
            assert json.dumps(words) in text
        assert request.images == ()
        score = form_of(request)["properties"]["score"]
        assert (score["minimum"], score["maximum"]) == (1, 5)
