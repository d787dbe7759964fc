from __future__ import annotations

import statistics
from pathlib import Path

import pytest

from unilavira_drake.errors import InputError, ScenarioError
from unilavira_drake.mllm.latency import PaperLatency, RecordedLatency
from unilavira_drake.mllm.ledger import Ledger
from unilavira_drake.mllm.reply import Attempt
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.scenario_loading import load_scenario

REQUESTS = [MllmRequest(n=n, seed=seed) for n in range(1, 201) for seed in range(10)]


@pytest.mark.parametrize(
    ("condition", "low", "high"), [("healthy", 30, 60), ("contended", 80, 150)]
)
def test_the_paper_s_range_holds_nine_of_ten_calls(condition: str, low: float, high: float) -> None:
    latency = PaperLatency(condition)
    seconds = [latency.sample(request) for request in REQUESTS]
    quantiles = statistics.quantiles(seconds, n=20)
    assert quantiles[0] == pytest.approx(low, rel=0.05)
    assert quantiles[-1] == pytest.approx(high, rel=0.05)
    assert [latency.sample(request) for request in REQUESTS] == seconds


def ledger_of(path: Path) -> Path:
    ledger = Ledger(path)
    for role, status, seconds in (
        ("language", "ok", 31.5),
        ("language", "MllmTimeout", 180.0),
        ("language", "replayed", 42.0),
        ("vision", "ok", 2.0),
        ("language", "cancelled", 7.0),
    ):
        ledger.record(MllmRequest(role=role), 1, Attempt("m", status, latency=seconds))
    ledger.close()
    return path


def test_draws_are_the_answered_calls_of_the_same_role(tmp_path: Path) -> None:
    latency = RecordedLatency(str(ledger_of(tmp_path / "ledger.jsonl")))
    drawn = [latency.sample(request) for request in REQUESTS]
    assert set(drawn) == {31.5, 42.0}
    assert 800 < drawn.count(42.0) < 1200
    assert latency.sample(MllmRequest(role="vision", n=1)) == 2.0


def test_a_ledger_without_the_role_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "ledger.jsonl"
    path.write_text("")
    with pytest.raises(InputError, match="no answered call of the vision model"):
        RecordedLatency(str(path)).sample(MllmRequest(role="vision"))


@pytest.mark.parametrize(
    ("overlay", "fragments"),
    [
        ("language_latency: !PaperLatency {condition: helthy}", ["'healthy'", "language_latency"]),
        ("vision_latency: !RecordedLatency {file: none.jsonl}", ["vision_latency", "none.jsonl"]),
        ("vision_latency: !MeasureLatency {}", ["'!MeasuredLatency'"]),
        ("budgets: {model_calls: 0}", ["budgets.model_calls"]),
        ("budgets: {model_cost_usd: 0.5}\nlanguage_model: local-9b", ["prices", "local-9b"]),
        ("record_mode: recordnew", ["'record_new'"]),
    ],
)
def test_a_scenario_says_what_is_wrong(overlay: str, fragments: list[str]) -> None:
    with pytest.raises(ScenarioError) as error:
        load_scenario("flat", overlay)
    for fragment in fragments:
        assert fragment in str(error.value)


def test_a_scenario_takes_every_latency_and_budget(tmp_path: Path) -> None:
    path = ledger_of(tmp_path / "ledger.jsonl")
    scenario = load_scenario(
        "flat",
        f"language_latency: !RecordedLatency {{file: {path}}}\n"
        "vision_latency: !RealTimeLatency {}\n"
        "budgets: {model_calls: 5, model_tokens: 1000, model_seconds: 2.5, model_cost_usd: 0.1}",
    )
    assert scenario.language_latency.sample(MllmRequest()) in (31.5, 42.0)  # type: ignore[union-attr]
    assert scenario.budgets.model_calls == 5
