"""What a world is, once its file is read: rooms, doors, walls and labelled things."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from unilavira_drake.messages import Message


@dataclass(frozen=True)
class Box(Message):
    """A solid box in the world, turned about the vertical."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Metres."""
    size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Edge lengths, metres."""
    yaw: float = 0.0
    """Radians."""

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Returns the four corners of the footprint, counter-clockwise, metres."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        half_x, half_y = self.size[0] / 2, self.size[1] / 2
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        return tuple(
            (
                self.center[0] + c * a * half_x - s * b * half_y,
                self.center[1] + s * a * half_x + c * b * half_y,
            )
            for a, b in signs
        )


@dataclass(frozen=True)
class Room(Message):
    """A rectangular room."""

    name: str = ""
    kind: str = ""
    rectangle: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    """(x_min, y_min, x_max, y_max) between the walls' centre lines, metres."""
    floor_color: tuple[float, float, float] = (0.7, 0.7, 0.7)
    """Red, green, blue of the floor, each in [0, 1]."""

    def contains(self, x: float, y: float) -> bool:
        """Whether a point of the floor lies in this room."""
        x_min, y_min, x_max, y_max = self.rectangle
        return x_min <= x < x_max and y_min <= y < y_max

    @property
    def center(self) -> tuple[float, float]:
        """Middle of the rectangle, metres."""
        x_min, y_min, x_max, y_max = self.rectangle
        return ((x_min + x_max) / 2, (y_min + y_max) / 2)


@dataclass(frozen=True)
class WorldObject(Message):
    """A labelled thing: furniture or a door frame (category ``door``)."""

    name: str = ""
    category: str = ""
    color: str = ""
    """Colour word."""
    room: str = ""
    """Name of the room; for a door the two names joined by ``|``."""
    boxes: tuple[Box, ...] = ()
    """Visible geometry and collision geometry, in the world."""


@dataclass(frozen=True)
class LabelEntry(Message):
    """What a render label means."""

    category: str = ""
    instance: str = ""
    room_kind: str = ""
    """Kind of room, for floors only."""


@dataclass(frozen=True)
class World(Message):
    """A world: everything scoring and rendering need, nothing the agent may see."""

    name: str = ""
    rooms: tuple[Room, ...] = ()
    objects: tuple[WorldObject, ...] = ()
    walls: tuple[Box, ...] = ()
    labels: dict[int, LabelEntry] = field(default_factory=dict)
    """Render label -> meaning; every labelled geometry has an entry."""
    wall_height: float = 2.6
    """Metres; the ceiling lies there."""
    wall_color: tuple[float, float, float] = (0.9, 0.9, 0.9)
    """Red, green, blue of walls and ceiling, each in [0, 1]."""
    mirrored: bool = False
    """Whether y was negated when the world was read; starts and goals given as numbers follow."""

    def room_at(self, x: float, y: float) -> Room | None:
        """Returns the room that holds a point of the floor, or None outside."""
        return next((room for room in self.rooms if room.contains(x, y)), None)

    def room(self, name: str) -> Room | None:
        """Returns the room with this name or kind, or None."""
        for room in self.rooms:
            if name in (room.name, room.kind):
                return room
        return None

    def object(self, name: str) -> WorldObject | None:
        """Returns the thing with this instance name, or None."""
        return next((thing for thing in self.objects if thing.name == name), None)

    def label_of(self, instance: str) -> int | None:
        """Returns the render label of an instance, or None."""
        return next((k for k, entry in self.labels.items() if entry.instance == instance), None)
