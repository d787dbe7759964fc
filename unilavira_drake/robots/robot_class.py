"""Checks the class of a robot of one's own before scenarios may choose it."""

from __future__ import annotations

import dataclasses as dc
import inspect
import types
import typing
from collections.abc import Iterable
from typing import Any

from unilavira_drake.errors import ScenarioError
from unilavira_drake.robots.robot import Robot


def same_class(one: type, other: type) -> bool:
    """Whether two classes come from the same lines, as after a reload of their module."""
    return (one.__module__, one.__qualname__) == (other.__module__, other.__qualname__)


def check_robot_class(kind: Any, known: Iterable[Any]) -> None:
    """Checks that scenarios can choose a robot by its tag and read and write its fields.

    Args:
        kind: the class that a person wrote.
        known: classes of robots that scenarios may choose already; an earlier state of ``kind`` is
            passed over.

    Raises:
        ScenarioError: names place, value and remedy.
    """
    if not (inspect.isclass(kind) and issubclass(kind, Robot)):
        raise ScenarioError(
            f"register_robot: {kind!r} is no class of a robot; "
            "give a dataclass that derives from GroundRobot or Robot."
        )
    place = f"register_robot: {_place(kind)}"
    if "__dataclass_fields__" not in vars(kind):
        raise ScenarioError(f"{place} is no dataclass; write @dataclasses.dataclass above it.")
    _check_fields(kind, place)
    _check_names(kind, known, place)


def _check_names(kind: Any, known: Iterable[Any], place: str) -> None:
    name = kind().name
    for other in known:
        if same_class(other, kind):
            continue
        if other.__name__ == kind.__name__:
            raise ScenarioError(
                f"{place}: the tag !{kind.__name__} is taken by {_place(other)}; rename the class."
            )
        if other().name == name:
            raise ScenarioError(
                f"{place}: name: {name!r} is taken by {_place(other)}; give another name."
            )


def _check_fields(kind: type[Robot], place: str) -> None:
    for field in dc.fields(kind):
        if isinstance(field.type, str):
            raise ScenarioError(
                f"{place}: the type of {field.name} is the text {field.type!r}; remove "
                f"'from __future__ import annotations' from {kind.__module__}, and the quotes "
                "around types."
            )
        if not _is_readable(field.type):
            raise ScenarioError(
                f"{place}: {field.name} has the type {field.type!r}, which YAML cannot hold; use "
                "bool, int, float, str, list[...], dict[str, ...], a dataclass, or one of them | "
                "None."
            )
    bare = {
        field.name: field.type
        for field in dc.fields(kind)
        if field.default is dc.MISSING and field.default_factory is dc.MISSING
    }
    if bare:
        name, type_ = next(iter(bare.items()))
        raise ScenarioError(
            f"{place}: no default for {', '.join(bare)}; give each its type and its value, "
            f"e.g. {name}: {getattr(type_, '__name__', type_)} = ..."
        )


def _is_readable(schema: Any) -> bool:
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        return all(one is type(None) or _is_readable(one) for one in arguments)
    if origin is list:
        return _is_readable(arguments[0])
    if origin is dict:
        return arguments[0] is str and _is_readable(arguments[1])
    if schema in (bool, int, float, str):
        return True
    return inspect.isclass(schema) and (dc.is_dataclass(schema) or hasattr(schema, "__fields__"))


def _place(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"
