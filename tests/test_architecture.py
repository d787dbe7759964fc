"""The direction of imports, file sizes and names, read from the source."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "unilavira_drake"
NAME = PACKAGE.name

# Each module may import from its own layer and from those above it in this list.
LAYERS = (
    ("errors", "resources", "kernels"),
    ("messages",),
    ("tasks", "answer_words", "stated_direction", "mllm"),
    ("ports", "planning", "mapping", "language", "memory", "vision", "sensors", "worlds", "raster"),
    ("people",),
    ("model_link", "rendering_check", "asking", "endpoint_check", "serving"),
    ("robots",),
    ("scenario", "scenario_schema", "task_choice"),
    ("scenario_checks", "scenario_loading", "episode_monitor", "wiring"),
    ("station", "station_cameras", "agent", "flight_navigation", "navigation", "model_pair"),
    ("recording",),
    ("diagram", "evaluation"),
    ("episode_result", "report"),
    ("episode",),
    ("cli",),
)
LAYER = {part: index for index, layer in enumerate(LAYERS) for part in layer}
AGENT = ("language", "memory", "vision", "mllm", "sensors", "mapping", "planning", "robots")
GOAL_KEEPERS = ("evaluation", "scenario", "task_choice", "episode", "diagram", "station")
FILES = sorted(PACKAGE.rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Returns the dotted names that a file imports, with what it takes from packages."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def own_imports(path: Path) -> set[str]:
    """Returns what a file imports of this package, relative to it."""
    prefix = f"{NAME}."
    return {name[len(prefix) :] for name in imports(path) if name.startswith(prefix)}


def part(path: Path) -> str:
    """Returns the top-level module or subpackage of a file."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def identify(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


@pytest.mark.parametrize("path", FILES, ids=identify)
def test_imports_point_upward_only(path: Path) -> None:
    if path == PACKAGE / "__init__.py":
        return
    assert part(path) in LAYER, f"{part(path)}: give it a layer"
    wrong = {
        name for name in own_imports(path) if LAYER.get(name.split(".")[0], 0) > LAYER[part(path)]
    }
    assert not wrong


def test_systems_of_different_levels_never_import_each_other() -> None:
    systems = [path for path in FILES if "system" in path.stem]
    modules = {".".join(path.relative_to(PACKAGE).with_suffix("").parts) for path in systems}
    for path in systems:
        taken = {module for module in modules for name in own_imports(path) if module in name}
        assert all(module.split(".")[0] == part(path) for module in taken), path


def test_robots_know_nothing_of_the_agent() -> None:
    for path in (PACKAGE / "robots").glob("*.py"):
        parts = {name.split(".")[0] for name in own_imports(path)}
        assert not parts & {"language", "vision", "mllm", "memory"}, path


def test_models_and_pure_algorithms_do_without_drake() -> None:
    for path in (PACKAGE / "mllm").rglob("*.py"):
        assert not {name for name in imports(path) if name.startswith("pydrake")}, path


@pytest.mark.parametrize("path", [p for p in FILES if part(p) in AGENT], ids=identify)
def test_the_agent_never_sees_what_scores_it(path: Path) -> None:
    parts = {name.split(".")[0] for name in own_imports(path)}
    assert not parts & set(GOAL_KEEPERS)


def test_nothing_imports_all_of_drake() -> None:
    for path in FILES:
        assert not {name for name in imports(path) if name.startswith("pydrake.all")}, path


def test_no_system_fails_by_an_event_status() -> None:
    # It ends the process with a segmentation fault.
    for path in FILES:
        assert "EventStatus.Failed" not in path.read_text(encoding="utf-8").replace(
            "never ``EventStatus.Failed``", ""
        ), path


@pytest.mark.parametrize(
    "path",
    [*FILES, *(ROOT / "examples").glob("*.py"), *(ROOT / "tests").rglob("*.py")],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_files_stay_short_and_well_named(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400
    assert path.stem not in {"utils", "util", "common", "helpers", "helper", "misc"}


def test_every_test_file_has_a_name_of_its_own() -> None:
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert len(names) == len(set(names))
