"""Where an aircraft starts in the air."""

from __future__ import annotations

import math

from unilavira_drake.errors import TaskError
from unilavira_drake.worlds.air_clearance import nearest_solid
from unilavira_drake.worlds.world import World

_HIGHEST = 200.0
"""Metres."""
_STEP = 0.5
"""By which a free height above a start that is not free is looked for, metres."""

AirStart = tuple[float, float, float, float]
"""x, y, z (metres) and yaw (radians)."""


def parse_air_start(text: str, world: World, *, radius: float) -> AirStart:
    """Returns x, y, z (metres) and yaw (radians) of ``X,Y,Z,YAW``.

    It is written for the world as its file says; in a mirrored world y and yaw are negated with it.

    Args:
        text: X,Y,Z,YAW.
        world: where the start must be free.
        radius: the aircraft's, metres; it keeps at least this clearance, to the ground too.

    Raises:
        TaskError: names the value and the remedy, for malformed text and for a place that is
            outside the world or not free.
    """
    try:
        x, y, z, yaw = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = yaw = math.nan
    if not all(math.isfinite(value) for value in (x, y, z, yaw)):
        raise TaskError(
            f"start: {text!r} is not X,Y,Z,YAW: four numbers (three of metres, radians), "
            "e.g. 150,34,20,1.57."
        )
    if world.mirrored:
        y, yaw = -y, -yaw
    if world.room_at(x, y) is None or z > _HIGHEST:
        raise TaskError(
            f"start: {text!r} is outside the world {world.name!r}; give a point over it, at most "
            f"{_HIGHEST:.0f} m high."
        )
    _check_free(text, (x, y, z), world, radius)
    return x, y, z, yaw


def _check_free(text: str, p_WP: tuple[float, float, float], world: World, radius: float) -> None:
    name, distance = nearest_solid(world, p_WP)
    if distance >= radius:
        return
    x, y, z = p_WP
    where = f"inside {name}" if distance == 0.0 else f"only {distance:.2f} m from {name}"
    height = math.ceil(max(z, 0.0) / _STEP) * _STEP
    while nearest_solid(world, (x, y, height))[1] < radius and height < _HIGHEST:
        height += _STEP
    raise TaskError(
        f"start: {text!r} is {where} and the aircraft needs {radius:.2f} m; "
        f"above it, {height:.1f} m is free."
    )
