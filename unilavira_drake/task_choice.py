"""Which task an episode runs, from the scenario's named tasks and the person's choice."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from unilavira_drake.errors import ScenarioError, TaskError, unknown_name
from unilavira_drake.scenario import Budgets, NamedTask, Scenario
from unilavira_drake.tasks import SuccessRule, TaskSpec, checked_task, success_rule
from unilavira_drake.worlds.start import parse_start_pose
from unilavira_drake.worlds.world import World


@dataclass(frozen=True)
class EpisodeTask:
    """A task with what scores it; only ``spec`` reaches the agent."""

    spec: TaskSpec
    name: str
    """Name in the scenario; empty for free text."""
    start: str
    goal: str
    """Empty when the place is not scored."""
    answers: tuple[str, ...] = ()
    """Answers that count, of a question; empty when none is scored."""
    rule: SuccessRule = SuccessRule()
    """How its stop is judged."""
    budgets: Budgets = dataclasses.field(default_factory=Budgets)
    """The scenario's, with those of the family where it names none."""


def choose_task(scenario: Scenario) -> EpisodeTask:
    """Returns the chosen task.

    Text that equals a named task's (case and spaces folded) or ``@NAME`` is that task; other
    text is scored only against an explicit goal.

    Raises:
        TaskError: for an unknown name or protocol, an empty or too long text, or wrong choices.
        ScenarioError: if nothing is chosen and the scenario has no default task.
    """
    choice = scenario.task
    text = choice.text
    if not text:
        if not scenario.default_task:
            if not scenario.tasks:
                raise ScenarioError(
                    "scenario.task: no task was given, and the scenario names none; pass --task, "
                    "or give the sentence as task.text."
                )
            raise ScenarioError(
                "scenario.default_task: empty, and no task was given; set it to one of: "
                f"{', '.join(sorted(scenario.tasks))}, or pass --task."
            )
        text = f"@{scenario.default_task}"
    name = _named(scenario, text)
    # Words of one's own that end in a question mark ask for an answer.
    family = "eqa" if text.rstrip().endswith("?") else "vln"
    task = scenario.tasks[name] if name else NamedTask(family=family, text=text)
    spec = checked_task(task.text, task.family, task.choices)
    return EpisodeTask(
        spec=spec,
        name=name,
        start=choice.start or task.start or scenario.start,
        goal=choice.goal or task.goal,
        answers=(task.answer, *task.accept) if task.answer else (),
        rule=success_rule(spec.family, task.protocol),
        budgets=_budgets(scenario.budgets, spec),
    )


def start_pose(scenario: Scenario, world: World) -> tuple[float, float, float, float]:
    """Returns where the scenario's robot begins its chosen task: see :func:`parse_start_pose`.

    Raises:
        ScenarioError: as :func:`choose_task`.
        TaskError: as :func:`choose_task`, and for a place where this robot cannot start.
    """
    robot = scenario.robot
    return parse_start_pose(
        choose_task(scenario).start,
        world,
        radius=robot.turning_radius,
        climbs=robot.leaves_the_ground,
        flies=robot.flies,
    )


def _budgets(asked: Budgets, spec: TaskSpec) -> Budgets:
    usual = dataclasses.asdict(spec.budgets)
    missing = {name: value for name, value in usual.items() if getattr(asked, name) is None}
    return dataclasses.replace(asked, **missing)


def _named(scenario: Scenario, text: str) -> str:
    if text.strip().startswith("@"):
        name = text.strip()[1:]
        if name not in scenario.tasks:
            raise TaskError(unknown_name("task", name, scenario.tasks, "task"))
        return name
    folded = " ".join(text.casefold().split())
    for name, task in scenario.tasks.items():
        if " ".join(task.text.casefold().split()) == folded:
            return name
    return ""
