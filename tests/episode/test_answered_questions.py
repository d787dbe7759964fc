"""A question as an episode: exact match, a judge's mark beside it, and what the result says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from unilavira_drake import load_scenario, model_pair, run_episode
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.ledger import read_ledger
from unilavira_drake.mllm.reply import Attempt, Completion, Usage
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.recording.result import (
    EpisodeResult,
    JudgeResult,
    RoleUsageResult,
    result_from_json,
)

TASKS = """
tasks:
  tub:
    {family: eqa, text: "What color is the bathtub?", start: "10.4,7.2,-1.5708", goal: bathtub_1,
     answer: rose, choices: [rose, pink, white]}
task: {text: "@tub"}
"""


class Judge:
    """Marks every answer with a 4, for 20 cents."""

    name, perception, reasoning, box_space = "judge", "images", "model", "pixels"
    description, deadline = "a script", 1.0
    asked: list[MllmRequest]

    def complete(self, request: MllmRequest) -> Completion:
        self.asked.append(request)
        text = json.dumps({"reasoning": "Close to it.", "score": 4})
        usage = Usage(500, 40, 0, 0.2)
        return Completion(text, usage, 4.0, (Attempt("judge", usage=usage, latency=4.0),))

    def close(self) -> None:
        pass


def run(overlay: str, out: Path, judge: Judge) -> EpisodeResult:
    judge.asked = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model_pair, "make_judge", lambda spec: judge)
        return run_episode(load_scenario("flat", TASKS + overlay), out=out)


def kept(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "result.json").read_text())
    return found


def test_a_wrong_answer_keeps_its_mark(tmp_path: Path) -> None:
    judge = Judge()
    overlay = "judge_model: local-9b\nbudgets: {model_cost_usd: 0.1}"
    result = run(overlay, tmp_path / "run", judge)
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
    assert found["judge"] == {"model": "judge", "mark": 4, "reasoning": "Close to it."}
    assert found["task"]["protocol"] == "home"
    # Beyond the budget: the episode was over, and the judge's part is told apart.
    assert found["usage"]["cost_usd"] == found["usage"]["judge"]["cost_usd"] == 0.2
    assert found["usage"]["judge"]["calls"] == 1
    assert (found["usage"]["input_tokens"], found["usage"]["language"]["input_tokens"]) == (500, 0)
    assert found["usage"]["attempts"] == len(rows)
    assert json.loads((tmp_path / "run" / "timings.json").read_text())["judge_s"] == 4.0
    assert result_from_json((tmp_path / "run" / "result.json").read_text()) == result


def test_without_an_answer_the_mark_is_the_lowest_and_without_a_judge_there_is_none(
    tmp_path: Path,
) -> None:
    judge, short = Judge(), "budgets: {decisions: 1}"
    result = run(f"judge_model: local-9b\n{short}", tmp_path / "judged", judge)
    assert (result.cause, result.success) == ("decision_budget", False)
    assert (result.metrics.answer, result.metrics.answer_score) == (None, 0.0)
    assert result.judge == JudgeResult("judge", 1, "No answer was given.")
    assert result.usage.judge == RoleUsageResult(cost_usd=0.0)
    result = run(short, tmp_path / "alone", judge)
    assert (result.metrics.answer_score, result.judge, result.usage.judge) == (None, None, None)
    assert kept(tmp_path / "alone")["metrics"]["answer_score"] is None
    assert judge.asked == []


def test_a_judge_is_recorded_and_replayed_with_the_episode(tmp_path: Path) -> None:
    cassette = tmp_path / "c.jsonl"
    overlay = f"judge_model: local-9b\nrecord: {cassette}"
    first = run(overlay, tmp_path / "first", Judge())
    assert json.loads(cassette.read_text().splitlines()[-1])["role"] == "judge"
    models = "\n".join(
        f"{role}_model: 'cassette:{cassette}'" for role in ("language", "vision", "judge")
    )
    second = run_episode(load_scenario("flat", TASKS + models), out=tmp_path / "second")
    assert second.metrics == first.metrics
    assert second.usage == first.usage
    assert second.judge == JudgeResult("cassette (judge)", 4, "Close to it.")
    rows = read_ledger(tmp_path / "second" / "ledger.jsonl")
    assert [row.status for row in rows if row.role == "judge"] == ["replayed"]


def test_who_does_not_wait_for_the_mark_keeps_the_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = Broker.result

    def interrupt(self: Broker, request: MllmRequest) -> Completion:
        if request.call == "judge":
            raise KeyboardInterrupt
        return result(self, request)

    monkeypatch.setattr(Broker, "result", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run("judge_model: local-9b", tmp_path / "run", Judge())
    found = result_from_json((tmp_path / "run" / "result.json").read_text())
    assert (found.cause, found.metrics.answer, found.metrics.answer_score) == (
        "stopped", "pink", None,
    )  # fmt: skip
    assert found.error == "judge_model: interrupted before there was a mark."
    assert (tmp_path / "run" / "transcript.jsonl").exists()
