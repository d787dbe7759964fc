"""Success by task family, and what the memories add, over paired episodes.

    python benchmarks/families.py [--model rules] [--family vln,objectnav,eqa] [--tasks NAME,...]
        [--seeds 5] [--wirings full,no_tdm,no_scb,no_both,lavira] [--pairs 12] [--workers N]
        [--judge SPEC]

Prints one JSON object a line: each episode as it ends (``id`` ``episode``), the mean success of
each family with its 95 % interval over tasks, the share of questions that constant answers get
right, and for each wiring the mean of ``full`` minus it over episodes that differ in nothing else,
with a bootstrap interval of 95 %.  ``--wirings full`` leaves the pairs out, ``--pairs 0`` too.

A seed goes to the models and to latencies, and moves the start: seed 0 starts as the task says,
others up to 0.15 m beside it, turned by up to 10 degrees.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import json
import math
import multiprocessing
import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from chosen import names_among

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.errors import TaskError
from unilavira_drake.evaluation.blind import blind_baseline
from unilavira_drake.evaluation.free_space import free_space
from unilavira_drake.evaluation.statistics import Estimate, paired_difference, success_rate
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.scenario import ABLATIONS, Scenario
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start

FAMILY_SCENARIOS = {
    "vln": ("apartment", "office"),
    "objectnav": ("apartment_objectnav",),
    "eqa": ("apartment_eqa",),
}
HEADING = "rules on simulator labels: a test of the machinery, no evidence about multimodal models"
BESIDE, TURNED = 0.15, math.radians(10.0)
TRIES = 20
EPISODES = 16
"""Of each process, on average."""


@dataclass(frozen=True)
class Job:
    """One episode."""

    family: str
    scenario: str
    task: str
    seed: int
    wiring: str
    model: str
    judge: str = ""


def run_job(job: Job) -> dict[str, Any]:
    """Runs an episode in a process of its own and returns its row."""
    scenario = load_scenario(job.scenario)
    scenario.task.text = f"@{job.task}"
    scenario.task.start = start_of(scenario, job.task, job.seed)
    scenario.random_seed = job.seed
    scenario.ablation = job.wiring
    scenario.language_model = scenario.vision_model = job.model
    scenario.judge_model = job.judge
    result = run_episode(scenario)
    metrics, counts = result.metrics, result.counts
    return {
        "id": "episode",
        **dataclasses.asdict(job),
        "success": result.success,
        "cause": result.cause,
        "error": result.error,
        "spl": metrics.spl,
        "navigation_error_m": metrics.navigation_error_m,
        "answer": metrics.answer,
        "answer_correct": metrics.answer_correct,
        "answer_score": metrics.answer_score,
        "decisions": counts.decisions,
        "backtracks": counts.backtracks,
        "simulated_s": result.time.simulated_s,
    }


def start_of(scenario: Scenario, task: str, seed: int) -> str:
    """Returns the start of a task for a seed: itself for 0, else a free one beside it."""
    text = scenario.tasks[task].start or scenario.start
    if seed == 0:
        return text
    world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    space = free_space(world, radius=scenario.robot.radius)
    x, y, yaw = parse_start(text, world, radius=scenario.robot.turning_radius)
    random = np.random.default_rng((seed, *f"{scenario.name}/{task}".encode()))
    for _ in range(TRIES):
        distance, bearing = BESIDE * math.sqrt(random.uniform()), random.uniform(0.0, math.tau)
        near_x, near_y = x + distance * math.cos(bearing), y + distance * math.sin(bearing)
        near = f"{near_x:.3f},{near_y:.3f},{yaw + random.uniform(-TURNED, TURNED):.4f}"
        try:
            parse_start(near, world, radius=scenario.robot.turning_radius)
        except TaskError:
            continue
        if space.is_free(near_x, near_y):
            return near
    return text


def tasks_of(family: str, chosen: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Returns (scenario, task) of a family; of all its tasks when none are chosen."""
    found = []
    for name in FAMILY_SCENARIOS[family]:
        for task, spec in load_scenario(name).tasks.items():
            if spec.family == family and (not chosen or task in chosen):
                found.append((name, task))
    return found


def jobs_of(family: str, options: argparse.Namespace) -> list[Job]:
    """Returns the episodes of a family, each once.

    ``full`` is run with every seed; each other wiring with as many as make ``pairs`` pairs.
    """
    tasks = tasks_of(family, options.tasks)
    if not tasks:
        return []
    paired = min(math.ceil(options.pairs / len(tasks)), 1000)
    seeds = {wiring: paired for wiring in options.wirings if wiring != "full"}
    seeds["full"] = max(options.seeds, *seeds.values(), 0)
    return [
        Job(family, scenario, task, seed, wiring, options.model, options.judge)
        for wiring, count in seeds.items()
        for seed in range(count)
        for scenario, task in tasks
    ]


def run_all(jobs: Sequence[Job], workers: int) -> Iterator[dict[str, Any]]:
    """Yields the row of each episode as it ends; each worker is a process.

    Processes live for a few episodes only: Drake's bindings for Python 3.10 and 3.11 free no
    Diagram that holds a System written in Python, about 70 MB an episode.
    """
    # Read by Drake's solvers when a worker starts: they would only take cores from the others.
    os.environ["LP_NUM_THREADS"] = "1"
    spawn = multiprocessing.get_context("spawn")
    for first in range(0, len(jobs), EPISODES * workers):
        some = jobs[first : first + EPISODES * workers]
        with concurrent.futures.ProcessPoolExecutor(workers, mp_context=spawn) as pool:
            futures = [pool.submit(run_job, job) for job in some]
            for future in concurrent.futures.as_completed(futures):
                yield future.result()


def summaries(family: str, rows: Sequence[dict[str, Any]], seeds: int) -> Iterator[dict[str, Any]]:
    """Yields what the episodes of a family come to; those that are not scored are left out."""
    scored = [row for row in rows if row["family"] == family and row["success"] is not None]
    done = {
        (row["wiring"], row["scenario"], row["task"], row["seed"]): bool(row["success"])
        for row in scored
    }
    by_task: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for (wiring, scenario, task, seed), success in sorted(done.items()):
        if wiring == "full" and seed < seeds:
            by_task[scenario, task].append(success)
    unscored = sum(row["family"] == family for row in rows) - len(scored)
    what = "success, mean over tasks"
    yield summary(f"{family}.success", what, success_rate(by_task), unscored=unscored)
    marks = [row["answer_score"] for row in scored if row["answer_score"] is not None]
    if marks:
        what = "mean mark of the judge, from 0 to 1, over episodes"
        yield line(f"{family}.judge", what, float(np.mean(marks)), episodes=len(marks))
    for wiring in ABLATIONS:
        pairs: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
        for (other, scenario, task, seed), success in sorted(done.items()):
            full = done.get(("full", scenario, task, seed))
            if other == wiring != "full" and full is not None:
                pairs[scenario, task].append((full, success))
        if pairs:
            differing = sum(a != b for values in pairs.values() for a, b in values)
            yield summary(
                f"{family}.full-{wiring}",
                f"success of full minus {wiring}, mean over tasks",
                paired_difference(pairs),
                differing_pairs=differing,
            )


def summary(id_: str, what: str, estimate: Estimate, **more: Any) -> dict[str, Any]:
    interval = [_shown(estimate.low), _shown(estimate.high)]
    counts = {"tasks": estimate.tasks, "episodes": estimate.episodes}
    return line(id_, what, estimate.mean, interval_95=interval, **counts, **more)


def line(id_: str, what: str, value: float, **more: Any) -> dict[str, Any]:
    """Returns one row; none of them has a target."""
    plain = {"target": None, "sense": None, "unit": "1", "ok": None}
    return {"id": id_, "what": what, "value": _shown(value), **plain, **more}


def _shown(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None


def blind_row() -> dict[str, Any]:
    """Returns what constant answers get right, without moving."""
    (name,) = FAMILY_SCENARIOS["eqa"]
    blind = blind_baseline(load_scenario(name).tasks)
    what = "questions that the commonest answer of their type gets right, without moving"
    return line("eqa.blind", what, blind.share, questions=blind.questions,
                answers=dict(blind.answers))  # fmt: skip


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="rules", help="SPEC of both models")
    parser.add_argument("--judge", default="", help="SPEC of the judge of answers; default: none")
    families = names_among("family", FAMILY_SCENARIOS)
    parser.add_argument("--family", type=families, default=list(FAMILY_SCENARIOS))
    tasks = names_among(
        "task", [task for family in FAMILY_SCENARIOS for _, task in tasks_of(family)]
    )
    parser.add_argument("--tasks", type=tasks, default=[], help="named tasks; default: all")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--wirings", type=names_among("wiring", ABLATIONS), default=list(ABLATIONS))
    parser.add_argument("--pairs", type=int, default=12, help="pairs of each wiring, at least")
    parser.add_argument("--workers", type=int, default=max(1, (os.cpu_count() or 2) - 1))
    return parser.parse_args()


def main() -> None:
    """Runs the episodes and prints the rows."""
    options = parsed()
    if make_backend(options.model, role="language", place="--model").reasoning == "rules":
        print(json.dumps({"id": "heading", "what": HEADING, "model": options.model}), flush=True)
    jobs = [job for family in options.family for job in jobs_of(family, options)]
    rows = []
    for row in run_all(jobs, options.workers):
        rows.append(row)
        print(json.dumps(row, ensure_ascii=False), flush=True)
    for family in options.family:
        for made in summaries(family, rows, options.seeds):
            print(json.dumps(made), flush=True)
        if family == "eqa":
            print(json.dumps(blind_row()), flush=True)


if __name__ == "__main__":
    main()
