"""Puts the result of an episode together."""

from __future__ import annotations

from collections.abc import Mapping

from unilavira_drake.evaluation.judge import Judgement
from unilavira_drake.evaluation.scoring import Score
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.model_pair import ModelPair
from unilavira_drake.people.config import reads_labels
from unilavira_drake.recording.result import (
    EpisodeResult,
    JudgeResult,
    MetricsResult,
    ModelResult,
    TaskResult,
    TimeResult,
    UsageResult,
    installed_versions,
)
from unilavira_drake.recording.tally import Tally
from unilavira_drake.scenario import Scenario
from unilavira_drake.task_choice import EpisodeTask


def episode_result(
    scenario: Scenario,
    task: EpisodeTask,
    metrics: EpisodeMetrics,
    verdict: Score,
    tally: Tally,
    models: ModelPair,
    usage: Mapping[str, ModelUsage],
    judgement: Judgement | None = None,
) -> EpisodeResult:
    """Returns what ``result.json`` holds.

    ``usage`` is that of the models by their role; ``judgement`` is that on the answer, None where
    nobody judged.
    """
    failures = (one.failure for one in usage.values() if one.failure)
    return EpisodeResult(
        scored=verdict.success is not None,
        success=verdict.success,
        cause=metrics.cause,
        error=next(failures, "") or _judge_error(judgement),
        task=TaskResult(task.spec.family, task.spec.text, task.name, task.goal, task.rule.protocol),
        scenario=scenario.name,
        robot=scenario.robot.name,
        ablation=scenario.ablation,
        seed=scenario.random_seed,
        model=_model(models, scenario),
        metrics=MetricsResult(
            navigation_error_m=verdict.navigation_error_m,
            path_length_m=round(verdict.path_length_m, 4),
            shortest_path_m=verdict.shortest_path_m,
            path_type=verdict.path_type,
            spl=verdict.spl,
            oracle_success=verdict.oracle_success,
            same_room=verdict.same_room,
            goal_seen=verdict.goal_seen,
            success_3m=verdict.success_3m,
            collisions=metrics.collisions,
            max_contact_force_n=round(metrics.max_contact_force, 3),
            answer=tally.answer or None,
            answer_correct=verdict.answer_correct,
            answer_score=None if judgement is None else judgement.score,
            person_min_distance_m=_rounded(metrics.min_person_distance),
            person_contacts=metrics.person_contacts if scenario.people.count else None,
        ),
        counts=tally.counts(metrics.decisions),
        usage=UsageResult.of(
            usage["language"], usage["vision"], None if judgement is None else judgement.usage
        ),
        judge=None if judgement is None else _judge(judgement),
        time=TimeResult(round(metrics.time, 3)),
        versions=installed_versions(),
    )


def _rounded(distance: float | None) -> float | None:
    return None if distance is None else round(distance, 3)


def _judge(judgement: Judgement) -> JudgeResult:
    return JudgeResult(judgement.model, judgement.mark, judgement.reasoning)


def _judge_error(judgement: Judgement | None) -> str:
    return f"judge_model: {judgement.error}" if judgement is not None and judgement.error else ""


def _model(models: ModelPair, scenario: Scenario) -> ModelResult:
    language, vision = models.language.backend, models.vision.backend
    # The weaker claim stands for the pair: one level on ground truth taints the whole result.
    perceptions = {language.perception, vision.perception}
    if scenario.grounder == "label" or reads_labels(scenario.people):
        perceptions.add("ground_truth")
    return ModelResult(
        language=language.name,
        vision=vision.name,
        perception="ground_truth" if "ground_truth" in perceptions else "images",
        reasoning=language.reasoning,
    )
