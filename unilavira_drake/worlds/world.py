"""What a world is, once its file is read: rooms, doors, walls and labelled things."""

from __future__ import annotations

import dataclasses as dc
import math
from dataclasses import dataclass, field

from unilavira_drake.messages import Message
from unilavira_drake.worlds.outdoors.things import Building, Exterior, GroundPatch
from unilavira_drake.worlds.stairs import Stairs

JAMB_WIDTH = 0.09
"""Metres; jambs stand outside the clear width of a doorway."""

BELOW_FLOOR = 0.5
"""Who is no farther below a floor than this, on the last steps, is on its storey, metres."""


@dataclass(frozen=True)
class Box(Message):
    """A solid box in the world, turned about the vertical."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Metres."""
    size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Edge lengths, metres."""
    yaw: float = 0.0
    """Radians."""

    def lowered(self, elevation: float) -> Box:
        """Returns the box as seen from a floor at a height, metres."""
        x, y, z = self.center
        return self if elevation == 0.0 else dc.replace(self, center=(x, y, z - elevation))

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
class Doorway(Message):
    """An opening in a wall."""

    x: float = 0.0
    y: float = 0.0
    width: float = 1.0
    """Clear width, metres."""
    along_x: bool = True
    """Whether the wall runs along x."""
    open: bool = False
    """Whether the wall is missing up to the ceiling; else there is a frame and a lintel."""
    elevation: float = 0.0
    """Height of the floor, metres."""

    @property
    def gap(self) -> float:
        """Half of what is missing from the wall, metres."""
        return self.width / 2 + (0.0 if self.open else JAMB_WIDTH)


@dataclass(frozen=True)
class Placement(Message):
    """A model of the furniture library and where it stands."""

    model: str = ""
    color: str = ""
    """Colour word of its main material; empty keeps the model's own."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Metres; of the middle of its footprint."""
    yaw: float = 0.0
    """Radians; at 0 the front looks along +x."""


@dataclass(frozen=True)
class Panel(Message):
    """A flat thing with a picture on it: a window, a painting, a sign, a rug."""

    pattern: str = "picture"
    color: str = ""
    """Colour word of what is drawn."""
    box: Box = Box()
    """Thin along the direction that it faces."""
    facing: float | None = None
    """Yaw of the side that shows the picture, radians; None faces up."""
    seed: int = 0
    text: str = ""
    """The words of a sign."""


@dataclass(frozen=True)
class Room(Message):
    """A rectangular room."""

    name: str = ""
    kind: str = ""
    rectangle: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    """(x_min, y_min, x_max, y_max) between the walls' centre lines, metres."""
    floor_color: tuple[float, float, float] = (0.7, 0.7, 0.7)
    """Red, green, blue of the floor, each in [0, 1]."""
    floor: str = ""
    """Material of the floor; empty where the world is flat-shaded."""
    walls: str = ""
    """Material of the walls."""
    elevation: float = 0.0
    """Height of the floor, metres."""

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
    """A labelled thing: furniture, a panel, or a door frame (category ``door``)."""

    name: str = ""
    category: str = ""
    color: str = ""
    """Colour word."""
    room: str = ""
    """Name of the room; for a door the two names joined by ``|``."""
    boxes: tuple[Box, ...] = ()
    """Collision geometry in the world; visible, too, where there is no ``visual``."""
    visual: Placement | Panel | Building | Exterior | None = None
    solid: bool = True
    """Whether a robot collides with it."""


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
    doorways: tuple[Doorway, ...] = ()
    stairs: tuple[Stairs, ...] = ()
    labels: dict[int, LabelEntry] = field(default_factory=dict)
    """Render label -> meaning; every labelled geometry has an entry."""
    wall_height: float = 2.6
    """Metres; the ceiling lies there."""
    wall_color: tuple[float, float, float] = (0.9, 0.9, 0.9)
    """Red, green, blue of walls and ceiling, each in [0, 1]; of a world without materials."""
    wall_thickness: float = 0.1
    """Metres."""
    mirrored: bool = False
    """Whether y was negated when the world was read; starts and goals given as numbers follow."""
    outdoors: bool = False
    """Whether it lies under the open sky: rooms are districts, without walls and ceilings."""
    ground: tuple[GroundPatch, ...] = ()
    """What lies on the ground, of a world outdoors; later ones over earlier ones."""

    @property
    def textured(self) -> bool:
        """Whether floors and walls have materials."""
        return any(room.floor for room in self.rooms)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of all rooms, metres."""
        rectangles = [room.rectangle for room in self.rooms]
        x_min, y_min = (min(rectangle[i] for rectangle in rectangles) for i in (0, 1))
        x_max, y_max = (max(rectangle[i] for rectangle in rectangles) for i in (2, 3))
        return x_min, y_min, x_max, y_max

    @property
    def elevations(self) -> tuple[float, ...]:
        """Heights of the floors of all storeys, from the lowest up, metres."""
        return tuple(sorted({room.elevation for room in self.rooms}))

    def storey_at(self, z: float) -> float:
        """Returns the height of the floor of the storey on which something at a height is."""
        below = [height for height in self.elevations if height <= z + BELOW_FLOOR]
        return below[-1] if below else self.elevations[0]

    def room_at(self, x: float, y: float, z: float = 0.0) -> Room | None:
        """Returns the room that holds a point of the floor at a height, or None outside."""
        if not self.rooms:
            return None
        floor = self.storey_at(z)
        rooms = (room for room in self.rooms if room.elevation == floor)
        return next((room for room in rooms if room.contains(x, y)), None)

    def storey(self, z: float) -> World:
        """Returns the storey at a height alone, with its floor at height 0; labels stay."""
        floor = self.storey_at(z)
        if len(self.elevations) == 1:
            return self
        rooms = tuple(dc.replace(r, elevation=0.0) for r in self.rooms if r.elevation == floor)
        things = tuple(
            dc.replace(thing, boxes=tuple(box.lowered(floor) for box in thing.boxes))
            for thing in self.objects
            if any(self.stands_on(box, floor) for box in thing.boxes)
        )
        walls = (box.lowered(floor) for box in self.walls if self.stands_on(box, floor))
        doors = (door for door in self.doorways if door.elevation == floor)
        return dc.replace(
            self,
            rooms=rooms,
            objects=things,
            walls=tuple(walls),
            doorways=tuple(dc.replace(door, elevation=0.0) for door in doors),
            stairs=(),
        )

    def stands_on(self, box: Box, floor: float) -> bool:
        """Whether a box begins between a storey's floor and the next one."""
        bottom = box.center[2] - box.size[2] / 2
        below = [height for height in self.elevations if height <= bottom + 1e-6]
        return (below[-1] if below else self.elevations[0]) == floor

    def ground_height(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the height at which a robot stands there: on a floor, or on stairs.

        Args:
            x: metres.
            y: metres.
            z: about the height where it is; the nearest ground to it counts.
        """
        flights = [flight for flight in self.stairs if flight.contains(x, y)]
        ground = [flight.height(x, y) for flight in flights]
        taken = {height for flight in flights for height in (flight.bottom, flight.top)}
        ground += [height for height in self.elevations if height not in taken]
        return min(ground, key=lambda height: (abs(height - z), height))

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
