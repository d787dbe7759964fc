"""``unilavira run``: one episode, watched live."""

from __future__ import annotations

import contextlib
import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from unilavira_drake.cli.progress import Progress
from unilavira_drake.cli.summary import print_summary
from unilavira_drake.episode import run_episode
from unilavira_drake.errors import InfrastructureError, InputError, MllmError
from unilavira_drake.evaluation.air_goal import make_goal
from unilavira_drake.messages.metrics import CAUSES, UNCOUNTED, UNREACHABLE
from unilavira_drake.mllm.backends import SPECS, make_backend, profile_of
from unilavira_drake.mllm.judges import make_judge
from unilavira_drake.mllm.readiness import check_ready
from unilavira_drake.recording.run_folder import fresh_folder
from unilavira_drake.rendering_check import check_rendering
from unilavira_drake.scenario import Scenario, robot_kinds
from unilavira_drake.scenario_loading import load_scenario, overlay_from_settings, robot_setting
from unilavira_drake.task_choice import choose_task
from unilavira_drake.tasks import checked_task
from unilavira_drake.worlds.load import load_world

INTERRUPTED = 130


def _option(help_text: str, metavar: str) -> typer.models.OptionInfo:
    option: typer.models.OptionInfo = typer.Option(
        help=help_text, metavar=metavar, show_default=False
    )
    return option


def run(
    task: Annotated[str | None, _option("What to do, or a named task.", "TEXT|@NAME")] = None,
    goal: Annotated[
        str | None, _option("Scores the task against this.", "INSTANCE|ROOM|X,Y")
    ] = None,
    start: Annotated[str | None, _option("Where the robot starts.", "ROOM|X,Y,YAW")] = None,
    scenario: Annotated[
        str, _option("Name or file; default: apartment.", "NAME|FILE.yaml")
    ] = "apartment",
    robot: Annotated[
        str | None, _option(f"Robot: {', '.join(sorted(robot_kinds()))}.", "NAME")
    ] = None,
    model: Annotated[str | None, _option(f"Both models. SPEC: {SPECS}.", "SPEC")] = None,
    language_model: Annotated[str | None, _option("The language model.", "SPEC")] = None,
    vision_model: Annotated[str | None, _option("The vision model.", "SPEC")] = None,
    ablation: Annotated[
        str | None, _option("Memory to leave out.", "full|no_tdm|no_scb|no_both|lavira")
    ] = None,
    seed: Annotated[str | None, _option("Seed of everything random.", "N")] = None,
    max_decisions: Annotated[str | None, _option("Ends the episode.", "N")] = None,
    renderer: Annotated[
        str | None, _option("Renderer of the camera; default: raster.", "vtk|raster")
    ] = None,
    record: Annotated[
        str | None,
        _option("Keeps every reply of the models in this new file, a cassette.", "FILE"),
    ] = None,
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", help="Any value of the scenario.", metavar="DOTTED.KEY=VALUE"),
    ] = None,
    out: Annotated[
        Path | None, _option("Run folder, new or empty; default: a fresh one in runs/.", "DIR")
    ] = None,
    meshcat: Annotated[bool, typer.Option("--meshcat", help="Show it in a browser.")] = False,
) -> None:
    """Runs one episode: a robot follows a sentence through a simulated home."""
    if task is not None and not task.strip().startswith("@"):
        checked_task(task)
    if model is not None and (language_model is not None or vision_model is not None):
        raise InputError(
            "--model: sets both models; give --model alone, or --language-model and --vision-model."
        )
    flags = {
        "task.text": task,
        "task.goal": goal,
        "task.start": start,
        "language_model": language_model or model,
        "vision_model": vision_model or model,
        "ablation": ablation,
        "random_seed": seed,
        "budgets.decisions": max_decisions,
        "renderer": renderer,
        "record": record,
        "meshcat": meshcat or None,
    }
    if task is not None:
        # A saved scenario's goal and start belong to the task that it was saved with.
        flags["task.goal"], flags["task.start"] = goal or "", start or ""
    choice = [] if robot is None else [f"robot={robot_setting(robot)}"]
    loaded = load_scenario(scenario, _overlay(flags, [*choice, *(setting or [])]))
    check_rendering(renderer=loaded.renderer)
    check_models(loaded)
    if out is not None:
        run_watched(loaded, out)
        return
    folder = fresh_folder("runs", _run_name(scenario, loaded))
    try:
        run_watched(loaded, folder)
    except InputError:
        # Nothing was run: leave nothing behind.
        with contextlib.suppress(OSError):
            folder.rmdir()
            folder.parent.rmdir()
        raise


def check_models(scenario: Scenario) -> None:
    """Returns if the endpoints of the two models can be asked, as far as that is seen at once.

    Raises:
        InfrastructureError: if a key is missing or nothing listens at an address; names the
            command that tells more.
    """
    if scenario.record and scenario.record_mode != "record":
        return  # The cassette to continue may hold every reply.
    for role, spec in (("language", scenario.language_model), ("vision", scenario.vision_model)):
        profile = profile_of(spec, place=f"{role}_model")
        if profile is None:
            continue
        try:
            check_ready(profile, role=role)
        except MllmError as error:
            doctor = f"unilavira doctor --model {shlex.quote(spec)}"
            raise InfrastructureError(f"{role}_model: {error} To check it: {doctor}") from None


def run_watched(scenario: Scenario, out: Path) -> None:
    """Runs an episode with live progress and a summary at the end.

    Raises:
        typer.Exit: with 130 after an interrupt.
        InputError: as :func:`run_episode`.
        InfrastructureError: if a model could not be reached, or counts no tokens although a budget
            of them is set; what was done is kept.
    """
    task = choose_task(scenario)
    if task.goal:  # Before anything says that this scores it.
        world = load_world(scenario.world.name, mirror=scenario.world.mirror)
        make_goal(task.goal, world, task.rule, radius=scenario.robot.radius)
    progress = Progress()
    progress.introduce(
        language=make_backend(scenario.language_model, role="language", place="language_model"),
        vision=make_backend(scenario.vision_model, role="vision", place="vision_model"),
        task=task,
        judge=make_judge(scenario.judge_model) if scenario.judge_model else None,
    )
    try:
        with progress:
            result = run_episode(scenario, out=out, on_event=progress.record)
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    print_summary(result, scenario, out, progress.console)
    if result.cause == UNREACHABLE:
        raise InfrastructureError(result.error)
    if result.cause == UNCOUNTED:
        raise InfrastructureError(
            f"{CAUSES[UNCOUNTED]} Set budgets.model_calls or model_seconds instead."
        )
    if result.cause == "interrupted":
        raise typer.Exit(INTERRUPTED)


def _overlay(flags: Mapping[str, str | bool | None], settings: list[str]) -> str:
    # JSON is YAML, with text safely in quotes.
    sugar = [
        f"{key}={json.dumps(value, ensure_ascii=False)}"
        for key, value in flags.items()
        if value is not None
    ]
    return overlay_from_settings([*sugar, *settings])


def _run_name(scenario: str, loaded: Scenario) -> str:
    return f"{Path(scenario).stem}-{choose_task(loaded).name or 'own-task'}"
