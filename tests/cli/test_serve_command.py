"""``unilavira serve`` as a process: what it prints, answers, and how it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator

import httpx
import pytest

from unilavira_drake.cli.main import main


@pytest.fixture
def server() -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    command = [sys.executable, "-c", "import sys; from unilavira_drake.cli.main import main; "
               "sys.exit(main())", "serve", "--model", "rules", "--port", "0"]  # fmt: skip
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline().strip() for _ in range(4)]
        yield process, lines
        process.kill()


def test_it_says_where_it_is_and_ends_with_ctrl_c(
    server: tuple[subprocess.Popen[str], list[str]],
) -> None:
    process, lines = server
    assert "rules on the simulator's labels" in lines[0]
    chat, gemini = (line.rpartition(" ")[2] for line in lines[1:3])
    assert chat == f"{gemini}/v1"
    assert "answers typed requests only" in lines[3]
    assert httpx.get(f"{gemini}/health", trust_env=False).json() == {"status": "ok"}
    told = httpx.get(f"{gemini}/v1/models?key=SECRET", trust_env=False)
    assert told.json()["data"][0]["id"] == "rules"
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20.0)
    assert process.returncode == 0
    assert out.strip() == "ended"
    assert "GET /v1/models: 200" in err
    assert "SECRET" not in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "gemni-3.1-pro"], "did you mean 'gemini-3.1-pro'"),
        (["--model", "rules", "--port", "70000"], "70000"),
        ([], "--model"),
    ],
)
def test_bad_input(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", *arguments]) == 2
    assert words in capsys.readouterr().err
