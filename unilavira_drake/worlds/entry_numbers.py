"""Numbers of the entries of a world file."""

from __future__ import annotations

import math

from unilavira_drake.errors import ScenarioError


def numbers(values: list[float], count: int, place: str) -> tuple[float, ...]:
    """Returns finite numbers, as many as expected.

    Raises:
        ScenarioError: if they are not.
    """
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise ScenarioError(f"{place}: {values}; expected {count} numbers.")
    return tuple(values)


def rgb(values: list[float], place: str) -> tuple[float, float, float]:
    """Returns red, green and blue.

    Raises:
        ScenarioError: unless they are three shares.
    """
    red, green, blue = numbers(values, 3, place)
    if not all(0.0 <= value <= 1.0 for value in values):
        raise ScenarioError(f"{place}: {values}; each of red, green, blue must lie in [0, 1].")
    return (red, green, blue)
