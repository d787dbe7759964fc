"""``unilavira doctor``: one line a check, and an exit code that a script can use."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from unilavira_drake.cli.main import main
from unilavira_drake.errors import RenderingError
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.serving import ModelServer

LINE = re.compile(r"(ok     |FAILED |unknown)  [^:]+: .+")


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("unilavira_drake.cli.doctor.check_rendering", lambda **_: None)
    for name in (*ROLE_KEYS.values(), SHARED_KEY):
        monkeypatch.delenv(name, raising=False)


def test_an_able_machine(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(LINE.fullmatch(line) and line.startswith("ok ") for line in lines)
    assert any("rendering with vtk" in line for line in lines)
    assert any(line.startswith("ok       drake: 1.") for line in lines)


def test_a_renderer_that_fails_does_not_hide_the_other_checks(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*, renderer: str) -> None:
        if renderer == "vtk":
            raise RenderingError("rendering: no driver. Install what it needs: libegl1")

    monkeypatch.setattr("unilavira_drake.cli.doctor.check_rendering", broken)
    assert main(["doctor"]) == 3
    out = capsys.readouterr().out
    assert "FAILED   rendering with vtk: no driver. Install what it needs: libegl1\n" in out
    assert "ok       rendering with raster" in out


def test_an_endpoint_is_checked_after_the_machine(capsys: pytest.CaptureFixture[str]) -> None:
    rules = RulesModel()
    with ModelServer({"language": rules, "vision": rules}, name="rules", port=0).running() as at:
        Path("served.yaml").write_text(
            "description: rules behind a server\n"
            f"base_url: {at.chat_address}\n"
            "dialect: openai\nmodel: rules\npeer: rules\nbox_space: pixels\n"
        )
        assert main(["doctor", "--model", "served.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(LINE.fullmatch(line) for line in lines)
    assert any(line.startswith("ok       structured output: json_schema, a") for line in lines)


def test_an_endpoint_that_is_away(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--model", "openai:any@http://127.0.0.1:9/v1"]) == 3
    out = capsys.readouterr().out
    assert "FAILED   reachable: 127.0.0.1:9 refuses the connection" in out
    assert "unknown  cost: not tried" in out


def test_a_model_without_an_endpoint_is_only_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--model", "rules"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("ok       model rules: rules on the simulator's labels")


def test_an_unknown_model_is_bad_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--model", "gemni-3.1-pro"]) == 2
    captured = capsys.readouterr()
    assert "did you mean 'gemini-3.1-pro'" in captured.err
    assert not captured.out
