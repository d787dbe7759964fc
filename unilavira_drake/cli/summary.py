"""The end of a run: cause, figures, the run folder and what to try next."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from unilavira_drake.messages.metrics import CAUSES, UNREACHABLE
from unilavira_drake.mllm.backends import profile_of
from unilavira_drake.recording.result import EpisodeResult
from unilavira_drake.report.figures import cost_figures, judge_figures
from unilavira_drake.scenario import Scenario

_YES_NO = {True: "yes", False: "no", None: "-"}
_VERDICTS = {True: "success", False: "no success", None: "not scored"}


def print_summary(result: EpisodeResult, scenario: Scenario, out: Path, console: Console) -> None:
    """Prints how an episode ended, its figures, its folder and commands to try next."""
    style = {True: "bold green", False: "bold red", None: "bold"}[result.success]
    console.print(f"\n{_VERDICTS[result.success]}: {result.cause}", style=style, markup=False)
    console.print(CAUSES.get(result.cause, ""), markup=False)
    table = Table(show_header=False)
    for name, value in _figures(result):
        # A model's words are no markup and no commands to a terminal.
        table.add_row(name, Text("".join(c if c.isprintable() else " " for c in value)))
    console.print(table)
    console.print(f"run folder: {out}", markup=False, soft_wrap=True)
    console.print("next, try:", markup=False)
    for command in next_commands(result, scenario, out):
        console.print(f"  {command}", markup=False, soft_wrap=True)


def next_commands(result: EpisodeResult, scenario: Scenario, out: Path) -> tuple[str, ...]:
    """Returns the commands that a person would try after this episode of a scenario."""
    again = f"unilavira run --scenario {shlex.quote(str(out / 'scenario.yaml'))}"
    # A cassette has no replies to other prompts, and a real model costs money.
    rules = "" if result.model.reasoning == "rules" else " --model rules"
    other = rules or f" --ablation {'no_tdm' if result.ablation == 'full' else 'full'}"
    task = _next_task(scenario, result.task.name)
    report = f"unilavira report {shlex.quote(str(out))}"
    if result.cause == UNREACHABLE:
        return (*_doctors(scenario), report, f"{again}{other}")
    return (
        report,
        f"{again}{other}",
        f"{again} --task {shlex.quote('@' + task)}{rules}" if task else "unilavira scenarios",
    )


def _doctors(scenario: Scenario) -> list[str]:
    """One command for each endpoint; a cassette has none."""
    specs = dict.fromkeys((scenario.language_model, scenario.vision_model))
    return [
        f"unilavira doctor --model {shlex.quote(spec)}"
        for spec in specs
        if profile_of(spec, place="--model") is not None
    ]


def _next_task(scenario: Scenario, name: str) -> str:
    """The named task after this one, the first after the last; empty where there is no other."""
    names = list(scenario.tasks)
    after = names[names.index(name) + 1 :] if name in names else []
    others = [*after, *(other for other in names if other != name)]
    return others[0] if others else ""


def _figures(result: EpisodeResult) -> list[tuple[str, str]]:
    metrics, counts = result.metrics, result.counts
    rows = [
        ("navigation error", _metres(metrics.navigation_error_m)),
        *_where(result),
        ("path length", _metres(metrics.path_length_m)),
        ("shortest path", _metres(metrics.shortest_path_m)),
        ("SPL", "-" if metrics.spl is None else f"{metrics.spl:.2f}"),
        ("collisions", str(metrics.collisions)),
        ("decisions", str(counts.decisions)),
        (
            "model calls",
            f"{counts.language_calls} language, {counts.vision_calls} vision, "
            f"{counts.reasks} re-asked",
        ),
        ("backtracks", str(counts.backtracks)),
        ("simulated time", f"{result.time.simulated_s:.1f} s"),
    ]
    if metrics.person_contacts is not None:
        rows.append(("contacts with people", str(metrics.person_contacts)))
        rows.append(("nearest to a person", _metres(metrics.person_min_distance_m)))
    if metrics.answer is not None:
        rows.append(("answer", metrics.answer))
    if metrics.answer_correct is not None:
        rows.append(("answer correct", _YES_NO[metrics.answer_correct]))
    return [*rows, *judge_figures(result), *cost_figures(result.usage)]


def _where(result: EpisodeResult) -> list[tuple[str, str]]:
    """A flight has a path type; room, view and 3 m have no part in its success."""
    metrics = result.metrics
    if result.task.is_flight:
        return [("path type", metrics.path_type or "-")]
    return [
        ("in the goal's room", _YES_NO[metrics.same_room]),
        ("goal in the last view", _YES_NO[metrics.goal_seen]),
        ("stopped within 3 m", _YES_NO[metrics.success_3m]),
    ]


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} m"
