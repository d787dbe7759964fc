"""What an episode with a remote model leaves behind: no key, no address, no time of the day."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_server import FaultServer
from wire_faults import FAULTS

from unilavira_drake import EpisodeResult, load_scenario, run_episode
from unilavira_drake.mllm.ledger import read_ledger

KEY = "sk-secret/0123456789"


@pytest.fixture(scope="module")
def server() -> Iterator[FaultServer]:
    with FaultServer(FAULTS) as running:
        yield running


def run(spec: str, folder: Path) -> EpisodeResult:
    overlay = {
        "language_model": spec,
        "record": str(folder / "cassette.jsonl"),
        "budgets": {"model_calls": 2},
    }
    return run_episode(load_scenario("flat", json.dumps(overlay)), out=folder / "run")


@pytest.mark.parametrize(
    ("fault", "cause", "status"),
    [
        ("echo_key", "call_budget", "ok"),
        ("empty_text", "call_budget", "ReplyFormatError"),
        ("error_401", "model_unreachable", "MllmAuthenticationError"),
        ("retry_after_600", "model_unreachable", "MllmQuotaError"),
    ],
)
def test_no_file_tells_a_key_and_no_repeatable_one_where_or_when(
    fault: str,
    cause: str,
    status: str,
    server: FaultServer,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("UNILAVIRA_API_KEY", KEY)
    base_url = server.base_url(fault)
    result = run(f"openai:tiny@{base_url}", tmp_path)
    assert result.cause == cause
    rows = read_ledger(tmp_path / "run" / "ledger.jsonl")
    assert rows[0].status == status
    assert len(rows) == len(server.visit(base_url).posts)
    assert server.visit(base_url).headers[0]["authorization"] == f"Bearer {KEY}"
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) >= 5
    for path in files:
        assert KEY[:9].encode() not in path.read_bytes(), path
    for path in files:
        if path.name in ("transcript.jsonl", "cassette.jsonl"):
            text = path.read_text(encoding="utf-8")
            assert "127.0.0.1" not in text, path
            # A cassette's header tells its day.
            assert not re.search(r"\d\d:\d\d:\d\d", text), path
    if cause == "model_unreachable":
        assert result.error.startswith(f"{status}: 127.0.0.1")
        assert result.success is None
