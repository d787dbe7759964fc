"""The schema of a world file, ``models/worlds/NAME.yaml``."""

import dataclasses as dc

from unilavira_drake.worlds.outdoors.entries import BuildingEntry, GroundEntry, RowEntry


@dc.dataclass
class RoomEntry:
    """A rectangular room."""

    name: str = ""
    kind: str = ""
    # x_min, y_min, x_max, y_max between the walls' centre lines, metres.
    rectangle: list[float] = dc.field(default_factory=list)
    # Red, green, blue in [0, 1]; of a floor without a material.
    floor_color: list[float] = dc.field(default_factory=lambda: [0.7, 0.7, 0.7])
    # Materials, see worlds/materials.py: all rooms of a world have both, or none has.
    floor: str = ""
    walls: str = ""
    # Name of its storey; empty: the one at height 0.
    storey: str = ""


@dc.dataclass
class StoreyEntry:
    """A storey above or below the one at height 0."""

    name: str = ""
    # Height of its floor, metres.
    elevation: float = 0.0


@dc.dataclass
class StairsEntry:
    """A straight flight of stairs, with or without a level landing halfway."""

    name: str = ""
    # The room where it begins and the room above to which it leads.
    rooms: list[str] = dc.field(default_factory=list)
    # x_min, y_min, x_max, y_max of the flight, metres; the floor above is open there.
    rectangle: list[float] = dc.field(default_factory=list)
    # north, east, south or west: where the way up leads.
    direction: str = ""
    # Risers; the last tread is level with the floor above.
    steps: int = 15
    # Length of a landing halfway, metres; 0: none.
    landing: float = 0.0
    # Material of the treads, see worlds/materials.py.
    material: str = "oak"
    # Colour words of the risers and of the railings.
    color: str = "white"
    railing_color: str = "brown"


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
    # Whether the wall is missing there, up to the ceiling and without a frame: then it is no
    # thing that anyone sees.
    open: bool = False


@dc.dataclass
class ObjectEntry:
    """A piece of furniture: a model of the library, or boxes by its category."""

    name: str = ""
    # A model of the furniture library; without one the category says what is built of boxes.
    model: str = ""
    # Of a model its own when empty.
    category: str = ""
    # Colour word; a model keeps its own colours when empty.
    color: str = ""
    room: str = ""
    # Middle of the footprint, metres; one number along the wall of a model that stands at one.
    position: list[float] = dc.field(default_factory=list)
    # north, south, east or west: the wall of the room to which a model turns its back.
    wall: str = ""
    # At 0 the front looks along +x, or away from the wall.
    yaw_degrees: float = 0.0
    # Height of the surface it stands on, metres ...
    height: float = 0.0
    # ... or the name of the piece, listed before, on which it stands.
    stands_on: str = ""


@dc.dataclass
class PanelEntry:
    """Something flat: on the nearest wall of its room, or a rug on the floor."""

    name: str = ""
    # window, picture, mirror, whiteboard, sign or rug.
    category: str = ""
    # Colour word that fits what is drawn.
    color: str = ""
    room: str = ""
    # Middle on the floor plan, metres.
    position: list[float] = dc.field(default_factory=list)
    # Width and height (of a rug: along x and y), metres.
    size: list[float] = dc.field(default_factory=list)
    # Lower edge above the floor, metres.
    height: float = 0.9
    # What a sign says.
    text: str = ""


@dc.dataclass
class WorldFile:
    """A world: metres, x to the east, y to the north, z up."""

    name: str = ""
    wall_height: float = 2.6
    wall_thickness: float = 0.1
    # Red, green, blue in [0, 1].
    wall_color: list[float] = dc.field(default_factory=lambda: [0.9, 0.9, 0.9])
    storeys: list[StoreyEntry] = dc.field(default_factory=list)
    rooms: list[RoomEntry] = dc.field(default_factory=list)
    stairs: list[StairsEntry] = dc.field(default_factory=list)
    doors: list[DoorEntry] = dc.field(default_factory=list)
    objects: list[ObjectEntry] = dc.field(default_factory=list)
    panels: list[PanelEntry] = dc.field(default_factory=list)
    # Under the open sky: rooms are districts, floors are of outdoors/materials.py, and there are
    # neither walls nor ceilings.
    outdoors: bool = False
    # Width of the meadow around the districts, metres.
    surroundings: float = 0.0
    ground: list[GroundEntry] = dc.field(default_factory=list)
    buildings: list[BuildingEntry] = dc.field(default_factory=list)
    rows: list[RowEntry] = dc.field(default_factory=list)
