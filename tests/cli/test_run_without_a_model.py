"""``unilavira run`` with a model that cannot be asked, or stops to answer: told soon."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from unilavira_drake.cli.main import main
from unilavira_drake.cli.progress import Progress
from unilavira_drake.cli.run import check_models
from unilavira_drake.errors import InfrastructureError
from unilavira_drake.messages import LanguageAction
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.scenario_loading import load_scenario

CALLS = logging.getLogger("unilavira_drake.mllm.remote_call")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("unilavira_drake.cli.run.check_rendering", lambda **_: None)
    for name in (*ROLE_KEYS.values(), SHARED_KEY):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def silent_port() -> Iterator[int]:
    """A port at which nobody listens."""
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        yield holder.getsockname()[1]


@pytest.fixture
def hasty_port() -> Iterator[int]:
    """A port where every connection is taken and closed without a word."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with contextlib.suppress(OSError):  # The listener is shut down.
            while True:
                server.accept()[0].close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield server.getsockname()[1]
    server.shutdown(socket.SHUT_RDWR)
    server.close()
    thread.join(5.0)


def write_profile(port: int) -> None:
    Path("own.yaml").write_text(
        "description: a model of one's own\n"
        f"base_url: http://127.0.0.1:{port}/v1\n"
        "dialect: openai\nmodel: own\nmax_attempts: 2\noutage_patience: 600\n",
        encoding="utf-8",
    )


@pytest.mark.parametrize("role", ["language", "vision"])
def test_a_server_that_does_not_run(
    role: str, silent_port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    write_profile(silent_port)
    arguments = ["--scenario", "flat", f"--{role}-model", "own.yaml"]
    for out in ([], ["--out", "kept"]):
        assert main(["run", *arguments, *out]) == 3
        captured = capsys.readouterr()
        assert not captured.out
        assert captured.err == (
            f"unilavira: {role}_model: 127.0.0.1:{silent_port} refuses the connection; is the "
            "server running? To check it: unilavira doctor --model own.yaml\n"
        )
    assert [path.name for path in Path().iterdir()] == ["own.yaml"]


def test_a_key_that_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--scenario", "flat", "--model", "gemini-3.1-pro"]) == 3
    captured = capsys.readouterr()
    assert not captured.out
    (line,) = captured.err.splitlines()
    assert f"needs a key: set UNILAVIRA_LANGUAGE_API_KEY or {SHARED_KEY}" in line
    assert line.endswith("unilavira doctor --model gemini-3.1-pro")
    assert not list(Path().iterdir())


def test_a_cassette_to_continue_may_need_no_model(silent_port: int) -> None:
    write_profile(silent_port)
    new = {"language_model": "own.yaml", "record": "c.jsonl"}
    with pytest.raises(InfrastructureError, match="refuses the connection"):
        check_models(load_scenario("flat", json.dumps(new)))
    check_models(load_scenario("flat", json.dumps({**new, "record_mode": "record_new"})))


def test_a_server_that_stops_to_answer(hasty_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    write_profile(hasty_port)
    profile = Path("own.yaml").read_text(encoding="utf-8")
    Path("own.yaml").write_text(profile.replace("patience: 600", "patience: 0"), encoding="utf-8")
    assert main(["run", "--scenario", "flat", "--model", "own.yaml", "--out", "kept"]) == 3
    captured = capsys.readouterr()
    for number in (1, 2):
        assert re.search(rf"^     try {number} failed: .*:{hasty_port} broke", captured.out, re.M)
    *_, first, second, third = captured.out.splitlines()
    assert first == "  unilavira doctor --model own.yaml"
    assert second == "  unilavira report kept"
    assert third == "  unilavira run --scenario kept/scenario.yaml --model rules"
    assert captured.err.startswith("unilavira: MllmUnreachable: ")


def test_the_live_line_goes_on_by_itself_and_tells_of_the_last_failed_try() -> None:
    stream = io.StringIO()
    progress = Progress(Console(file=stream, width=200, force_terminal=True))
    level = CALLS.level

    def shown(words: str) -> bool:
        until = time.monotonic() + 10.0
        while words not in stream.getvalue():
            if time.monotonic() > until:
                return False
            time.sleep(0.02)
        return True

    with progress:
        assert shown("building the world, wall 0.2 s")
        progress.record(1.8, "", "", MllmRequest(role="language", n=1, call="plan_todo"))
        assert shown("the language model thinks (plan_todo)  simulated 1.8 s, wall ")
        CALLS.info("try %d failed: %s", 1, "127.0.0.1:8080 refuses [the] connection.")
        assert shown(" s; try 1 failed: 127.0.0.1:8080 refuses [the] connection.")
        progress.record(2.0, "", "", LanguageAction(n=1, call="plan_todo"))
        stream.seek(0)
        stream.truncate()
        assert shown("the language model thinks")
    assert "refuses" not in stream.getvalue().rpartition("simulated")[2]
    assert (CALLS.level, CALLS.handlers) == (level, [])
