"""What a world file may hold of the outdoors, beside rooms, which there are districts."""

import dataclasses as dc


@dc.dataclass
class GroundEntry:
    """A part of the ground; later ones lie over earlier ones, and all over the districts."""

    name: str = ""
    # What a person calls it: road, pavement, pond, lawn, car park, ...
    category: str = ""
    # Of outdoors/materials.py.
    material: str = ""
    # x_min, y_min, x_max, y_max, metres.
    rectangle: list[float] = dc.field(default_factory=list)
    # What is painted on it: lane, crossing_x (walked along x), crossing_y, parking or pitch.
    marking: str = ""
    # Whether it is the ellipse in the rectangle. Nothing may lie over it.
    round: bool = False


@dc.dataclass
class BuildingEntry:
    """A building; at yaw 0 its front, with the door, looks along +x."""

    name: str = ""
    # What a person calls it: house, church, school, ...
    category: str = "house"
    # Middle of the footprint, metres.
    position: list[float] = dc.field(default_factory=list)
    yaw_degrees: float = 0.0
    # Depth (along its front's direction) and width, metres.
    size: list[float] = dc.field(default_factory=list)
    # Of the walls, metres.
    height: float = 6.2
    # Of outdoors/materials.py.
    facade: str = "white_plaster"
    # flat, gable (ridge across the front's direction), nave (ridge along it) or pyramid.
    roof: str = "gable"
    # A colour word.
    roof_color: str = "red"
    # Above the walls, metres; of a flat roof nothing.
    roof_height: float = 2.5
    # plain, arched (one storey of them, as in a church) or none (and large gates).
    windows: str = "plain"
    # Whether the ground floor has shop windows.
    shop: bool = False
    chimneys: int = 0
    # What stands in large letters over the front.
    sign: str = ""
    # Side and height of a tower with a pyramid on it, in the middle of the front, metres.
    tower: list[float] = dc.field(default_factory=list)


@dc.dataclass
class RowEntry:
    """Several of the same shape in a line: one thing with one name."""

    name: str = ""
    # Of outdoors/shapes.py.
    category: str = ""
    # Colour word; the shape's own when empty.
    color: str = ""
    # Middles of the first and the last one, metres.
    start: list[float] = dc.field(default_factory=list)
    end: list[float] = dc.field(default_factory=list)
    count: int = 2
    yaw_degrees: float = 0.0
