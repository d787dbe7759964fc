"""Whole episodes with ``rules:realistic``: the machinery under errors, not a measure of it."""

from __future__ import annotations

import json
from pathlib import Path

from unilavira_drake import EpisodeResult, load_scenario, run_episode
from unilavira_drake.messages.metrics import UNREACHABLE
from unilavira_drake.mllm.rules import RULES_PRESETS

OVERLAY = {
    "task": {"text": "@bathtub"},
    "language_model": "rules:realistic,malformed=0.2",
    "vision_model": "rules:realistic",
    "budgets": {"decisions": 8},
}


def run(out: Path) -> EpisodeResult:
    return run_episode(load_scenario("flat", json.dumps(OVERLAY)), out=out)


def test_an_episode_under_errors_ends_with_a_cause_and_twice_in_the_same_bytes(
    tmp_path: Path,
) -> None:
    result = run(tmp_path / "a")
    assert result.cause != UNREACHABLE
    assert not result.error
    assert result.scored
    assert result.model.vision == f"rules ({RULES_PRESETS['realistic']})"
    assert "malformed=0.2" in result.model.language
    assert (result.model.perception, result.model.reasoning) == ("ground_truth", "rules")
    assert result == run(tmp_path / "b")
    transcripts = [(tmp_path / name / "transcript.jsonl").read_bytes() for name in "ab"]
    assert transcripts[0] == transcripts[1]
