"""``docs/models.md`` is true: its commands parse, its profiles load, its names exist."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml

from unilavira_drake.cli.main import app
from unilavira_drake.messages.metrics import CAUSES
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.profiles import load_profile, profile_names
from unilavira_drake.scenario_loading import load_scenario, overlay_from_settings
from unilavira_drake.serving import DEFAULT_PORT

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^(?:[A-Z_]+=\S+ )?(unilavira .*?)(?:\s+#.*)?$", GUIDE, re.MULTILINE)
PROFILES = re.findall(r"```yaml\n# (\S+)\n(.*?)```", GUIDE, re.DOTALL)


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_parse(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    someone = {"name": "m", "perception": "images", "reasoning": "model", "box_space": "pixels"}
    header = json.dumps({"cassette": 1, "language": someone, "vision": someone})
    (tmp_path / "run.cassette").write_text(header + "\n", encoding="utf-8")
    (tmp_path / "picture.jpg").write_bytes(b"")
    _, name, *arguments = shlex.split(line)
    group: Any = typer.main.get_command(app)
    context = group.commands[name].make_context(name, arguments)
    for key in ("model", "language_model", "vision_model"):
        spec = context.params.get(key)
        if spec:
            make_backend(spec, role="vision" if key == "vision_model" else "language", place=line)


def test_there_are_commands_for_every_kind_of_spec() -> None:
    assert len(COMMANDS) >= 14
    for start in ("rules", "gemini-3.1-pro", "local-9b", "openai:", "mailbox:", "cassette:"):
        assert any(f"model {start}" in line for line in COMMANDS), start


@pytest.mark.parametrize(("name", "text"), PROFILES)
def test_profiles_load(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert load_profile(str(tmp_path / name)).dialect == "openai"
    assert yaml.safe_load(text)["base_url"] in GUIDE


def test_names_are_those_of_the_code() -> None:
    for name in (*profile_names(), *ROLE_KEYS.values(), SHARED_KEY, str(DEFAULT_PORT)):
        assert name in GUIDE, name
    assert "model_unreachable" in CAUSES
    budgets = set(re.findall(r"`(?:--set )?budgets\.(\w+)", GUIDE))
    settings = [f"budgets.{name}=2" for name in sorted(budgets)]
    settings += re.findall(r"`--set ((?:prompt|record)_\w+=\w+)`", GUIDE)
    assert len(settings) == 6
    load_scenario("flat", overlay_from_settings(settings))
    for target in re.findall(r"\]\(\.\./(\S+?)\)", GUIDE):
        assert (ROOT / target).is_file()


def test_no_path_of_one_machine() -> None:
    assert not re.search(r"(?<![\w}.])/(home|root|work|tmp|Users)/", GUIDE)
