"""The commands on good input, and the exit codes that are nobody's mistake."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from unilavira_drake.cli.main import main
from unilavira_drake.cli.progress import Progress
from unilavira_drake.errors import RenderingError
from unilavira_drake.messages import LanguageAction, NavigationStatus, TodoItem, TodoList
from unilavira_drake.recording.result import installed_versions, result_from_json
from unilavira_drake.scenario_loading import load_scenario


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def _no_preflight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("unilavira_drake.cli.run.check_rendering", lambda **_: None)


def test_a_run_tells_its_story_and_leaves_its_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--max-decisions", "1", "--seed", "3", "--goal", "sofa_1"]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].startswith("model: rules on the simulator's labels")
    assert "not a multimodal LLM" in out
    assert "no success: decision_budget" in out
    assert out.count("\n  unilavira ") == 3
    assert "\n  unilavira report runs/apartment-fridge-1\n" in out
    folder = Path("runs/apartment-fridge-1")
    assert {path.name for path in folder.iterdir()} == {
        "frames",
        "ledger.jsonl",
        "map.png",
        "maps",
        "result.json",
        "scenario.yaml",
        "timings.json",
        "transcript.jsonl",
    }
    result = result_from_json((folder / "result.json").read_text())
    assert (result.seed, result.task.name, result.task.goal) == (3, "fridge", "sofa_1")
    assert (result.model.perception, result.model.reasoning) == ("ground_truth", "rules")
    for line in (folder / "transcript.jsonl").read_text().splitlines():
        assert list(json.loads(line)) == ["t", "decision", "system", "event", "data"]


@pytest.mark.usefixtures("_no_preflight")
def test_an_interrupt_keeps_what_was_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = Progress.record

    def interrupted(self: Progress, t: float, system: str, event: str, message: Any) -> None:
        record(self, t, system, event, message)
        if isinstance(message, LanguageAction):
            raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "record", interrupted)
    assert main(["run", "--out", "kept"]) == 130
    assert "Traceback" not in capsys.readouterr().err
    lines = Path("kept/transcript.jsonl").read_text().splitlines()
    assert "panorama" in {json.loads(line)["event"] for line in lines}
    result = result_from_json(Path("kept/result.json").read_text())
    assert (result.cause, result.success) == ("interrupted", None)


def test_a_machine_without_a_renderer_is_not_the_user_s_mistake(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(**_: str) -> None:
        raise RenderingError("rendering: install libegl1")

    monkeypatch.setattr("unilavira_drake.cli.run.check_rendering", broken)
    monkeypatch.setattr("unilavira_drake.cli.doctor.check_rendering", broken)
    for arguments in (["run"], ["doctor"]):
        assert main(arguments) == 3
        captured = capsys.readouterr()
        assert "install libegl1" in captured.out + captured.err
    assert not Path("runs").exists()


def test_ports_come_from_the_built_diagram(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ports"]) == 0
    table = capsys.readouterr().out
    for row in ("agent.language", "navigation.governor", "front.depth_image", "LanguageAction"):
        assert row in table
    assert main(["ports", "--dot"]) == 0
    assert capsys.readouterr().out.startswith("digraph")


def test_scenarios_lists_what_can_be_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    listing = capsys.readouterr().out
    for name in ("scenario flat", "@fridge (default)", "cobot_magic", "dining room"):
        assert name in listing


def test_help_names_every_flag_of_the_contract(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--help"]) == 0
    text = capsys.readouterr().out
    flags = "task goal start scenario robot model language-model vision-model ablation seed"
    for flag in [*flags.split(), "max-decisions", "renderer", "record", "set", "out", "meshcat"]:
        assert f"--{flag}" in text


def test_the_list_is_printed_when_it_changes() -> None:
    stream = io.StringIO()
    progress = Progress(Console(file=stream, width=60))
    items = (TodoItem("Leave", "completed", "door [behind]"), TodoItem("Enter"))
    with progress:
        progress.record(1.0, "", "", LanguageAction(n=1, call="decide", reasoning_action="a" * 90))
        progress.record(1.1, "", "", TodoList(n=1, items=items))
        progress.record(1.2, "", "", TodoList(n=2, items=items, feedback=("item 2 stays open",)))
        progress.record(1.3, "", "", NavigationStatus(n=2, state="failed", reason="stuck"))
    lines = [line.strip() for line in stream.getvalue().splitlines()]
    assert lines[0].startswith("1. decide")
    assert lines[1:] == [
        "a" * 90,
        "[x] Leave (door [behind])",
        "[ ] Enter",
        "! item 2 stays open",
        "failed: stuck",
    ]


def test_the_columns_of_decisions_hold_whatever_is_decided() -> None:
    stream = io.StringIO()
    progress = Progress(Console(file=stream, width=120))
    actions = (
        LanguageAction(1, "decide", "turn", "left"),
        LanguageAction(2, "decide", "turn", "down", climb=15.0),
        LanguageAction(3, "decide", "fly", bearing=-30.0, distance=120.0, climb=-2.0),
        LanguageAction(4, "double_check", "stop"),
    )
    with progress:
        for action in actions:
            progress.record(99.0, "", "", action)
    lines = stream.getvalue().splitlines()
    decisions = [line for line in lines if "simulated" in line]
    assert len({line.index("simulated") for line in decisions}) == 1
    assert [" ".join(line.split()[1:3]) for line in decisions] == [
        "decide turn",
        "decide turn",
        "decide fly",
        "double_check stop",
    ]
    told = [line.strip() for line in lines if line not in decisions]
    assert told == ["down, 15 m up", "120 m at 30 degrees to the right, 2 m down"]


def test_the_versions_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    versions = installed_versions()
    told = f"unilavira-drake {versions['unilavira-drake']}, drake {versions['drake']}\n"
    assert capsys.readouterr().out == told


@pytest.mark.usefixtures("_no_preflight")
def test_a_robot_is_chosen_by_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "walk"
    arguments = ["--robot", "unitree_g1", "--set", "robot.max_speed=0.35", "--max-decisions", "1"]
    assert main(["run", "--scenario", "flat", *arguments, "--out", str(out)]) == 0
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["robot"] == "unitree_g1"
    robot = load_scenario(str(out / "scenario.yaml")).robot
    assert (type(robot).__name__, robot.max_speed) == ("UnitreeG1", 0.35)
    assert main(["scenarios"]) == 0
    assert "unitree_g1, unitree_go1" in capsys.readouterr().out
