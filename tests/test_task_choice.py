"""Which task an episode runs, and what it asks for."""

from __future__ import annotations

import pytest

from unilavira_drake import load_scenario
from unilavira_drake.task_choice import choose_task


@pytest.mark.parametrize(
    ("text", "family"),
    [
        ("What color is the armchair in the study?", "eqa"),
        ("Where is the TV? Go to it.", "vln"),
        ("Go to the sofa.", "vln"),
    ],
)
def test_own_words_that_end_in_a_question_mark_ask_for_an_answer(text: str, family: str) -> None:
    scenario = load_scenario("office")
    scenario.task.text = text
    task = choose_task(scenario)
    assert (task.spec.family, task.name, task.answers) == (family, "", ())


def test_a_named_question_brings_its_answers() -> None:
    scenario = load_scenario("office")
    scenario.task.text = "@sofa_color"
    task = choose_task(scenario)
    assert (task.spec.family, task.answers) == ("eqa", ("orange",))
