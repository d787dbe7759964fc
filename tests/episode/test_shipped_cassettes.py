"""The cassettes that come with the package: episodes that a multimodal model has decided."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest

from unilavira_drake.episode import run_episode
from unilavira_drake.errors import ScenarioError
from unilavira_drake.mllm.cassette import CassetteHeader
from unilavira_drake.mllm.cassette_file import read_header, read_replies
from unilavira_drake.recording.result import EpisodeResult
from unilavira_drake.resources import cassettes_path
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.tasks import FAMILIES

DEFAULT = "apartment"
CASSETTES = sorted(path.stem for path in cassettes_path().glob("*.jsonl"))


def task_name(header: CassetteHeader) -> str:
    """Returns the named task that was recorded."""
    tasks = load_scenario(header.scenario).tasks
    return next(name for name, task in tasks.items() if task.text.split() == header.task.split())


def replay(name: str, out: Path) -> EpisodeResult:
    header = read_header(cassettes_path() / f"{name}.jsonl")
    overlay = {
        "language_model": f"cassette:{name}",
        "vision_model": f"cassette:{name}",
        "random_seed": header.seed,
        "ablation": header.ablation,
        "prompt_preset": header.preset,
        "task": {"text": f"@{task_name(header)}"},
    }
    # JSON is YAML.
    return run_episode(load_scenario(header.scenario, json.dumps(overlay)), out=out)


def test_there_are_two_of_each_family_and_one_drives_back() -> None:
    families: Counter[str] = Counter()
    calls: Counter[str] = Counter()
    for name in CASSETTES:
        path = cassettes_path() / f"{name}.jsonl"
        header = read_header(path)
        families[load_scenario(header.scenario).tasks[task_name(header)].family] += 1
        lines = path.read_text(encoding="utf-8").splitlines()
        calls.update(json.loads(line)["call"] for line in lines[1:])
    assert set(families) == set(FAMILIES)
    assert min(families.values()) >= 2
    # Driven back, and decided anew from the pictures of the way that failed.
    assert calls["recover"] >= 1


@pytest.mark.parametrize("name", CASSETTES)
def test_the_header_tells_who_answered_and_when(name: str) -> None:
    header = read_header(cassettes_path() / f"{name}.jsonl")
    assert header.answered_by
    assert header.date
    for model in (header.language, header.vision):
        assert (model.perception, model.reasoning) == ("images", "model")


@pytest.mark.parametrize("name", CASSETTES)
def test_the_guide_tells_how_to_replay_it(name: str) -> None:
    header = read_header(cassettes_path() / f"{name}.jsonl")
    default = load_scenario(DEFAULT)
    scenario = "" if header.scenario == DEFAULT else f"--scenario {header.scenario} "
    task = task_name(header)
    same = header.scenario == DEFAULT and default.default_task == task
    chosen = scenario if same else f"{scenario}--task @{task} "
    guide = Path(__file__).resolve().parents[2] / "docs" / "agent.md"
    line = f"unilavira run {chosen}--model cassette:{name}"
    assert line in guide.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("name", CASSETTES)
def test_it_is_replayed_to_its_success_twice_with_the_same_bytes(name: str, tmp_path: Path) -> None:
    results = [replay(name, tmp_path / run) for run in ("first", "second")]
    assert results[0].success
    assert results[0].cause == "stopped"
    assert results[0].model.reasoning == "model"
    assert results[0].model.perception == "images"
    transcripts = [
        (tmp_path / run / "transcript.jsonl").read_bytes() for run in ("first", "second")
    ]
    assert transcripts[0] == transcripts[1]
    counts = results[0].counts
    replies = read_replies(cassettes_path() / f"{name}.jsonl")
    assert counts.language_calls + counts.vision_calls == len(replies)


def test_another_preset_than_the_recorded_one_is_refused() -> None:
    overlay = "{language_model: 'cassette:apartment_fridge', prompt_preset: paper}"
    with pytest.raises(ScenarioError, match="recorded with 'compact'"):
        run_episode(load_scenario("apartment", overlay))
