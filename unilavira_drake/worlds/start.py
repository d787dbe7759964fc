"""Where the robot starts: ROOM, X,Y,YAW or X,Y,Z,YAW, checked against the world."""

from __future__ import annotations

import math

import numpy as np

from unilavira_drake.errors import TaskError, unknown_name
from unilavira_drake.worlds.air_start import parse_air_start
from unilavira_drake.worlds.clearance import clearance, nearest_obstacle, room_grid
from unilavira_drake.worlds.world import Room, World

GRID_STEP = 0.05
"""Spacing of the points among which a free one is looked for, metres."""
POINTS_OUTDOORS = 120
"""Of them along the longer side of a district."""

OFF_FLOOR = 0.3
"""A height this near to that of a floor means that floor, metres."""


def parse_start(text: str, world: World, *, radius: float) -> tuple[float, float, float]:
    """Returns x, y (metres) and yaw (radians) of a start; see :func:`parse_start_pose`."""
    x, y, _, yaw = parse_start_pose(text, world, radius=radius)
    return x, y, yaw


def parse_start_pose(
    text: str, world: World, *, radius: float, climbs: bool = True, flies: bool = False
) -> tuple[float, float, float, float]:
    """Returns x, y, height of the floor (metres) and yaw (radians) of a start.

    ``ROOM`` (a name or kind) is the point of that room farthest from everything, yaw 0.
    ``X,Y,YAW`` lies on the floor at height 0, ``X,Y,Z,YAW`` on the floor of the storey at height Z,
    or in the air, in a world under the open sky.  Both are written for the world as its file says;
    in a mirrored world y and yaw are negated with it.

    Args:
        text: ROOM, X,Y,YAW or X,Y,Z,YAW.
        world: where the start must be free.
        radius: the robot's, metres; a start keeps at least this clearance.
        climbs: whether the robot can stand on another floor than the one at height 0.
        flies: whether it is an aircraft: under a roof it takes off from the ground floor, from
            which its altitudes are measured.

    Raises:
        TaskError: names the value and the remedy, for malformed text, an unknown room, a place
            outside the world, in a wall or in furniture, and a floor where it cannot stand.
    """
    x, y, floor, yaw = _parsed(text.strip(), world, radius)
    if floor != 0.0 and flies and not world.outdoors:
        raise TaskError(
            f"start: {text!r} is on the floor at height {floor:g}, and an aircraft takes off from "
            "the ground floor; choose a place there, or another robot (robot: !UnitreeGo1 "
            "{can_climb: true})."
        )
    if floor != 0.0 and not climbs:
        remedy = (
            "choose X,Y,YAW, or an aircraft (robot: !Quadrotor {})"
            if world.outdoors
            else "choose a room on the ground floor, or set robot.can_climb: true"
        )
        raise TaskError(
            f"start: {text!r} is above the ground floor, and this robot cannot climb; {remedy}."
        )
    return x, y, floor, yaw


def _parsed(text: str, world: World, radius: float) -> tuple[float, float, float, float]:
    if not text:
        raise TaskError(f"start: empty; give a room ({_rooms(world)}) or X,Y,YAW.")
    if "," not in text:
        return (*_free_point(text, world, radius), 0.0)
    if world.outdoors and text.count(",") == 3:
        return parse_air_start(text, world, radius=radius)
    x, y, z, yaw = _numbers(text, world)
    if world.mirrored:
        y, yaw = -y, -yaw
    floor = world.storey_at(z)
    if abs(floor - z) > OFF_FLOOR:
        heights = ", ".join(f"{height:g}" for height in world.elevations)
        raise TaskError(f"start: {text!r}: no floor lies at height {z:g}; give Z of {heights}.")
    _check_free(text, x, y, floor, world, radius)
    return x, y, floor, yaw


def _rooms(world: World) -> str:
    return ", ".join(sorted(room.name for room in world.rooms))


def _numbers(text: str, world: World) -> tuple[float, float, float, float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4) or not all(math.isfinite(number) for number in numbers):
        raise TaskError(
            f"start: {text!r} is not X,Y,YAW: three numbers (metres, metres, radians), "
            f"e.g. 2.0,8.0,-1.57; or give a room: {_rooms(world)}."
        )
    z = numbers[2] if len(numbers) == 4 else 0.0
    return numbers[0], numbers[1], z, numbers[-1]


def _free_point(name: str, world: World, radius: float) -> tuple[float, float, float]:
    room = world.room(name) or world.room(name.replace("_", " "))
    if room is None:
        names = {room.name for room in world.rooms} | {room.kind for room in world.rooms}
        raise TaskError(unknown_name("room", name, names, "start"))
    x, y, free = _roomiest(room, world)
    if free < radius:
        raise TaskError(
            f"start: {name!r} has no place for a robot of radius {radius:.2f} m; "
            "choose another room or X,Y,YAW."
        )
    return x, y, room.elevation


def _roomiest(room: Room, world: World) -> tuple[float, float, float]:
    points = room_grid(room, _step(room, world))
    distances = clearance(world, points, room.elevation)
    best = int(np.argmax(distances))
    return float(points[best, 0]), float(points[best, 1]), float(distances[best])


def _step(room: Room, world: World) -> float:
    """Spacing of the points in a room; in a district they lie farther apart."""
    x_min, y_min, x_max, y_max = room.rectangle
    return max(x_max - x_min, y_max - y_min) / POINTS_OUTDOORS if world.outdoors else GRID_STEP


def _check_free(text: str, x: float, y: float, floor: float, world: World, radius: float) -> None:
    room = world.room_at(x, y, floor)
    if room is None:
        raise TaskError(
            f"start: {text!r} is outside the world {world.name!r}; "
            f"give a room ({_rooms(world)}) or a point inside one."
        )
    name, distance = nearest_obstacle(world, x, y, floor)
    if distance >= radius:
        return
    where = f"inside {name}" if distance == 0.0 else f"only {distance:.2f} m from {name}"
    points = room_grid(room, _step(room, world))
    free = points[clearance(world, points, floor) >= radius]
    remedy = f"give a room: {_rooms(world)}"
    if len(free):
        near_x, near_y = free[np.argmin(np.hypot(free[:, 0] - x, free[:, 1] - y))]
        sign = -1.0 if world.mirrored else 1.0
        height = f",{floor:g}" if floor else ""
        place = f"{near_x:.2f},{sign * near_y:.2f}{height}"
        remedy = f"the nearest free place is {place}, or {remedy}"
    raise TaskError(f"start: {text!r} is {where} and the robot needs {radius:.2f} m; {remedy}.")
