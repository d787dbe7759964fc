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


def test_a_closed_question_brings_its_choices_and_its_rule() -> None:
    scenario = load_scenario("apartment_eqa")
    scenario.task.text = "in which room is the PIANO?"
    task = choose_task(scenario)
    assert (task.name, task.answers[0]) == ("piano_room", "dining room")
    assert "dining room" in task.spec.choices
    assert (task.rule.by_answer, task.rule.protocol) == (True, "home")


def test_a_protocol_of_the_task_is_its_rule() -> None:
    scenario = load_scenario("flat", "tasks: {fridge: {protocol: habitat}}")
    scenario.task.text = "@fridge"
    assert (choose_task(scenario).rule.radius, choose_task(scenario).rule.strict) == (3.0, True)
