"""Whole episodes: recorded and replayed to the byte, and ended by their models."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from unilavira_drake import EpisodeResult, load_scenario, run_episode
from unilavira_drake.cli.main import main
from unilavira_drake.mllm.ledger import read_ledger
from unilavira_drake.recording.result import result_from_json

SHORT = "budgets: {decisions: 2}\n"
MEASURED = "language_latency: !MeasuredLatency {}\nvision_latency: !MeasuredLatency {}\n"


def run(out: Path, overlay: str = "", model: str = "rules") -> EpisodeResult:
    models = f"language_model: '{model}'\nvision_model: '{model}'\n"
    return run_episode(load_scenario("flat", SHORT + models + overlay), out=out)


def ledger_columns(folder: Path) -> list[tuple[str, int, str]]:
    return [(row.role, row.n, row.status) for row in read_ledger(folder / "ledger.jsonl")]


@pytest.mark.parametrize("latency", ["", MEASURED], ids=["none", "measured"])
def test_a_recorded_episode_replays_to_the_byte(tmp_path: Path, latency: str) -> None:
    cassette = tmp_path / "c.jsonl"
    first = run(tmp_path / "first", f"{latency}record: {cassette}\n")
    recorded = cassette.read_bytes()
    second = run(tmp_path / "second", latency, f"cassette:{cassette}")
    for name in ("transcript.jsonl", "map.png"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    assert (first.metrics, first.counts, first.usage) == (
        second.metrics, second.counts, second.usage,
    )  # fmt: skip
    assert second.model.language == "cassette (rules)"
    assert (second.model.perception, second.model.reasoning) == ("ground_truth", "rules")
    assert cassette.read_bytes() == recorded
    calls = [("language", 1), ("language", 2), ("vision", 2), ("language", 3), ("vision", 3)]
    assert ledger_columns(tmp_path / "first") == [(*call, "ok") for call in calls]
    assert ledger_columns(tmp_path / "second") == [(*call, "replayed") for call in calls]


def test_an_episode_that_was_cut_off_is_recorded_further(tmp_path: Path) -> None:
    cassette = tmp_path / "c.jsonl"
    run(tmp_path / "whole", f"record: {cassette}\n")
    whole = cassette.read_bytes()
    cassette.write_bytes(whole[: len(whole) * 2 // 3])
    run(tmp_path / "again", f"record: {cassette}\nrecord_mode: record_new\n")
    statuses = [status for _, _, status in ledger_columns(tmp_path / "again")]
    assert statuses[0] == "replayed"
    assert statuses[-1] == "ok"
    transcript = "transcript.jsonl"
    assert (tmp_path / "again" / transcript).read_bytes() == (
        tmp_path / "whole" / transcript
    ).read_bytes()


def test_what_a_cassette_does_not_hold_is_never_scored(tmp_path: Path) -> None:
    cassette = tmp_path / "c.jsonl"
    run(tmp_path / "whole", f"record: {cassette}\n")
    lines = cassette.read_bytes().splitlines(keepends=True)
    cassette.write_bytes(b"".join(lines[:3]))
    result = run(tmp_path / "cut", model=f"cassette:{cassette}")
    assert (result.cause, result.scored, result.success) == ("model_unreachable", False, None)
    assert result.error.startswith("CassetteError: c.jsonl: no reply to vision call 2")
    assert result.metrics.navigation_error_m is None
    assert (result.usage.errors, result.counts.decisions, result.counts.fallbacks) == (1, 1, 0)
    kept = {path.name for path in (tmp_path / "cut").iterdir()}
    assert kept >= {"transcript.jsonl", "result.json", "map.png", "ledger.jsonl"}
    last = read_ledger(tmp_path / "cut" / "ledger.jsonl")[-1]
    assert (last.status, last.role) == ("CassetteError", "vision")
    assert "no reply" in last.detail


@pytest.mark.usefixtures("_no_preflight")
def test_the_command_records_and_tells_of_an_unreachable_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["run", "--scenario", "flat", "--max-decisions", "1"]
    assert main([*command, "--record", "c.jsonl", "--out", "first"]) == 0
    assert main([*command, "--record", "c.jsonl"]) == 2
    assert "record_new" in capsys.readouterr().err
    assert not Path("runs").exists()
    # Repeated from its folder, it writes to no cassette.
    again = ["run", "--scenario", "first/scenario.yaml", "--model", "cassette:c.jsonl"]
    assert main([*again, "--out", "second"]) == 0
    assert "replayed without a model" in capsys.readouterr().out
    assert main([*again, "--seed", "1", "--out", "third"]) == 3
    captured = capsys.readouterr()
    assert "unilavira: CassetteError: c.jsonl: no reply to language call 1" in captured.err
    assert "not scored: model_unreachable" in captured.out
    result = result_from_json(Path("third/result.json").read_text())
    assert (result.cause, result.success) == ("model_unreachable", None)


@pytest.fixture
def _no_preflight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("unilavira_drake.cli.run.check_rendering", lambda **_: None)


@pytest.mark.parametrize(
    ("budget", "cause", "calls"),
    [
        ("model_calls: 3", "call_budget", 3),
        ("model_seconds: 35", "model_time_budget", 2),
    ],
)
def test_the_models_budgets_end_an_episode(budget: str, cause: str, calls: int) -> None:
    overlay = f"{{language_model: 'rules:latency=20', budgets: {{{budget}}}}}"
    result = run_episode(load_scenario("flat", overlay))
    assert result.cause == cause
    assert result.usage.attempts == calls
    assert result.scored
    assert result.success is False


def test_real_time_goes_no_faster_than_the_clock() -> None:
    overlay = "language_latency: !RealTimeLatency {}\nbudgets: {simulated_time: 1}"
    began = time.monotonic()
    result = run_episode(load_scenario("flat", overlay))
    assert result.cause == "time_budget"
    assert time.monotonic() - began >= 0.9


def test_money_that_a_recording_cost_ends_its_replay(tmp_path: Path) -> None:
    cassette = tmp_path / "c.jsonl"
    run(tmp_path / "first", f"record: {cassette}\n")
    header, *lines = cassette.read_text().splitlines()
    replies = [json.loads(line) for line in lines]
    for reply in replies:
        reply["usage"] |= {"cost_usd": 0.02, "input_tokens": 900, "output_tokens": 100}
    cassette.write_text("\n".join([header, *map(json.dumps, replies), ""]))
    for budget, cause in (
        ("model_cost_usd: 0.05", "cost_budget"),
        ("model_tokens: 3000", "token_budget"),
    ):
        result = run(tmp_path / cause, f"budgets: {{{budget}}}\n", f"cassette:{cassette}")
        assert result.cause == cause
        assert result.usage.cost_usd == pytest.approx(0.06)
        assert result.usage.input_tokens == 2700
