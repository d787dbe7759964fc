"""Answers to questions: what counts as the same, and what an episode gets for it."""

from __future__ import annotations

import pytest

from unilavira_drake.evaluation.answers import is_correct, judge_answer
from unilavira_drake.evaluation.scoring import Score


@pytest.mark.parametrize(
    ("answer", "correct"),
    [
        ("blue", True),
        ("It is Blue.", True),
        ("navy", True),
        ("the  navy", True),
        ("blue and red", False),
        ("light blue", False),
        ("", False),
        ("unknown", False),
    ],
)
def test_an_answer_is_an_accepted_one_written_differently_or_not(
    answer: str, correct: bool
) -> None:
    assert is_correct(answer, ("blue", "navy")) is correct


@pytest.mark.parametrize("stopped", [True, False])
def test_success_is_a_correct_answer_at_the_agents_own_stop(stopped: bool) -> None:
    place = Score(success=False, navigation_error_m=4.0, spl=0.0)
    verdict = judge_answer(place, "blue", ("blue",), stopped=stopped)
    assert (verdict.success, verdict.answer_correct) == (stopped, True)
    assert (verdict.navigation_error_m, verdict.spl) == (4.0, None)


def test_a_wrong_answer_fails_wherever_the_robot_stood() -> None:
    verdict = judge_answer(Score(success=True, spl=1.0), "red", ("blue",), stopped=True)
    assert (verdict.success, verdict.answer_correct) == (False, False)
