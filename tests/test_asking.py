"""One call with its re-ask, outside of any Diagram."""

from __future__ import annotations

import json

import pytest

from unilavira_drake.asking import ask
from unilavira_drake.errors import (
    MllmError,
    MllmTimeout,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
)
from unilavira_drake.messages import LanguageAction, VisionAction
from unilavira_drake.mllm.reply import Attempt, Completion
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables

PLAN = MllmRequest(n=4, call="plan_todo", variables=LanguageVariables(task="Go.", todo=()))
GROUND = MllmRequest(role="vision", n=4, call="ground", variables=VisionVariables(task="Go."))
GOOD_PLAN = json.dumps({"reasoning": "", "todo": ["Go."]})
GOOD_MARK = json.dumps(
    {"target_desc": "door", "box": [10, 20, 30, 60], "point": None, "confidence": 1, "reason": ""}
)


class Scripted:
    """Gives one outcome after the other, each with one attempt."""

    name = "scripted"
    perception = "images"
    reasoning = "model"
    description = "a script"
    box_space = "pixels"
    deadline = 1.0

    def __init__(self, *outcomes: str | MllmError | ReplyFormatError) -> None:
        self.outcomes = list(outcomes)
        self.asked: list[MllmRequest] = []

    def complete(self, request: MllmRequest) -> Completion:
        """Gives the next outcome."""
        self.asked.append(request)
        attempts = (Attempt("scripted", detail=str(len(self.asked))),)
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, str):
            return Completion(outcome, attempts=attempts)
        outcome.attempts = attempts
        raise outcome

    def close(self) -> None:
        """Does nothing."""


def test_a_usable_reply_is_asked_for_once() -> None:
    model = Scripted(GOOD_PLAN)
    heard: list[str] = []
    action = ask(model, PLAN, on_reply=lambda _, reply: heard.append(reply.text))
    assert isinstance(action, LanguageAction)
    assert (action.n, action.tool, len(action.todo_updates)) == (4, "stay", 1)
    assert model.asked == [PLAN]
    assert heard == [GOOD_PLAN]


def test_an_unusable_reply_is_asked_for_once_more_with_what_was_wrong() -> None:
    model = Scripted(GOOD_MARK.replace("60", "20"), GOOD_MARK)
    action = ask(model, GROUND)
    assert isinstance(action, VisionAction)
    assert action.box == (10.0, 20.0, 30.0, 60.0)
    first, second = model.asked
    assert first == GROUND
    assert second.attempt == 1
    assert "box [10, 20, 30, 20] is too small" in second.feedback


def test_two_unusable_replies_are_an_error_with_the_attempts_of_both() -> None:
    model = Scripted("Sure!", ReplyFormatError("the reply holds no text."))
    with pytest.raises(ReplyFormatError, match="holds no text") as caught:
        ask(model, PLAN)
    assert [attempt.detail for attempt in caught.value.attempts] == ["1", "2"]
    assert len(model.asked) == 2


def test_an_empty_reply_is_worth_a_second_question() -> None:
    model = Scripted(ReplyFormatError("the reply holds no text."), GOOD_PLAN)
    assert isinstance(ask(model, PLAN), LanguageAction)
    assert model.asked[1].feedback == "the reply holds no text."


@pytest.mark.parametrize(
    "error", [ReplyRefused("no"), ReplyTruncated("long"), MllmTimeout("late")], ids=repr
)
def test_what_would_not_get_better_is_not_asked_again(error: MllmError | ReplyFormatError) -> None:
    model = Scripted(error)
    with pytest.raises(type(error)) as caught:
        ask(model, PLAN)
    assert len(model.asked) == len(caught.value.attempts) == 1


def test_an_error_after_a_re_ask_carries_all_attempts() -> None:
    model = Scripted("Sure!", MllmTimeout("late"))
    with pytest.raises(MllmTimeout) as caught:
        ask(model, PLAN)
    assert [attempt.detail for attempt in caught.value.attempts] == ["1", "2"]
