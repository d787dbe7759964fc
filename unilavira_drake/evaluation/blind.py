"""The blind baseline of questions: what may be got right without looking at anything."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from unilavira_drake.evaluation.answers import is_correct
from unilavira_drake.messages import Message
from unilavira_drake.scenario import NamedTask


@dataclass(frozen=True)
class BlindResult(Message):
    """What constant answers come to."""

    answers: tuple[tuple[str, str], ...] = ()
    """For each type of question the answer that is always given."""
    correct: int = 0
    questions: int = 0

    @property
    def share(self) -> float:
        """Share of the questions that are answered correctly; NaN without any."""
        return self.correct / self.questions if self.questions else math.nan


def blind_baseline(tasks: Mapping[str, NamedTask]) -> BlindResult:
    """Returns how well the commonest answer to each type of question does without moving.

    It is taken from the very questions that it is tried on: no answer that goes by the type alone
    does better, so what an agent scores above this it owes to looking.  Of equally common answers
    the first in the alphabet is taken.  Tasks without an expected answer are left out.
    """
    asked = [task for task in tasks.values() if task.answer]
    types = sorted({task.question_type for task in asked})
    correct, answers = 0, []
    for kind in types:
        same = [task for task in asked if task.question_type == kind]
        counts = Counter(task.answer for task in same)
        answer = min(counts, key=lambda text: (-counts[text], text))
        answers.append((kind, answer))
        correct += sum(is_correct(answer, (task.answer, *task.accept)) for task in same)
    return BlindResult(tuple(answers), correct, len(asked))
