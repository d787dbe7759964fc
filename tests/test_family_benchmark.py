"""The benchmark of the families: which episodes it runs, and what it makes of their rows."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from unilavira_drake import load_scenario
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start


@pytest.fixture(scope="module")
def families(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("families")


def options(**changes: Any) -> argparse.Namespace:
    usual: dict[str, Any] = {
        "tasks": [], "seeds": 5, "pairs": 12, "model": "rules", "judge": "",
        "wirings": ["full", "no_tdm", "no_scb", "no_both"],
    }  # fmt: skip
    return argparse.Namespace(**{**usual, **changes})


@pytest.mark.parametrize("family", ["vln", "objectnav", "eqa"])
def test_every_wiring_has_a_dozen_pairs_and_every_episode_runs_once(
    families: Any, family: str
) -> None:
    jobs = families.jobs_of(family, options())
    assert len(set(jobs)) == len(jobs)
    keys = {
        wiring: {(j.scenario, j.task, j.seed) for j in jobs if j.wiring == wiring}
        for wiring in ("full", "no_tdm", "no_scb", "no_both")
    }
    tasks = {key[:2] for key in keys["full"]}
    assert len(keys["full"]) == 5 * len(tasks)
    for wiring in ("no_tdm", "no_scb", "no_both"):
        assert len(keys[wiring]) >= 12
        assert keys[wiring] <= keys["full"]


def test_episodes_can_be_limited(families: Any) -> None:
    jobs = families.jobs_of("eqa", options(tasks=["piano_room"], seeds=2, pairs=0))
    assert [(j.task, j.seed, j.wiring) for j in jobs] == [
        ("piano_room", 0, "full"),
        ("piano_room", 1, "full"),
    ]
    assert families.jobs_of("vln", options(tasks=["piano_room"])) == []
    alone = families.jobs_of("objectnav", options(wirings=["full"], seeds=1))
    assert {j.wiring for j in alone} == {"full"}
    assert len(alone) == 10


def test_a_seed_moves_the_start_a_little_and_always_alike(families: Any) -> None:
    scenario = load_scenario("apartment_objectnav")
    world, radius = load_world("apartment"), scenario.robot.turning_radius
    for task in ("toilet", "bike"):
        x, y, yaw = parse_start(scenario.tasks[task].start, world, radius=radius)
        assert families.start_of(scenario, task, 0) == scenario.tasks[task].start
        starts = [families.start_of(scenario, task, seed) for seed in range(5)]
        assert len(set(starts)) == 5
        assert starts == [families.start_of(scenario, task, seed) for seed in range(5)]
        for start in starts:
            near_x, near_y, near_yaw = parse_start(start, world, radius=radius)
            assert (near_x - x) ** 2 + (near_y - y) ** 2 <= 0.151**2
            assert abs(near_yaw - yaw) <= 0.175


def episode(task: str, seed: int, wiring: str, success: bool | None, **more: Any) -> dict[str, Any]:
    return {
        "family": "eqa", "scenario": "s", "task": task, "seed": seed, "wiring": wiring,
        "success": success, "answer_score": None, **more,
    }  # fmt: skip


def test_rows_become_means_and_paired_differences(families: Any) -> None:
    rows = [
        *(episode("a", seed, "full", True, answer_score=0.5) for seed in range(2)),
        *(episode("b", seed, "full", seed == 0) for seed in range(2)),
        episode("c", 0, "full", None),
        episode("a", 0, "no_tdm", False),
        episode("b", 0, "no_tdm", True),
        episode("c", 0, "no_tdm", False),
    ]
    made = {row["id"]: row for row in families.summaries("eqa", rows, 2)}
    assert set(made) == {"eqa.success", "eqa.judge", "eqa.full-no_tdm"}
    success = made["eqa.success"]
    assert (success["value"], success["tasks"], success["episodes"]) == (0.75, 2, 4)
    assert success["unscored"] == 1
    low, high = success["interval_95"]
    assert 0.0 < low < 0.75 < high <= 1.0
    pairs = made["eqa.full-no_tdm"]
    assert (pairs["value"], pairs["episodes"], pairs["differing_pairs"]) == (0.5, 2, 1)
    assert made["eqa.judge"]["value"] == 0.5
    assert next(families.summaries("vln", [], 5))["value"] is None


def test_the_blind_row_tells_what_constant_answers_get(families: Any) -> None:
    row = families.blind_row()
    assert row["questions"] == 24
    assert 0.2 < row["value"] < 0.5
