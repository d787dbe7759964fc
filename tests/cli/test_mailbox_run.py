"""An episode that a person answers through a folder, recorded and replayed."""

from __future__ import annotations

import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from unilavira_drake.cli.main import main
from unilavira_drake.recording.result import result_from_json


def action(tool: dict[str, str]) -> dict[str, Any]:
    return {
        "progress_analysis": "I stand in a bedroom.",
        "reasoning_todo": "",
        "todo_updates": [],
        "reasoning_action": "As told.",
        "action": tool,
        "scene": "a bedroom",
    }


REPLIES = {
    "001-language-plan_todo": {"reasoning": "One step.", "todo": ["Stop here"]},
    "002-language-decide": action({"tool": "turn", "direction": "front"}),
    "002-vision-ground": {
        "target_desc": "floor", "box": None, "point": [320, 400], "confidence": None, "reason": "",
    },
    "003-language-decide": action({"tool": "double_check"}),
    "004-language-double_check": {"reasoning": "Here.", "confirmed": True, "reason": ""},
}  # fmt: skip


def answer(mail: Path) -> None:
    """Answers each request that appears, in the way that is asked for: by an atomic rename."""
    for name, reply in REPLIES.items():
        until = time.monotonic() + 60.0
        while not (mail / name / "prompt.txt").exists():
            if time.monotonic() > until:
                return
            time.sleep(0.01)
        beside = mail / name / ".reply.json"
        beside.write_text(json.dumps(reply))
        os.replace(beside, mail / name / "reply.json")


def test_a_person_answers_and_the_cassette_repeats_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("unilavira_drake.cli.run.check_rendering", lambda **_: None)
    mail = Path("mail")
    mail.mkdir()
    (mail / "mailbox.yaml").write_text("answered_by: A. Reader\n")
    reader = threading.Thread(target=answer, args=(mail.absolute(),), daemon=True)
    reader.start()
    command = ["run", "--scenario", "flat", "--task", "Stop at the sofa.", "--goal", "sofa_1"]
    assert main([*command, "--model", "mailbox:mail", "--record", "c.jsonl", "--out", "a"]) == 0
    reader.join(10.0)
    out = capsys.readouterr().out
    assert out.startswith("model: A. Reader answers through the folder mail")
    for name in REPLIES:
        assert f"reply to mail/{name}/reply.json" in out
    result = result_from_json(Path("a/result.json").read_text())
    assert (result.cause, result.success) == ("stopped", False)
    assert (result.model.language, result.model.perception) == ("mailbox", "images")
    assert result.model.reasoning == "human"
    assert result.usage.images >= 13
    header = json.loads(Path("c.jsonl").read_text().splitlines()[0])
    assert (header["answered_by"], header["preset"]) == ("A. Reader", "compact")
    # Without the mailbox, and without the detector: nothing but the cassette.
    monkeypatch.setattr("unilavira_drake.diagram.GroundTruthDetector.__call__", None)
    assert main([*command, "--model", "cassette:c.jsonl", "--out", "b"]) == 0
    replayed = result_from_json(Path("b/result.json").read_text())
    assert (replayed.model.language, replayed.model.reasoning) == ("cassette (mailbox)", "human")
    assert Path("a/transcript.jsonl").read_bytes() == Path("b/transcript.jsonl").read_bytes()
