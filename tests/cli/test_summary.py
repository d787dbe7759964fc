"""The end of a run: what a judge said and what it cost, and words that are no commands."""

from __future__ import annotations

import dataclasses
import io
import shlex
from pathlib import Path

import pytest
from rich.console import Console

from unilavira_drake.cli.summary import next_commands, print_summary
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.recording.result import (
    EpisodeResult,
    JudgeResult,
    MetricsResult,
    ModelResult,
    TaskResult,
    UsageResult,
)
from unilavira_drake.scenario import NamedTask, Scenario
from unilavira_drake.scenario_loading import load_scenario

LANGUAGE = ModelUsage(1, 0, 1, Usage(900, 90, 12, 0.25))
UNPRICED = ModelUsage(1, 0, 1, Usage(900, 90, 12, None))
JUDGE = ModelUsage(1, 0, 1, Usage(300, 30, 0, 0.5))
ANSWERED = EpisodeResult(
    scored=True,
    success=False,
    cause="stopped",
    metrics=MetricsResult(answer="pink", answer_correct=False, answer_score=0.75),
    judge=JudgeResult("a judge", 4, "Close to it."),
    usage=UsageResult.of(LANGUAGE, ModelUsage(), JUDGE),
)


def printed(result: EpisodeResult) -> str:
    stream = io.StringIO()
    print_summary(result, Scenario(), Path("out"), Console(file=stream, width=200))
    return stream.getvalue()


def row(text: str, name: str) -> str:
    cells = [[cell.strip() for cell in line.split("│")] for line in text.splitlines()]
    (found,) = (line[2] for line in cells if len(line) == 4 and line[1] == name)
    return found


def test_the_mark_stands_beside_the_exact_match() -> None:
    text = printed(ANSWERED)
    assert row(text, "answer correct") == "no"
    assert row(text, "answer score") == "0.75 (4 of 5 by a judge)"
    assert row(text, "the judge's reason") == "Close to it."
    assert row(text, "tokens") == "1200 in, 120 out; the judge's part 300 in, 30 out"
    assert row(text, "cost") == "0.7500 USD; the judge's part 0.5000 USD"


@pytest.mark.parametrize(
    ("usage", "cost"),
    [
        (UsageResult.of(LANGUAGE, ModelUsage()), "0.2500 USD"),
        (UsageResult.of(UNPRICED, ModelUsage(), JUDGE), "not known; the judge's part 0.5000 USD"),
        (UsageResult.of(UNPRICED, ModelUsage()), None),
        (UsageResult.of(ModelUsage(), ModelUsage()), None),
    ],
)
def test_a_cost_is_told_as_far_as_it_is_known(usage: UsageResult, cost: str | None) -> None:
    text = printed(dataclasses.replace(ANSWERED, judge=None, usage=usage))
    assert "answer score" not in text
    if cost is None:
        assert "cost" not in text
    else:
        assert row(text, "cost") == cost


def test_a_judge_that_gave_no_mark_is_told() -> None:
    failed = dataclasses.replace(
        ANSWERED,
        error="judge_model: MllmUnreachable: down",
        metrics=dataclasses.replace(ANSWERED.metrics, answer_score=None),
        judge=JudgeResult("a judge"),
    )
    assert row(printed(failed), "answer score") == "none: judge_model: MllmUnreachable: down"


@pytest.mark.parametrize("answer", ["[red]pink[/red]", "a [/b] b", "\x1b[31mpink\x07"])
def test_an_answer_is_no_markup_and_no_command_to_the_terminal(answer: str) -> None:
    shown = answer.replace("\x1b", " ").replace("\x07", " ").strip()
    metrics = dataclasses.replace(ANSWERED.metrics, answer=answer)
    assert row(printed(dataclasses.replace(ANSWERED, metrics=metrics)), "answer") == shown


def test_a_flight_has_a_path_type_and_no_room() -> None:
    task = TaskResult("aerial_vln")
    # Without a score or a reference way there is no path type.
    for path_type in ("hard", None):
        metrics = MetricsResult(path_type=path_type)
        flown = dataclasses.replace(ANSWERED, task=task, metrics=metrics)
        text = printed(flown)
        assert row(text, "path type") == (path_type or "-")
        for name in ("in the goal's room", "goal in the last view", "stopped within 3 m"):
            assert name not in text
            assert name in printed(ANSWERED)
    assert "path type" not in printed(ANSWERED)


def test_people_are_told_of_where_there_are_some() -> None:
    assert "people" not in printed(ANSWERED)
    among = dataclasses.replace(
        ANSWERED, metrics=MetricsResult(person_contacts=2, person_min_distance_m=0.104)
    )
    assert row(printed(among), "contacts with people") == "2"
    assert row(printed(among), "nearest to a person") == "0.10 m"


@pytest.mark.parametrize("name", ["flat", "town", "two_storey", "apartment_eqa"])
def test_what_to_try_next_is_another_task_of_the_same_scenario(name: str) -> None:
    scenario = load_scenario(name)
    for done in [*scenario.tasks, ""]:
        result = EpisodeResult(
            task=TaskResult(name=done), model=ModelResult(reasoning="rules"), scenario=name
        )
        words = shlex.split(next_commands(result, scenario, Path("a run"))[2])
        assert words[:4] == ["unilavira", "run", "--scenario", "a run/scenario.yaml"]
        assert words[4] == "--task"
        task = words[5].removeprefix("@")
        assert task != done
        assert task in scenario.tasks
        assert words[6:] == []


def test_what_to_try_next_costs_no_money() -> None:
    result = EpisodeResult(model=ModelResult(reasoning="model"))
    scenario = Scenario(tasks={"a": NamedTask()})
    assert next_commands(result, scenario, Path("out"))[1:] == (
        "unilavira run --scenario out/scenario.yaml --model rules",
        "unilavira run --scenario out/scenario.yaml --task @a --model rules",
    )


def test_without_another_task_the_scenarios_are_listed() -> None:
    result = EpisodeResult(task=TaskResult(name="a"))
    scenario = Scenario(tasks={"a": NamedTask()})
    assert next_commands(result, scenario, Path("out"))[2] == "unilavira scenarios"


def test_a_model_that_is_away_is_checked_next() -> None:
    result = EpisodeResult(cause="model_unreachable", model=ModelResult(reasoning="model"))
    own, other = "openai:m@http://127.0.0.1:9/v1", "gemini-3.1-pro"
    for vision, checked in ((own, (own,)), (other, (own, other)), ("cassette:c.jsonl", (own,))):
        scenario = Scenario(language_model=own, vision_model=vision)
        assert next_commands(result, scenario, Path("out")) == (
            *(f"unilavira doctor --model {spec}" for spec in checked),
            "unilavira report out",
            "unilavira run --scenario out/scenario.yaml --model rules",
        )
