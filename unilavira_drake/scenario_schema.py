"""Checks YAML data against the scenario's dataclasses and says exactly where it does not fit.

Drake's ``yaml_load_typed`` refuses the same data, without the place or the remedy.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping
from typing import Any

import yaml

from unilavira_drake.errors import ScenarioError, unknown_name

_WORDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false"}


class Source:
    """A YAML text, and where each of its keys stands.

    Args:
        name: how messages call the text: a file's path, or ``overlay``.
        numbered: whether messages give line numbers, as for a text that a person wrote.
    """

    def __init__(self, name: str, text: str, *, numbered: bool) -> None:
        self.name = name
        self._lines: dict[tuple[str, ...], int] = {}
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        if root is not None and numbered:
            self._index(root, (), 0)

    def place(self, path: tuple[str, ...]) -> str:
        """Returns the dotted place of a key, with its file and line when there is one."""
        dotted = ".".join(path) or "scenario"
        line = self._lines.get(path)
        return f"{self.name}, line {line}: {dotted}" if line else f"{self.name}: {dotted}"

    def _index(self, node: yaml.Node, path: tuple[str, ...], depth: int) -> None:
        if depth > 20:  # An alias that holds itself; no scenario is that deep.
            return
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                below = (*path, str(key.value))
                self._lines.setdefault(below, key.start_mark.line + 1)
                self._index(value, below, depth + 1)
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                below = (*path, str(index))
                self._lines.setdefault(below, value.start_mark.line + 1)
                self._index(value, below, depth + 1)


def check_fields(data: Any, schema: type, source: Source, path: tuple[str, ...] = ()) -> None:
    """Checks a mapping against a schema: keys, types, tags, at every depth.

    Args:
        data: as ``pydrake.common.yaml.yaml_load_data`` returns it (a tag is the key ``_tag``).
        schema: a dataclass, or a class of Drake's with ``__fields__``.

    Raises:
        ScenarioError: names place, value and remedy.
    """
    if not isinstance(data, Mapping):
        names = ", ".join(list(_field_types(schema))[:4])
        raise ScenarioError(
            f"{source.place(path)}: expected keys such as {names}, got {_shown(data)}."
        )
    if "_tag" in data:
        raise ScenarioError(
            f"{source.place(path)}: takes no tag; remove {_shown(data['_tag'])} there."
        )
    fields = _field_types(schema)
    for key, value in data.items():
        if key not in fields:
            place = source.place((*path, str(key)))
            raise ScenarioError(unknown_name("key", str(key), fields, place))
        _check_value(value, fields[key], source, (*path, key))


def _check_value(value: Any, schema: Any, source: Source, path: tuple[str, ...]) -> None:
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if schema in _WORDS:
        _check_scalar(value, schema, source, path)
    elif origin is list:
        if not isinstance(value, list):
            raise _wrong(source, path, "a list, e.g. [a, b]", value)
        for index, item in enumerate(value):
            _check_value(item, arguments[0], source, (*path, str(index)))
    elif origin is dict:
        if not isinstance(value, Mapping) or "_tag" in value:
            raise _wrong(source, path, "a mapping of names, e.g. {name: ...}", value)
        for key, item in value.items():
            if not isinstance(key, str):
                raise _wrong(source, (*path, str(key)), "a name (quote it)", key)
            _check_value(item, arguments[1], source, (*path, key))
    elif origin in (typing.Union, types.UnionType):
        _check_union(value, arguments, source, path)
    else:
        check_fields(value, schema, source, path)


def _check_union(
    value: Any, alternatives: tuple[Any, ...], source: Source, path: tuple[str, ...]
) -> None:
    if value is None and type(None) in alternatives:
        return
    tag = value.get("_tag") if isinstance(value, Mapping) else None
    if tag is None:
        _suggest_tag(value, alternatives, source, path)
        _check_value(value, alternatives[0], source, path)
        return
    by_tag = {f"!{alternative.__name__}": alternative for alternative in alternatives}
    if tag not in by_tag:
        raise ScenarioError(unknown_name("tag", str(tag), by_tag, source.place(path)))
    untagged = {key: item for key, item in value.items() if key != "_tag"}
    check_fields(untagged, by_tag[tag], source, path)


def _suggest_tag(
    value: Any, alternatives: tuple[Any, ...], source: Source, path: tuple[str, ...]
) -> None:
    """Without a tag the first alternative is meant; says so where the keys are another's."""
    keys = {str(key) for key in value} if isinstance(value, Mapping) else set()
    if not keys or keys <= set(_field_types(alternatives[0])):
        return
    for other in alternatives[1:]:
        if keys <= set(_field_types(other)):
            raise ScenarioError(
                f"{source.place(path)}: {', '.join(sorted(keys))} needs a tag; "
                f"write {path[-1]}: !{other.__name__} {{{min(keys)}: ...}}."
            )


def _check_scalar(value: Any, schema: type, source: Source, path: tuple[str, ...]) -> None:
    if schema is str:
        if not isinstance(value, str):
            hint = f"text; write it in quotes: '{value}'" if _is_plain(value) else "text"
            raise _wrong(source, path, hint, value)
    elif schema is bool:
        if not isinstance(value, bool) and value not in ("true", "false"):
            raise _wrong(source, path, _WORDS[bool], value)
    elif not _converts(value, schema):
        raise _wrong(source, path, _WORDS[schema], value)


def _is_plain(value: Any) -> bool:
    return isinstance(value, bool | int | float)


def _converts(value: Any, schema: type) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return False
    try:
        if schema is float:
            float(value)
            return True
        # A whole float is a whole number; a text is read as Python reads it.
        return value.is_integer() if isinstance(value, float) else int(value) is not None
    except (ValueError, OverflowError):
        return False


def _field_types(schema: type) -> dict[str, Any]:
    if dataclasses.is_dataclass(schema):
        return {field.name: field.type for field in dataclasses.fields(schema)}
    return {field.name: field.type for field in schema.__fields__}  # type: ignore[attr-defined]


def _wrong(source: Source, path: tuple[str, ...], expected: str, value: Any) -> ScenarioError:
    return ScenarioError(f"{source.place(path)}: expected {expected}, got {_shown(value)}.")


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:59] + "…"
