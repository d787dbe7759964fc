"""Answers to questions: what counts as the same, and what an episode gets for it."""

from __future__ import annotations

import pytest

from unilavira_drake.answer_words import chosen
from unilavira_drake.evaluation.answers import is_correct, score_answer
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
        ("the", False),
        ("unknown", False),
    ],
)
def test_an_answer_is_an_accepted_one_written_differently_or_not(
    answer: str, correct: bool
) -> None:
    assert is_correct(answer, ("blue", "navy")) is correct


@pytest.mark.parametrize(
    ("answer", "accepted", "correct"),
    [
        ("It is grey.", "gray", True),
        ("gray", "Grey", True),
        ("Four", "4", True),
        ("4", "four", True),
        ("twelve", "12", True),
        ("fourteen", "4", False),
        ("4 or 5", "4", False),
        ("", "", False),
    ],
)
def test_spelling_and_numbers_as_words_are_folded(
    answer: str, accepted: str, correct: bool
) -> None:
    assert is_correct(answer, (accepted,)) is correct


ROOMS = ("room", "dining room", "living room", "study", "children's room")


@pytest.mark.parametrize(
    ("answer", "choice"),
    [
        ("The piano stands in the dining room.", "dining room"),
        ("DINING ROOM", "dining room"),
        ("the childrens room", "room"),
        ("in the children’s room", "children's room"),
        ("some other room", "room"),
        ("the dining room or the living room", ""),
        ("the dining room, a large room", ""),
        ("studying", ""),
        ("", ""),
    ],
)
def test_of_a_closed_vocabulary_the_one_choice_named_counts(answer: str, choice: str) -> None:
    assert chosen(answer, ROOMS) == choice
    assert chosen(answer, ROOMS[::-1]) == choice
    assert chosen(answer, ()) == ""


def test_an_open_answer_must_be_exact_and_a_closed_one_may_be_a_sentence() -> None:
    sentence = "Yes, there is a whiteboard on the wall."
    assert not is_correct(sentence, ("yes",))
    assert is_correct(sentence, ("yes",), ("yes", "no"))
    assert not is_correct("No, or yes.", ("yes",), ("yes", "no"))
    assert is_correct("the home office", ("study", "home office"), ("study", "kitchen"))


@pytest.mark.parametrize("stopped", [True, False])
def test_success_is_a_correct_answer_at_the_agents_own_stop(stopped: bool) -> None:
    place = Score(success=False, navigation_error_m=4.0, spl=0.0)
    verdict = score_answer(place, "blue", ("blue",), stopped=stopped)
    assert (verdict.success, verdict.answer_correct) == (stopped, True)
    assert (verdict.navigation_error_m, verdict.spl) == (4.0, None)


def test_a_wrong_answer_fails_wherever_the_robot_stood() -> None:
    verdict = score_answer(Score(success=True, spl=1.0), "red", ("blue",), stopped=True)
    assert (verdict.success, verdict.answer_correct) == (False, False)
