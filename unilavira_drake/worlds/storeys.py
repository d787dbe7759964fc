"""Several storeys in a world file: heights of floors, walls of each storey, stairs between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.worlds.materials import FLOORS
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.schema import StairsEntry, WorldFile
from unilavira_drake.worlds.stairs import HEADINGS, Stairs
from unilavira_drake.worlds.stairwell import railing_boxes, step_boxes
from unilavira_drake.worlds.structure import walls
from unilavira_drake.worlds.world import Box, Doorway, Room, WorldObject

THINNEST = 0.1
"""Thickness of a slab between two storeys at least, metres."""
RISERS = (0.10, 0.22)
"""Lowest and highest riser, metres."""
TREADS = (0.20, 0.60)
"""Shortest and deepest tread, metres."""
NARROWEST = 0.8
"""Width of a flight at least, metres."""


def storey_elevations(entries: WorldFile, place: str) -> Mapping[str, float]:
    """Returns the height of the floor of each storey by name; the empty name is the one at 0.

    Raises:
        ScenarioError: if two have one name, or stand in each other.
    """
    elevations = {"": 0.0}
    for entry in entries.storeys:
        here = f"{place}: storeys: {entry.name!r}"
        if entry.name in elevations:
            raise ScenarioError(f"{here}: the name is empty or used twice; name each storey.")
        apart = min(abs(entry.elevation - other) for other in elevations.values())
        if not (math.isfinite(entry.elevation) and apart >= entries.wall_height + THINNEST):
            raise ScenarioError(
                f"{here}: elevation: {entry.elevation} leaves less than wall_height and "
                f"{THINNEST} m to another storey; give at least "
                f"{entries.wall_height + THINNEST:.1f}."
            )
        elevations[entry.name] = entry.elevation
    return elevations


def storey_walls(
    rooms: Sequence[Room], doorways: Sequence[Doorway], height: float, thickness: float
) -> tuple[Box, ...]:
    """Returns the walls of all storeys, the lowest first; each up to its own ceiling."""
    boxes: list[Box] = []
    for elevation in sorted({room.elevation for room in rooms}):
        here = [room for room in rooms if room.elevation == elevation]
        openings = [opening for opening in doorways if opening.elevation == elevation]
        boxes += (box.lowered(-elevation) for box in walls(here, openings, height, thickness))
    return tuple(boxes)


def make_stairs(
    entry: StairsEntry, rooms: Mapping[str, Room], entries: WorldFile, place: str
) -> Stairs:
    """Returns the flight of an entry.

    Raises:
        ScenarioError: names the place in the file, the value and the remedy.
    """
    place = f"{place}: stairs: {entry.name!r}"
    for key, value, valid in (
        ("direction", entry.direction, HEADINGS),
        ("material", entry.material, FLOORS),
        ("color", entry.color, PALETTE),
        ("railing_color", entry.railing_color, PALETTE),
    ):
        if value not in valid:
            raise ScenarioError(unknown_name(key, value, valid, f"{place}: {key}"))
    if len(entry.rooms) != 2:
        raise ScenarioError(f"{place}: rooms: {entry.rooms}; name the room below and above.")
    for name in entry.rooms:
        if name not in rooms:
            raise ScenarioError(unknown_name("room", name, rooms, place))
    below, above = (rooms[name] for name in entry.rooms)
    numbers = entry.rectangle
    if len(numbers) != 4 or not all(map(math.isfinite, (*numbers, entry.landing))):
        raise ScenarioError(f"{place}: rectangle: {numbers}; expected 4 numbers.")
    stairs = Stairs(
        name=entry.name,
        rooms=(below.name, above.name),
        rectangle=(numbers[0], numbers[1], numbers[2], numbers[3]),
        heading=HEADINGS[entry.direction],
        bottom=below.elevation,
        top=above.elevation,
        steps=entry.steps,
        landing=entry.landing,
        material=entry.material,
        color=entry.color,
    )
    _check(stairs, (below, above), place)
    return stairs


def _check(stairs: Stairs, rooms: Iterable[Room], place: str) -> None:
    if stairs.top <= stairs.bottom:
        raise ScenarioError(f"{place}: rooms: the second one must be on the storey above.")
    for room in rooms:
        x_min, y_min, x_max, y_max = room.rectangle
        a, b, c, d = stairs.rectangle
        if not (x_min <= a < c <= x_max and y_min <= b < d <= y_max):
            raise ScenarioError(
                f"{place}: rectangle: {stairs.rectangle} is not inside room {room.name!r} "
                f"{room.rectangle}."
            )
    riser = (stairs.top - stairs.bottom) / max(stairs.steps, 1)
    for key, value, (low, high) in (
        ("riser", riser, RISERS),
        ("tread", stairs.tread if stairs.steps else 0.0, TREADS),
        ("width", stairs.width, (NARROWEST, 20.0)),
        ("landing", stairs.landing or 1.0, (0.6, 20.0)),
    ):
        if not low <= value <= high:
            raise ScenarioError(
                f"{place}: its {key} comes to {value:.2f} m; change rectangle, steps or landing "
                f"so that it lies between {low} and {high} m."
            )


def stair_objects(
    entries: Sequence[StairsEntry],
    stairs: Sequence[Stairs],
    rooms: Mapping[str, Room],
    thickness: float,
) -> tuple[WorldObject, ...]:
    """Returns steps and railings as things that are seen and bumped into."""
    things = []
    for entry, flight in zip(entries, stairs, strict=True):
        below, above = (rooms[name] for name in flight.rooms)
        room = "|".join(flight.rooms)
        things.append(WorldObject(flight.name, "stairs", flight.color, room, step_boxes(flight)))
        rails = railing_boxes(flight, below, above, thickness)
        if rails:
            name = f"{flight.name}_railing"
            things.append(WorldObject(name, "railing", entry.railing_color, room, rails))
    return tuple(things)
