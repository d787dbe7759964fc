"""The README shows what a run really prints."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).resolve().parents[2] / "README.md"
SECTION = "## What a run prints"


def told(text: str) -> list[str]:
    """The lines without what the machine decides: how long it took."""
    return [re.sub(r"wall +[\d.]+ s", "wall", line).rstrip() for line in text.strip().splitlines()]


def test_the_sample_is_what_the_first_command_prints(tmp_path: Path) -> None:
    sample = README.read_text(encoding="utf-8").split(SECTION)[1].split("```")[1]
    run = [sys.executable, "-c", "from unilavira_drake.cli.main import main; main()", "run"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert told(done.stdout) == told(sample)
