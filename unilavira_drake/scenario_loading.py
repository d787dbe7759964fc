"""Reads, overlays and writes scenarios; every mistake in them is a ``ScenarioError``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_data, yaml_load_typed

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.resources import models_path
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.scenario import Scenario, robot_kinds
from unilavira_drake.scenario_checks import validate
from unilavira_drake.scenario_schema import Source, check_fields

SUFFIXES = (".yaml", ".yml")


def scenario_names() -> list[str]:
    """Returns the names of the scenarios that come with the package."""
    return sorted(path.stem for path in (models_path() / "scenarios").glob("*.yaml"))


def load_scenario(name_or_file: str | Path, overlay: str = "") -> Scenario:
    """Reads a scenario, lays the overlay over it and checks every value.

    Args:
        name_or_file: a name out of :func:`scenario_names`, or a file that ends in ``.yaml``.
        overlay: YAML text; its keys replace the file's, mappings are merged, lists replaced.

    Raises:
        InputError: names place, value and remedy: an unknown name, an unreadable file, bad YAML,
            a misspelt key, a wrong type, a value that cannot be used.
    """
    path = _find(str(name_or_file))
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}.") from None
    scenario = _merged(text, str(path), Scenario())
    if overlay.strip():
        scenario = _merged(_with_robot(overlay, scenario), "overlay", scenario)
    validate(scenario)
    scenario.name = scenario.name or path.stem
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """Returns the scenario, complete, as YAML that :func:`load_scenario` reads back."""
    text: str = yaml_dump_typed(scenario)
    return text


def robot_setting(name: str) -> str:
    """Returns what chooses a robot by its name, as the YAML value of ``robot``.

    Raises:
        ScenarioError: names the nearest robot if there is none of this name.
    """
    kinds = robot_kinds()
    if name not in kinds:
        raise ScenarioError(unknown_name("robot", name, kinds, "robot"))
    return f"!{kinds[name].__name__} {{}}"


def overlay_from_settings(settings: list[str]) -> str:
    """Returns the overlay of ``dotted.key=value`` settings; the value is YAML.

    A later setting of the same key wins.

    Raises:
        ScenarioError: if a setting has no ``=`` or no key, or its value is not YAML.
    """
    root: dict[str, yaml.Node | dict] = {}  # type: ignore[type-arg]
    for setting in settings:
        keys, value = _parsed_setting(setting)
        level = root
        for depth, key in enumerate(keys[:-1]):
            below = level.setdefault(key, {})
            if isinstance(below, yaml.MappingNode) and below.tag.startswith("!"):
                # A choice, whose values may follow.
                below = level[key] = _Tagged(below)
            if not isinstance(below, dict):
                dotted = ".".join(keys[: depth + 1])
                raise ScenarioError(
                    f"setting {setting!r}: {dotted!r} was already set as a whole; "
                    "set it as a whole or key by key, not both."
                )
            level = below
        level[keys[-1]] = value
    return yaml.serialize(_node(root), Dumper=yaml.SafeDumper) if root else ""


def _parsed_setting(setting: str) -> tuple[list[str], yaml.Node]:
    dotted, separator, text = setting.partition("=")
    keys = [key.strip() for key in dotted.split(".")]
    if not separator or not all(keys):
        raise ScenarioError(
            f"setting {setting!r}: expected dotted.key=value, e.g. budgets.decisions=20."
        )
    try:
        value = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ScenarioError(
            f"setting {setting!r}: the value is not valid YAML ({_first_line(error)}); "
            "put text with special characters in quotes."
        ) from None
    return keys, value or yaml.ScalarNode("tag:yaml.org,2002:str", "", style="'")


def _node(value: yaml.Node | dict) -> yaml.Node:  # type: ignore[type-arg]
    if isinstance(value, yaml.Node):
        return value
    pairs = [
        (yaml.ScalarNode("tag:yaml.org,2002:str", key), _node(below))
        for key, below in value.items()
    ]
    tag = value.tag if isinstance(value, _Tagged) else "tag:yaml.org,2002:map"
    return yaml.MappingNode(tag, pairs)


class _Tagged(dict[str, Any]):
    """The keys below a tag."""

    def __init__(self, node: yaml.MappingNode) -> None:
        super().__init__((key.value, value) for key, value in node.value)
        self.tag = node.tag


def _find(name_or_file: str) -> Path:
    if name_or_file.endswith(SUFFIXES):
        path = Path(name_or_file)
        if not path.is_file():
            raise ScenarioError(f"scenario: no file {name_or_file!r}; check the path.")
        return path
    names = scenario_names()
    if name_or_file not in names:
        message = unknown_name("scenario", name_or_file, names, "scenario")
        raise ScenarioError(f"{message} A file's name ends in .yaml.")
    return models_path() / "scenarios" / f"{name_or_file}.yaml"


def _merged(text: str, name: str, defaults: Scenario) -> Scenario:
    try:
        source = Source(name, text, numbered=name != "overlay")
        data = yaml_load_data(text, private=True)
    except yaml.YAMLError as error:
        raise ScenarioError(f"{name}: not valid YAML: {_first_line(error)}.") from None
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{name}: a value cannot be read: {_first_line(error)}.") from None
    if data is None:
        return defaults
    if isinstance(data, dict):
        # Drake's rule: such keys at the top hold templates for anchors.
        data = {
            key: value
            for key, value in data.items()
            if key == "_tag" or not str(key).startswith("_")
        }
    check_fields(data, Scenario, source)
    try:
        merged: Scenario = yaml_load_typed(
            schema=Scenario, data=text, defaults=defaults, retain_map_defaults=True
        )
    except Exception as error:
        # Whatever the schema check lets pass and Drake still refuses is the text's fault too.
        raise ScenarioError(f"{name}: {_first_line(error)}.") from error
    return merged


def _with_robot(overlay: str, scenario: Scenario) -> str:
    """Returns the overlay with the tag of the file's robot, where it changes that one's values."""
    try:
        root = yaml.compose(overlay, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError):
        return overlay
    if isinstance(scenario.robot, CobotMagic) or not isinstance(root, yaml.MappingNode):
        return overlay  # No tag means that one.
    for key, value in root.value:
        if key.value == "robot" and value.tag == "tag:yaml.org,2002:map":
            value.tag = f"!{type(scenario.robot).__name__}"
            return yaml.serialize(root, Dumper=yaml.SafeDumper)
    return overlay


def _first_line(error: BaseException) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error).splitlines()[0]
    return f"{problem} (line {mark.line + 1})" if mark is not None else str(problem).rstrip(".")
