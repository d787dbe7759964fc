"""Scoring answers to questions: exact match with an accepted answer, written differently or not."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from unilavira_drake.answer_words import chosen, folded
from unilavira_drake.evaluation.scoring import Score


def is_correct(answer: str, accepted: Sequence[str], choices: Sequence[str] = ()) -> bool:
    """Returns whether an answer is one of the accepted ones.

    Case, marks, articles, British spelling and numbers as words are folded: ``It is grey.`` equals
    ``gray``, ``four`` equals ``4``; ``grey and red`` equals neither.

    Args:
        answer: the agent's; empty when it gave none.
        accepted: answers that count.
        choices: a closed vocabulary; what :func:`chosen` finds of it in the answer counts too.
    """
    right = {folded(text) for text in accepted} - {""}
    return folded(answer) in right or folded(chosen(answer, choices)) in right


def score_answer(
    verdict: Score,
    answer: str,
    accepted: Sequence[str],
    *,
    stopped: bool,
    choices: Sequence[str] = (),
) -> Score:
    """Returns the verdict on a question: success is a correct answer given by the agent's own stop.

    Where the robot stood is kept beside it; SPL is not defined for an answer.

    Args:
        verdict: on where the robot stopped.
        answer: the agent's; empty when it gave none.
        accepted: answers that count.
        stopped: whether the agent ended the episode itself.
        choices: a closed vocabulary of answers.
    """
    correct = is_correct(answer, accepted, choices)
    return dataclasses.replace(
        verdict, success=stopped and correct, answer_correct=correct, spl=None
    )
