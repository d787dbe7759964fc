"""What ``rules`` with dials does wrong: turns, texts, refusals, and how long it takes."""

import json

import pytest
from rules_requests import request, within

from unilavira_drake.errors import ReplyFormatError, ReplyRefused
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.messages import DIRECTIONS
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.rules import RulesDials, RulesModel
from unilavira_drake.vision.reply import parse_vision_reply

CALLS = ("plan_todo", "decide", "recover", "double_check", "answer", "ground")


def direction_of(request_, **dials):
    reply = json.loads(RulesModel(RulesDials(**dials)).complete(request_).text)
    return reply["action"]["direction"]


def parsed(text, request_):
    parse = parse_vision_reply if request_.role == "vision" else parse_language_reply
    return parse(text, request_)


def test_wrong_directions_are_as_frequent_as_said_and_never_the_excluded_one():
    right = [direction_of(request(n)) for n in range(400)]
    wrong = [direction_of(request(n), wrong_direction=0.25) for n in range(400)]
    assert within(sum(a != b for a, b in zip(right, wrong, strict=True)), 400, 0.25)
    always = [direction_of(request(n), wrong_direction=1.0) for n in range(400)]
    assert all(a != b for a, b in zip(right, always, strict=True))
    assert {*always} == {*DIRECTIONS} - {"front"}
    recovered = {direction_of(request(n, "recover"), wrong_direction=1.0) for n in range(100)}
    assert "back" not in recovered
    assert len(recovered) >= 2


def test_a_wrong_turn_is_a_valid_reply_that_asks_for_the_floor_there():
    for n in range(40):
        asked = request(n, "recover")
        plain = json.loads(RulesModel().complete(asked).text)
        reply = RulesModel(RulesDials(wrong_direction=1.0)).complete(asked).text
        action = parse_language_reply(reply, asked)
        free = 2.0 + DIRECTIONS.index(action.direction)
        order = f"Target: open floor, about {min(free - 0.6, 3.5):.1f} m, 0 deg left of the "
        assert action.reasoning_action.endswith(f"{order}{action.direction} view's axis.")
        for field in ("progress_analysis", "reasoning_todo", "todo_updates", "scene"):
            assert json.loads(reply)[field] == plain[field]


def test_other_tools_know_no_wrong_direction():
    for call in ("plan_todo", "double_check", "answer", "ground"):
        asked = request(3, call)
        assert RulesModel(RulesDials(wrong_direction=1.0)).complete(asked) == (
            RulesModel().complete(asked)
        )


@pytest.mark.parametrize("call", CALLS)
def test_malformed_replies_are_as_frequent_as_said_and_cannot_be_read(call):
    model, bad, forms = RulesModel(RulesDials(malformed=0.4)), 0, set()
    for n in range(250):
        asked = request(n, call)
        text, plain = model.complete(asked).text, RulesModel().complete(asked).text
        if text != plain:
            bad += 1
            with pytest.raises(ReplyFormatError) as error:
                parsed(text, asked)
            assert error.value.worth_a_reask
            forms.add("cut" if plain.startswith(text) else text[0])
    assert within(bad, 250, 0.4)
    assert forms == {"cut", "I", "{"}


def test_refusals_are_as_frequent_as_said_and_never_worth_a_reask():
    model, refused = RulesModel(RulesDials(refused=0.2)), 0
    for n in range(500):
        try:
            model.complete(request(n))
        except ReplyRefused:
            refused += 1
    assert within(refused, 500, 0.2)
    with pytest.raises(ReplyRefused, match="refused=1") as error:
        RulesModel(RulesDials(refused=1.0, latency=3.0)).complete(request(1))
    assert not error.value.worth_a_reask
    assert error.value.latency == 3.0


def test_latency_is_what_the_broker_reports():
    for dials, bounds in ((RulesDials(latency=12.5), (12.5, 12.5)), (RulesDials(), (0.0, 5.0))):
        broker = Broker(RulesModel(dials))
        broker.result(request(1))
        seconds = broker.latency(request(1))
        broker.close()
        assert bounds[0] <= seconds <= bounds[1]
