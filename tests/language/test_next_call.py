from __future__ import annotations

import itertools

import pytest

from unilavira_drake.language.next_call import next_call
from unilavira_drake.messages import CALLS, TOOLS, LanguageAction, Outcome
from unilavira_drake.tasks import FAMILIES

ARRIVED, FAILED = Outcome("arrived"), Outcome("failed", "stuck")


@pytest.mark.parametrize(
    ("last", "outcome", "family", "has_todo", "expected"),
    [
        (LanguageAction(), ARRIVED, "vln", True, "plan_todo"),
        (LanguageAction(), ARRIVED, "vln", False, "decide"),
        (LanguageAction(1, "plan_todo", "stay"), ARRIVED, "vln", True, "decide"),
        (LanguageAction(2, "decide", "turn"), ARRIVED, "vln", True, "decide"),
        (LanguageAction(2, "decide", "turn"), FAILED, "vln", True, "decide"),
        (LanguageAction(2, "decide", "none"), FAILED, "vln", True, "decide"),
        (LanguageAction(2, "decide", "backtrack"), ARRIVED, "vln", True, "recover"),
        (LanguageAction(2, "recover", "backtrack"), ARRIVED, "vln", False, "recover"),
        (LanguageAction(2, "decide", "backtrack"), FAILED, "vln", True, "decide"),
        (LanguageAction(2, "decide", "double_check"), ARRIVED, "vln", True, "double_check"),
        (
            LanguageAction(2, "double_check", "stay", confirmed=False),
            ARRIVED,
            "eqa",
            True,
            "decide",
        ),
        (LanguageAction(2, "double_check", "stay", confirmed=True), ARRIVED, "eqa", True, "answer"),
        (LanguageAction(2, "double_check", "none"), FAILED, "eqa", True, "decide"),
    ],
)
def test_rows(
    last: LanguageAction, outcome: Outcome, family: str, has_todo: bool, expected: str
) -> None:
    assert next_call(last, outcome, family=family, has_todo=has_todo) == expected


def test_a_mere_revert_is_followed_by_an_ordinary_decision() -> None:
    back = LanguageAction(2, "decide", "backtrack")
    found = next_call(back, ARRIVED, family="vln", has_todo=False, revert_only=True)
    assert found == "decide"


def test_every_case_is_exactly_one_row() -> None:
    cases = itertools.product(
        (0, 3), CALLS, TOOLS, (None, False, True), (ARRIVED, FAILED), FAMILIES, (False, True)
    )
    for n, call, tool, confirmed, outcome, family, has_todo in cases:
        last = LanguageAction(n, call, tool, confirmed=confirmed)
        got = next_call(last, outcome, family=family, has_todo=has_todo)
        recover = n > 0 and tool == "backtrack" and outcome is ARRIVED
        check = n > 0 and tool == "double_check"
        confirmed_verdict = n > 0 and call == "double_check" and confirmed is True
        rows = {
            "plan_todo": n == 0 and has_todo,
            "recover": recover,
            "double_check": check,
            "answer": confirmed_verdict and family == "eqa" and not recover and not check,
        }
        true_rows = [name for name, applies in rows.items() if applies]
        assert len(true_rows) <= 1
        assert got == (true_rows[0] if true_rows else "decide")
