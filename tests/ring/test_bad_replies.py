"""``rules`` with malformed and refused replies in the ring: re-asks, then the safe actions."""

from __future__ import annotations

import pytest
from dummy_levels import language_action, make_ring
from pydrake.systems.analysis import Simulator

from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.rules import RulesDials, RulesModel


class WatchedRules(RulesModel):
    """Remembers what it was asked."""

    def __init__(self, dials: RulesDials) -> None:
        super().__init__(dials)
        self.requests: list[MllmRequest] = []

    def complete(self, request: MllmRequest) -> Completion:
        """Answers as the rules do."""
        self.requests.append(request)
        return super().complete(request)


def watch(seconds: float = 60.0, **dials: float) -> tuple[WatchedRules, object]:
    language, vision = WatchedRules(RulesDials(**dials)), RulesModel(RulesDials(**dials))
    diagram = make_ring(language, vision)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(seconds)
    return language, language_action(diagram, simulator.get_context())


def test_a_malformed_reply_is_asked_again_once_with_what_was_wrong() -> None:
    model, action = watch(malformed=1.0)
    asked = [(r.n, r.attempt) for r in model.requests]
    assert asked == [(1 + i // 2, i % 2) for i in range(len(asked))]
    assert len(asked) >= 6
    assert all(bool(r.feedback) == (r.attempt == 1) for r in model.requests)
    assert action.fallback
    assert (action.call, action.tool) == ("decide", "none")


def test_a_reask_may_succeed() -> None:
    model, _ = watch(malformed=0.5)
    again = {r.n for r in model.requests if r.attempt == 1}
    assert again
    assert again < {r.n for r in model.requests}


def test_a_refusal_is_not_asked_again() -> None:
    model, action = watch(refused=1.0)
    assert {r.attempt for r in model.requests} == {0}
    assert action.fallback
    assert "ReplyRefused" in action.reason


@pytest.mark.parametrize("seed", [1, 2])
def test_equal_seeds_make_equal_mistakes(seed: int) -> None:
    (a, last), (b, other) = (watch(malformed=0.3, refused=0.2, seed=seed) for _ in range(2))
    # The last request is issued as the simulation ends; its call may come a moment too late.
    answered = min(len(a.requests), len(b.requests))
    assert answered >= 6
    assert abs(len(a.requests) - len(b.requests)) <= 1
    assert [r.digest for r in a.requests[:answered]] == [r.digest for r in b.requests[:answered]]
    assert last == other
