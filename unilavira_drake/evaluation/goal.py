"""What a goal text means in a world: targets, each with the free floor from which it is reached.

Only scoring reads this; nothing of the agent does.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.errors import TaskError, unknown_name
from unilavira_drake.evaluation.free_space import centers, in_rooms
from unilavira_drake.messages import Message
from unilavira_drake.planning.geodesic import FreeSpace
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.world import World

REACH = 0.15
"""The footprint of a thing is the free floor not farther from it than the nearest free place plus
this much, metres."""
MAX_GAP = 1.0
"""A thing without free floor within this distance is no goal, metres."""


@dataclass(frozen=True)
class GoalTarget(Message):
    """One alternative of a goal."""

    text: str = ""
    kind: str = "room"
    """``instance``, ``room`` or ``point``."""
    rooms: tuple[str, ...] = ()
    """Names of the rooms in one of which the robot has to end."""
    label: int | None = None
    """Render label that has to be seen at the end; None when nothing has to be."""
    point: tuple[float, float] | None = None
    """Metres in the world, for a point."""
    height: float = 0.0
    """Of a point, metres; for flights."""
    elevation: float = 0.0
    """Height of the floor on which the robot has to end, metres."""

    def place(self, world: World) -> tuple[float, float]:
        """Returns the middle of the target on the floor, metres in the world."""
        if self.point is not None:
            return self.point
        thing = world.object(self.text)
        if thing is not None:
            centers = np.array([box.center[:2] for box in thing.boxes])
            x, y = centers.mean(axis=0)
            return float(x), float(y)
        room = world.room(self.rooms[0])
        assert room is not None
        return room.center


def resolve_goal(text: str, world: World) -> tuple[GoalTarget, ...]:
    """Returns the alternatives of ``INSTANCE``, ``ROOM`` or ``X,Y[,Z]``, joined by ``|``.

    Points are written for the world as its file says; in a mirrored world y is negated with it.

    Raises:
        TaskError: for an empty text, an unknown name or a point outside every room.
    """
    parts = [part.strip() for part in text.split("|")]
    if not all(parts):
        raise TaskError(
            f"goal: {text!r} has an empty part; give INSTANCE, ROOM or X,Y[,Z], "
            "alternatives joined by '|'."
        )
    return tuple(_resolve(part, world) for part in parts)


def footprint(target: GoalTarget, world: World, space: FreeSpace) -> NDArray[np.int64]:
    """Returns the (k, 2) cells of free floor at which the robot is at the target, k >= 1.

    Raises:
        TaskError: if no free floor is near.
    """
    inside = in_rooms(space, world, target.rooms, target.elevation)
    cells = np.argwhere(space.free & inside)
    points = centers(space, cells)
    gaps = _gaps(target, world, points)
    nearest = float(gaps.min(initial=math.inf))
    if nearest > MAX_GAP:
        raise TaskError(
            f"goal: {target.text!r} has no floor within {MAX_GAP:.1f} m on which the robot can "
            "stand; choose another instance, a room or a point on free floor."
        )
    if target.kind == "point":
        chosen: NDArray[np.int64] = cells[[int(np.argmin(gaps))]]
        return chosen
    reached: NDArray[np.int64] = cells[gaps <= nearest + REACH]
    return reached


def _resolve(text: str, world: World) -> GoalTarget:
    thing = world.object(text)
    if thing is not None:
        rooms = tuple(thing.room.split("|"))
        elevation = min(room.elevation for room in world.rooms if room.name in rooms)
        return GoalTarget(text, "instance", rooms, world.label_of(text), elevation=elevation)
    room = world.room(text) or world.room(text.replace("_", " "))
    if room is not None:
        return GoalTarget(text, "room", (room.name,), elevation=room.elevation)
    if "," in text:
        return _point(text, world)
    names = {thing.name for thing in world.objects}
    names |= {name for room in world.rooms for name in (room.name, room.kind) if name}
    raise TaskError(unknown_name("instance or room", text, names, "goal"))


def _point(text: str, world: World) -> GoalTarget:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(math.isfinite(number) for number in numbers):
        raise TaskError(f"goal: {text!r} is not X,Y[,Z]: two or three numbers in metres.")
    x, y = numbers[0], -numbers[1] if world.mirrored else numbers[1]
    room = world.room_at(x, y, numbers[2] if len(numbers) == 3 else 0.0)
    if room is None:
        raise TaskError(
            f"goal: {text!r} is outside the world {world.name!r}; give a point inside a room: "
            f"{', '.join(sorted(room.name for room in world.rooms))}."
        )
    return GoalTarget(
        text,
        "point",
        (room.name,),
        point=(x, y),
        height=(*numbers, 0.0)[2],
        elevation=room.elevation,
    )


def _gaps(target: GoalTarget, world: World, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances on the floor between points and a target, at whatever height it hangs."""
    thing = world.object(target.text)
    if target.point is not None:
        gaps: NDArray[np.float64] = np.hypot(*(points - np.array(target.point)).T)
        return gaps
    if thing is None:
        return np.zeros(len(points))
    grounded = tuple(
        dataclasses.replace(box, center=(*box.center[:2], 0.5), size=(*box.size[:2], 1.0))
        for box in thing.boxes
    )
    solid = dataclasses.replace(thing, boxes=grounded, solid=True)
    return clearance(World(objects=(solid,)), points)
