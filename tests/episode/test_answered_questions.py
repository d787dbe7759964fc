"""A question as an episode: exact match, a judge's mark beside it, and what the result says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.evaluation import judge as judging
from unilavira_drake.mllm.reply import Attempt, Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.recording.result import EpisodeResult, result_from_json

TASKS = """
tasks:
  tub:
    {family: eqa, text: "What color is the bathtub?", start: "10.4,7.2,-1.5708", goal: bathtub_1,
     answer: rose, choices: [rose, pink, white]}
task: {text: "@tub"}
"""


class Judge:
    """Marks every answer with a 4."""

    name, perception, reasoning, box_space = "judge", "images", "model", "pixels"
    description, deadline = "a script", 1.0
    asked: list[MllmRequest]

    def complete(self, request: MllmRequest) -> Completion:
        self.asked.append(request)
        text = json.dumps({"reasoning": "Close to it.", "score": 4})
        return Completion(text, attempts=(Attempt("judge"),))

    def close(self) -> None:
        pass


def run(overlay: str, out: Path, judge: Judge) -> EpisodeResult:
    judge.asked = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judging, "make_judge", lambda spec: judge)
        return run_episode(load_scenario("flat", TASKS + overlay), out=out)


def kept(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "result.json").read_text())
    return found


def test_a_wrong_answer_keeps_its_mark(tmp_path: Path) -> None:
    judge = Judge()
    result = run("judge_model: local-9b", tmp_path / "run", judge)
    assert (result.cause, result.metrics.answer) == ("stopped", "pink")
    assert (result.success, result.metrics.answer_correct) == (False, False)
    assert result.metrics.answer_score == 0.75
    assert result.metrics.navigation_error_m is not None
    assert [request.call for request in judge.asked] == ["judge"]
    ledger = (tmp_path / "run" / "ledger.jsonl").read_text()
    rows = [json.loads(line) for line in ledger.splitlines()]
    assert [row["model"] for row in rows if row["call"] == "judge"] == ["judge"]
    found = kept(tmp_path / "run")
    assert found["metrics"]["answer_score"] == 0.75
    assert found["task"]["protocol"] == "home"
    assert result_from_json((tmp_path / "run" / "result.json").read_text()) == result


def test_without_an_answer_the_mark_is_the_lowest_and_without_a_judge_there_is_none(
    tmp_path: Path,
) -> None:
    judge, short = Judge(), "budgets: {decisions: 1}"
    result = run(f"judge_model: local-9b\n{short}", tmp_path / "judged", judge)
    assert (result.cause, result.success) == ("decision_budget", False)
    assert (result.metrics.answer, result.metrics.answer_score) == (None, 0.0)
    result = run(short, tmp_path / "alone", judge)
    assert result.metrics.answer_score is None
    assert kept(tmp_path / "alone")["metrics"]["answer_score"] is None
    assert judge.asked == []
