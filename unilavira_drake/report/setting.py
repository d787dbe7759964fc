"""What a report needs beside the transcript: the world, the goal and what the models are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from unilavira_drake.errors import UniLaviraError
from unilavira_drake.evaluation.air_goal import make_goal
from unilavira_drake.evaluation.goal_area import success_area
from unilavira_drake.evaluation.scoring import GoalField
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.judges import make_judge
from unilavira_drake.recording.floor_plan import FloorPlan, Outline, floor_plan
from unilavira_drake.recording.result import EpisodeResult
from unilavira_drake.scenario import Scenario
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.task_choice import EpisodeTask, choose_task
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import World

_REASONING = {
    "rules": "rules, not a multimodal LLM",
    "model": "a model",
    "human": "a person",
}
_PERCEPTION = {
    "ground_truth": "sees what a perfect detector would say, from the simulator's labels",
    "images": "sees the pictures",
}
_GROUNDERS = {
    "color": "finds things by their color in the pixels",
    "label": "reads the simulator's labels",
}


@dataclass(frozen=True, eq=False)
class Storey:
    """What is drawn of one floor."""

    elevation: float
    """Metres."""
    plan: FloorPlan
    goals: tuple[tuple[float, float], ...] = ()
    goal_area: tuple[Outline, ...] = ()


@dataclass(frozen=True, eq=False)
class Setting:
    """The scene of a run, as far as it can still be had."""

    storeys: tuple[Storey, ...] = ()
    """From the lowest up; none when the world cannot be had."""
    goal: str = ""
    """What the episode is scored against; empty when it is not."""
    task: str = ""
    models: tuple[str, ...] = ()
    """One sentence for each model, and for the grounder."""
    problems: tuple[str, ...] = ()


def read_setting(folder: Path, result: EpisodeResult | None) -> Setting:
    """Returns the setting of a run folder; what cannot be read is told in ``problems``."""
    path = folder / "scenario.yaml"
    models = _declared(result)
    if not path.is_file():
        told = "scenario.yaml is missing: maps are without rooms and furniture."
        return Setting(models=models, problems=(told,))
    try:
        scenario = load_scenario(path)
        models = _described(scenario)
        task = choose_task(scenario)
        world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    except (UniLaviraError, OSError) as error:
        told = f"Maps are without rooms and furniture: {error}"
        return Setting(models=models, problems=(told,))
    goal, problems = _goal(task, world, scenario.robot.radius)
    storeys = tuple(_storey(world, elevation, goal, task) for elevation in world.elevations)
    return Setting(storeys, task.goal, task.spec.text, models, problems=problems)


def _goal(
    task: EpisodeTask, world: World, radius: float
) -> tuple[GoalField | None, tuple[str, ...]]:
    if not task.goal:
        return None, ()
    try:
        return make_goal(task.goal, world, task.rule, radius=radius), ()
    except UniLaviraError as error:
        return None, (f"The goal is not on the maps: {error}",)


def _storey(world: World, elevation: float, goal: GoalField | None, task: EpisodeTask) -> Storey:
    plan = floor_plan(world.storey(elevation))
    if goal is None:
        return Storey(elevation, plan)
    here = goal.on(elevation)
    return Storey(elevation, plan, here.places, success_area(here, task.rule))


def _described(scenario: Scenario) -> tuple[str, ...]:
    language = make_backend(
        scenario.language_model, role="language", place="language_model"
    ).description
    vision = make_backend(scenario.vision_model, role="vision", place="vision_model").description
    models = [f"Language model: {language}.", f"Vision model: {vision}."]
    if language == vision:
        models = [f"Both models: {language}."]
    if scenario.grounder in _GROUNDERS:
        models.append(f"Auxiliary grounder: {_GROUNDERS[scenario.grounder]}.")
    if scenario.judge_model:
        models.append(f"Judge of answers: {make_judge(scenario.judge_model).description}.")
    return tuple(models)


def _declared(result: EpisodeResult | None) -> tuple[str, ...]:
    """What the result says about the models, when the scenario cannot tell."""
    if result is None:
        return ()
    model = result.model
    names = dict.fromkeys((model.language, model.vision))
    return (
        f"{' and '.join(names)}: {_REASONING.get(model.reasoning, model.reasoning)}; "
        f"{_PERCEPTION.get(model.perception, model.perception)}.",
    )
