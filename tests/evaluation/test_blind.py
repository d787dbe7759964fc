"""The blind baseline: the best constant answer for each type of question."""

from __future__ import annotations

import itertools
import math

from unilavira_drake import load_scenario
from unilavira_drake.evaluation.answers import is_correct
from unilavira_drake.evaluation.blind import blind_baseline
from unilavira_drake.scenario import NamedTask


def question(kind: str, answer: str, *accept: str) -> NamedTask:
    return NamedTask("eqa", "What?", answer=answer, accept=list(accept), question_type=kind)


def test_the_commonest_answer_of_each_type_is_given() -> None:
    tasks = [
        question("color", "red"),
        question("color", "blue"),
        question("color", "red"),
        question("color", "crimson", "red"),
        question("existence", "yes"),
        question("existence", "no"),
        NamedTask("vln", "Go."),
    ]
    blind = blind_baseline({str(i): task for i, task in enumerate(tasks)})
    assert blind.answers == (("color", "red"), ("existence", "no"))
    assert (blind.correct, blind.questions) == (4, 6)
    assert blind.share == 4 / 6
    assert math.isnan(blind_baseline({}).share)


def test_no_constant_answers_do_better_on_the_apartments_questions() -> None:
    tasks = load_scenario("apartment_eqa").tasks
    blind = blind_baseline(tasks)
    best = 0
    by_type = itertools.groupby(
        sorted(tasks.values(), key=lambda task: task.question_type), lambda t: t.question_type
    )
    for _, same in by_type:
        group = list(same)
        best += max(
            sum(is_correct(guess.answer, (t.answer, *t.accept)) for t in group) for guess in group
        )
    assert blind.correct == best
    assert blind.share < 0.5
