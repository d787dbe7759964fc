"""Scoring answers to questions: exact match with an accepted answer, written differently or not."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from unilavira_drake.evaluation.scoring import Score

_ARTICLES = frozenset(("a", "an", "the", "it", "is"))


def is_correct(answer: str, accepted: Sequence[str]) -> bool:
    """Returns whether an answer is one of the accepted ones; case, marks and articles are folded.

    ``It is grey.`` equals ``grey``; ``grey and red`` does not.
    """
    return bool(answer) and _folded(answer) in {_folded(text) for text in accepted}


def judge_answer(verdict: Score, answer: str, accepted: Sequence[str], *, stopped: bool) -> Score:
    """Returns the verdict on a question: success is a correct answer given by the agent's own stop.

    Where the robot stood is kept beside it; SPL is not defined for an answer.

    Args:
        verdict: on where the robot stopped.
        answer: the agent's; empty when it gave none.
        accepted: answers that count.
        stopped: whether the agent ended the episode itself.
    """
    correct = is_correct(answer, accepted)
    return dataclasses.replace(
        verdict, success=stopped and correct, answer_correct=correct, spl=None
    )


def _folded(text: str) -> str:
    words = re.findall(r"[^\W_]+", text.casefold())
    return " ".join(word for word in words if word not in _ARTICLES)
