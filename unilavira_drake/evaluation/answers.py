"""Scoring answers to questions: exact match with an accepted answer, written differently or not."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from unilavira_drake.evaluation.scoring import Score

_ARTICLES = frozenset(("a", "an", "the", "it", "is"))
_NUMBERS = (
    *("zero", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_SAME = {"grey": "gray", **{word: str(number) for number, word in enumerate(_NUMBERS)}}


def is_correct(answer: str, accepted: Sequence[str], choices: Sequence[str] = ()) -> bool:
    """Returns whether an answer is one of the accepted ones.

    Case, marks, articles, British spelling and numbers as words are folded: ``It is grey.`` equals
    ``gray``, ``four`` equals ``4``; ``grey and red`` equals neither.

    Args:
        answer: the agent's; empty when it gave none.
        accepted: answers that count.
        choices: a closed vocabulary; what :func:`chosen` finds of it in the answer counts too.
    """
    right = {_folded(text) for text in accepted} - {""}
    return _folded(answer) in right or _folded(chosen(answer, choices)) in right


def chosen(answer: str, choices: Sequence[str]) -> str:
    """Returns the one choice that an answer names, empty when it names none or several.

    A choice inside a longer one that is named does not count: of ``room`` and ``dining room``,
    ``the dining room`` names the latter.
    """
    said = f" {_folded(answer)} "
    found = []
    for choice in sorted(choices, key=lambda text: -len(_folded(text))):
        words = f" {_folded(choice)} "
        if words.strip() and words in said:
            said = said.replace(words, " | ")
            found.append(choice)
    return found[0] if len(found) == 1 else ""


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


def _folded(text: str) -> str:
    words = re.findall(r"[^\W_]+", text.casefold())
    return " ".join(_SAME.get(word, word) for word in words if word not in _ARTICLES)
