"""Bad input of every kind: exit code 2, one clear message, no traceback, nothing left behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from unilavira_drake.cli.main import main
from unilavira_drake.rendering_check import check_rendering


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # A second each, and tests/test_rendering_check.py is about it.
    monkeypatch.setattr(f"unilavira_drake.cli.run.{check_rendering.__name__}", lambda **_: None)


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["--scenario", "flta"], ["unknown scenario 'flta'", "did you mean 'flat'"]),
        (["--scenario", "none.yaml"], ["no file 'none.yaml'"]),
        (["--robot", "cobot"], ["unknown robot 'cobot'", "did you mean 'cobot_magic'"]),
        (["--robot", "go1"], ["unknown robot 'go1'", "did you mean 'unitree_go1'"]),
        (["--model", "cassette:nope"], ["unilavira: language_model: unknown cassette"]),
        (["--model", "ruels"], ["'ruels'", "did you mean 'rules'"]),
        (["--model", "rules:wild"], ["wild"]),
        (["--language-model", "gpt"], ["language_model", "'gpt'"]),
        (["--vision-model", "rulez"], ["vision_model", "'rulez'"]),
        (["--model", "rules", "--vision-model", "random"], ["--model", "--vision-model"]),
        (["--task", "@frige"], ["unknown task 'frige'", "did you mean 'fridge'"]),
        (["--task", ""], ["task", "empty"]),
        (["--task", "  \n"], ["task", "empty"]),
        (["--task", "go " * 2001], ["2001 words", "2000"]),
        (["--ablation", "no_tmd"], ["'no_tmd'", "did you mean 'no_tdm'"]),
        (["--renderer", "vulkan"], ["unknown renderer 'vulkan'", "vtk"]),
        (["--start", "kichen"], ["start", "did you mean 'kitchen'"]),
        (["--start", "5.0,2.9,0"], ["start", "'5.0,2.9,0'", "nearest free place"]),
        (["--start", "-9,0,0"], ["start", "outside the world"]),
        (["--start", "1,2"], ["start", "X,Y,YAW"]),
        (["--goal", "fridge_1"], ["goal", "fridge_1"]),
        (["--goal", "99,99"], ["goal", "outside"]),
        (["--seed", "-1"], ["random_seed", "-1"]),
        (["--seed", "1.5"], ["random_seed", "a whole number", "'1.5'"]),
        (["--max-decisions", "0"], ["budgets.decisions", "0"]),
        (["--max-decisions", "-3"], ["budgets.decisions", "-3"]),
        (["--max-decisions", "many"], ["budgets.decisions", "a whole number", "'many'"]),
        (["--set", "budgets.decisons=3"], ["budgets.decisons", "did you mean 'decisions'"]),
        (["--set", "robot.radius=wide"], ["robot.radius", "a number", "'wide'"]),
        (["--set", "budgets.decisions"], ["dotted.key=value"]),
        (["--set", "tick=["], ["not valid YAML"]),
        (["--set", "budgets.stall=-1"], ["budgets.stall", "-1"]),
        (["--taks", "Go."], ["--taks"]),
        (["--out", "full"], ["not empty", "old.txt"]),
        (["--out", "file"], ["cannot be used"]),
        (["--out", "file/below"], ["cannot be used"]),
    ],
    ids=lambda value: " ".join(value)[:40] if value[0].startswith("--") else "",
)
def test_run_says_what_is_wrong(
    arguments: list[str], fragments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("full").mkdir()
    Path("full/old.txt").write_text("keep")
    Path("file").write_text("")
    assert main(["run", *arguments]) == 2
    captured = capsys.readouterr()
    message = " ".join(captured.err.replace("│", " ").split())
    for fragment in fragments:
        assert fragment in message
    assert "Traceback" not in captured.out + captured.err
    left = {str(path) for path in Path().rglob("*")}
    assert left == {"full", "full/old.txt", "file"}


def test_a_scenario_file_s_mistake_is_told_with_its_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("mine.yaml").write_text("world: {name: flat}\nbudgets: {decisions: few}\n")
    assert main(["run", "--scenario", "mine.yaml"]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert "mine.yaml, line 2: budgets.decisions: expected a whole number, got 'few'" in message


@pytest.mark.parametrize("text", ["", "world: {name: flat}\n"])
def test_a_scenario_without_tasks_asks_for_one(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("mine.yaml").write_text(text)
    assert main(["run", "--scenario", "mine.yaml"]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert "no task was given, and the scenario names none" in message
    assert "--task" in message
    assert "task.text" in message
    assert "set it to one of" not in message


@pytest.mark.parametrize("goal", ["kitchn", "99,99", "fridge_9"])
def test_a_goal_is_checked_before_anything_is_said_of_it(
    goal: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--task", "Go.", "--goal", goal]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "goal" in captured.err


def test_an_unknown_command_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rum"]) == 2
    assert "rum" in capsys.readouterr().err
