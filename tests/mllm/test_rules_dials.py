"""The dials of ``rules``: what a spec says, what zero means, and what each draw depends on."""

import dataclasses
import itertools
import math
import statistics

import pytest
from rules_requests import request, seen, within
from teleport_ring import Home, run

from unilavira_drake.errors import InputError, ScenarioError
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.rules import RULES_PRESETS, RulesDials, RulesModel, read_dials
from unilavira_drake.mllm.rules.dials import LIMITS
from unilavira_drake.mllm.rules.draws import Draws
from unilavira_drake.mllm.rules.perception import perceived

REALISTIC = RULES_PRESETS["realistic"]


@pytest.fixture(scope="module")
def decisions():
    task = "Leave the bedroom, turn left, enter the kitchen and stop next to the refrigerator."
    return run(Home(), RulesModel(), task, "2.9,7.6,-1.5708").decisions


@pytest.mark.parametrize(
    ("text", "dials"),
    [
        ("default", RulesDials()),
        ("realistic", REALISTIC),
        ("label_dropout=0.1,wrong_direction=0.05", RulesDials(0.1, wrong_direction=0.05)),
        (" confusion = 1 , seed=7", RulesDials(confusion=1, seed=7)),
        ("realistic,seed=3,refused=0", dataclasses.replace(REALISTIC, seed=3, refused=0)),
    ],
)
def test_a_spec_sets_the_dials(text, dials):
    model = make_backend(f"rules:{text}", role="language", place="here")
    assert model.dials == dials
    assert (model.perception, model.reasoning) == ("ground_truth", "rules")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("realistc", "did you mean 'realistic'"),
        ("label_drop=0.1", "did you mean 'label_dropout'"),
        ("realistic,wrong_way=0.1", "did you mean 'wrong_direction'"),
        ("label_dropout=1.5", "label_dropout=1.5 must be a number from 0 to 1"),
        ("refused=-0.1", "refused=-0.1 must be"),
        ("malformed=often", "malformed=often must be a number"),
        ("confusion=nan", "confusion=nan must be"),
        ("seed=1.5", "seed=1.5 must be a whole number"),
        ("forgets_after=-1", "forgets_after=-1 must be a whole number"),
        ("latency=601", "latency=601 must be a number from 0 to 600"),
        ("box_jitter=", "box_jitter= must be"),
        ("seed=1,realistic", "unknown dial 'realistic'"),
        ("seed=1,latency", "latency=VALUE"),
        ("seed=1,seed=2", "given twice"),
        ("", "valid"),
    ],
)
def test_a_wrong_spec_names_what_is_right(text, message):
    with pytest.raises(ScenarioError, match=message) as error:
        make_backend(f"rules:{text}", role="vision", place="vision_model")
    assert str(error.value).startswith("vision_model: ")


def test_a_value_of_another_type_is_refused():
    for wrong in ({"confusion": True}, {"seed": 1.0}, {"latency": "1"}):
        with pytest.raises(InputError):
            RulesDials(**wrong)
    assert set(LIMITS) == {field.name for field in dataclasses.fields(RulesDials)}


def test_name_and_description_tell_the_dials():
    plain = RulesModel()
    assert plain.name == "rules"
    assert RulesModel(RulesDials()).description == plain.description
    model = RulesModel(REALISTIC)
    told = model.name.removeprefix("rules (").removesuffix(")")
    assert read_dials(told) == REALISTIC
    assert told in model.description
    assert "not a multimodal LLM" in model.description


def test_zero_dials_are_the_plain_rules_to_the_byte(decisions):
    assert len(decisions) > 5
    for decision in decisions:
        assert perceived(decision.request, RulesDials()) is decision.request
        for model in (RulesModel(RulesDials()), RulesModel(RulesDials(seed=9))):
            completion = model.complete(decision.request)
            assert completion.text == decision.reply
            assert completion == RulesModel().complete(decision.request)
            assert completion.latency is None


def test_equal_requests_get_equal_replies_and_other_requests_other_errors():
    dials = dataclasses.replace(REALISTIC, label_dropout=0.5, refused=0.0)
    for n in range(1, 30):
        texts = {RulesModel(dials).complete(request(n)).text for _ in range(3)}
        assert len(texts) == 1
    base = request(4)
    varied = [
        request(5),
        dataclasses.replace(base, seed=1),
        dataclasses.replace(base, attempt=1),
        dataclasses.replace(base, role="vision"),
        dataclasses.replace(base, variables=dataclasses.replace(base.variables, task="Stop.")),
    ]
    draws = {Draws.of(r, 0).uniform("x") for r in (base, *varied)} | {
        Draws.of(base, 1).uniform("x"),
        Draws.of(base, 0).uniform("y"),
    }
    assert len(draws) == 8
    again = dataclasses.replace(base, feedback="other words change nothing")
    assert Draws.of(again, 0) == Draws.of(base, 0)


def test_draws_are_uniform_and_normal():
    draws = [Draws(str(i)) for i in range(4000)]
    values = [d.uniform("u") for d in draws]
    assert all(0.0 < value < 1.0 for value in values)
    for tenth in range(10):
        assert within(sum(tenth <= 10 * value < tenth + 1 for value in values), 4000, 0.1)
    normal = [d.normal("z") for d in draws]
    assert abs(statistics.fmean(normal)) < 4.0 / math.sqrt(4000)
    assert abs(statistics.stdev(normal) - 1.0) < 4.0 / math.sqrt(8000)


def test_a_higher_dial_adds_errors_and_takes_none_away():
    steps = (0.0, 0.1, 0.3, 0.6, 1.0)
    for n in range(20):
        kept = [seen(request(n), label_dropout=p).keys() for p in steps]
        assert all(more >= less for more, less in itertools.pairwise(kept))
        known = [
            {k for k, d in seen(request(n), confusion=p).items() if d.category == "sofa"}
            for p in steps
        ]
        assert all(more >= less for more, less in itertools.pairwise(known))
        shifts = [abs(seen(request(n), box_jitter=p / 5)["front#1"].box[0] - 101.0) for p in steps]
        assert shifts == sorted(shifts)
    for dial in ("wrong_direction", "malformed"):
        plain = [RulesModel().complete(request(n)).text for n in range(100)]
        wrong = []
        for p in steps:
            model = RulesModel(RulesDials(**{dial: p}))
            wrong.append({n for n in range(100) if model.complete(request(n)).text != plain[n]})
        assert all(less <= more for less, more in itertools.pairwise(wrong))
        assert (len(wrong[0]), len(wrong[-1])) == (0, 100)


@pytest.mark.parametrize("seed", range(3))
def test_however_badly_it_sees_it_replies_in_form(seed):
    dials = RulesDials(0.5, 0.4, 0.5, 0.5, forgets_after=2, seed=seed)
    home, model = Home(), RulesModel(dials)
    for todo, scb in ((True, True), (False, False)):
        result = run(
            home, model, "Leave the bedroom, go to the kitchen and find the red couch.",
            "2.9,7.6,-1.5708", todo=todo, scb=scb, budget=10,
        )  # fmt: skip
        assert result.decisions
