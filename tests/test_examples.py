"""Every example runs to its end and is short."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
IGNORED = ROOT / ".gitignore"


def test_there_are_examples() -> None:
    assert {path.stem for path in EXAMPLES} >= {"run_episode", "swap_controller", "swap_level"}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(path: Path, tmp_path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 60
    done = subprocess.run(
        [sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True, timeout=240
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip()
    for picture in tmp_path.glob("*.png"):
        assert picture.name in done.stdout
        assert f"/{picture.name}" in IGNORED.read_text(encoding="utf-8").splitlines()
    if path.stem == "people_cross":
        check_nobody_is_touched(done.stdout)


def check_nobody_is_touched(said: str) -> None:
    words = r"stood ([\d.]+) s, drove ([\d.]+) m;.*\nnearest ([\d.]+) m, touched: (\w+)"
    ((stood, driven, nearest, touched),) = re.findall(words, said)
    assert float(stood) >= 1.0
    assert float(driven) >= 7.0
    assert float(nearest) >= 0.2
    assert touched == "False"


def test_the_first_example_has_ten_lines() -> None:
    (first,) = [path for path in EXAMPLES if path.stem == "run_episode"]
    code = [line for line in first.read_text(encoding="utf-8").splitlines() if line.strip()]
    assert len(code) <= 10
