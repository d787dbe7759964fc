"""The schema of a world file, ``models/worlds/NAME.yaml``."""

import dataclasses as dc


@dc.dataclass
class RoomEntry:
    """A rectangular room."""

    name: str = ""
    kind: str = ""
    # x_min, y_min, x_max, y_max between the walls' centre lines, metres.
    rectangle: list[float] = dc.field(default_factory=list)
    # Red, green, blue in [0, 1].
    floor_color: list[float] = dc.field(default_factory=lambda: [0.7, 0.7, 0.7])


@dc.dataclass
class DoorEntry:
    """A doorway in the wall between two rooms."""

    name: str = ""
    rooms: list[str] = dc.field(default_factory=list)
    # Middle of the opening, on the wall's centre line, metres.
    position: list[float] = dc.field(default_factory=list)
    # Clear width between the jambs, metres.
    width: float = 1.0
    # Colour word of the frame.
    color: str = "cyan"


@dc.dataclass
class ObjectEntry:
    """A piece of furniture."""

    name: str = ""
    category: str = ""
    # Colour word.
    color: str = ""
    room: str = ""
    # Middle of the footprint, metres.
    position: list[float] = dc.field(default_factory=list)
    # At 0 the front looks along +x.
    yaw_degrees: float = 0.0
    # Height of the surface it stands on, metres.
    height: float = 0.0


@dc.dataclass
class WorldFile:
    """A world: metres, x to the east, y to the north, z up."""

    name: str = ""
    wall_height: float = 2.6
    wall_thickness: float = 0.1
    # Red, green, blue in [0, 1].
    wall_color: list[float] = dc.field(default_factory=lambda: [0.9, 0.9, 0.9])
    rooms: list[RoomEntry] = dc.field(default_factory=list)
    doors: list[DoorEntry] = dc.field(default_factory=list)
    objects: list[ObjectEntry] = dc.field(default_factory=list)
