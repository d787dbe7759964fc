"""Makes the things of a world under the open sky of the entries of its file."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.worlds.outdoors.buildings import ROOF_FORMS, WINDOWS, building_boxes
from unilavira_drake.worlds.outdoors.entries import BuildingEntry, GroundEntry, RowEntry
from unilavira_drake.worlds.outdoors.ground import overlapping
from unilavira_drake.worlds.outdoors.ground_picture import MARKINGS
from unilavira_drake.worlds.outdoors.materials import FACADES, GROUND, ROOFS
from unilavira_drake.worlds.outdoors.shapes import SHAPES, shape_boxes
from unilavira_drake.worlds.outdoors.things import Building, Exterior, GroundPatch, Place
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import LabelEntry, Room, WorldObject

if TYPE_CHECKING:
    from unilavira_drake.worlds.schema import WorldFile

Named = GroundEntry | BuildingEntry | RowEntry

SURROUNDINGS = "surroundings"
"""Name of the meadow around the districts."""
_MOST_IN_ROW = 200
_LONGEST_SIGN = 16
"""Letters."""


def named(entries: WorldFile) -> tuple[Named, ...]:
    """Returns what a world outdoors has beside districts and objects."""
    return (*entries.ground, *entries.buildings, *entries.rows)


def check(entries: WorldFile, place: str) -> None:
    """Refuses what only rooms can have.

    Raises:
        ScenarioError: names the place in the file and the remedy.
    """
    for key in ("doors", "panels"):
        if getattr(entries, key):
            raise ScenarioError(f"{place}: {key}: a world outdoors has none; remove them.")
    for room in entries.rooms:
        if room.walls or not room.floor:
            raise ScenarioError(
                f"{place}: rooms: {room.name!r}: a district has a floor ({', '.join(GROUND)}) and "
                "no walls."
            )
    if not 0.0 <= entries.surroundings <= 1000.0:
        raise ScenarioError(f"{place}: surroundings: {entries.surroundings}; give 0 to 1000 m.")


def ground(entries: WorldFile, place: str) -> tuple[GroundPatch, ...]:
    """Returns the ground: districts first, what lies on them next, and the meadow around."""
    patches = [
        GroundPatch(room.name, "floor", room.floor, _four(room.rectangle, place))
        for room in entries.rooms
    ]
    x0, y0, x1, y1 = (
        pick(patch.rectangle[i] for patch in patches)
        for i, pick in ((0, min), (1, min), (2, max), (3, max))
    )
    for entry in entries.ground:
        patches.append(_patch(entry, (x0, y0, x1, y1), f"{place}: ground: {entry.name!r}"))
    trouble = overlapping(patches)
    if trouble:
        raise ScenarioError(
            f"{place}: ground: {trouble[0]!r} is round and must lie on one thing, with nothing "
            f"over it, but meets the border of {trouble[1]!r}; move one."
        )
    if entries.surroundings:
        wide = entries.surroundings
        around = (x0 - wide, y0 - wide, x1 + wide, y1 + wide)
        patches.insert(0, GroundPatch(SURROUNDINGS, "meadow", "grass", around))
    return tuple(patches)


def buildings(entries: WorldFile, rooms: tuple[Room, ...], place: str) -> tuple[WorldObject, ...]:
    """Returns the buildings."""
    found = []
    for entry in entries.buildings:
        here = f"{place}: buildings: {entry.name!r}"
        building = _building(entry, here)
        found.append(
            WorldObject(
                name=entry.name,
                category=entry.category,
                color=FACADES[entry.facade].word,
                room=_district(building.place[:2], rooms, here),
                boxes=building_boxes(building),
                visual=building,
            )
        )
    return tuple(found)


def rows(entries: WorldFile, rooms: tuple[Room, ...], place: str) -> tuple[WorldObject, ...]:
    """Returns the rows, each as one thing."""
    found = []
    for entry in entries.rows:
        here = f"{place}: rows: {entry.name!r}"
        start, end = (_two(getattr(entry, key), f"{here}: {key}") for key in ("start", "end"))
        if not 2 <= entry.count <= _MOST_IN_ROW:
            raise ScenarioError(f"{here}: count: {entry.count}; give 2 to {_MOST_IN_ROW}.")
        yaw = math.radians(entry.yaw_degrees)
        shares = np.linspace(0.0, 1.0, entry.count)
        places = tuple(
            (
                float(start[0] + s * (end[0] - start[0])),
                float(start[1] + s * (end[1] - start[1])),
                0.0,
                yaw,
            )
            for s in shares
        )
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        district = _district(middle, rooms, here)
        found.append(_shape(entry.name, entry.category, entry.color, district, places, here))
    return tuple(found)


def shapes(entries: WorldFile, rooms: Mapping[str, Room], place: str) -> tuple[WorldObject, ...]:
    """Returns the objects that are no models of the library."""
    found = []
    for entry in entries.objects:
        if entry.model:
            continue
        here = f"{place}: objects: {entry.name!r}"
        if entry.room not in rooms:
            raise ScenarioError(unknown_name("district", entry.room, rooms, f"{here}: room"))
        x, y = _two(entry.position, f"{here}: position")
        spot = (x, y, entry.height, math.radians(entry.yaw_degrees))
        found.append(_shape(entry.name, entry.category, entry.color, entry.room, (spot,), here))
    return tuple(found)


def labels(
    things: Iterable[WorldObject], rooms: tuple[Room, ...], patches: tuple[GroundPatch, ...]
) -> dict[int, LabelEntry]:
    """Returns render label -> meaning; a district's ground is a floor."""
    kinds = {room.name: room.kind for room in rooms}
    entries = [LabelEntry(category=thing.category, instance=thing.name) for thing in things]
    entries += [
        LabelEntry("floor", f"{patch.name}_floor", kinds[patch.name])
        if patch.name in kinds
        else LabelEntry(patch.category, patch.name)
        for patch in patches
    ]
    return dict(enumerate(entries, start=1))


def check_inside(thing: WorldObject, rooms: tuple[Room, ...], place: str) -> None:
    """Refuses what stands partly outside the world."""
    for box in thing.boxes:
        for corner in box.corners():
            if not any(room.contains(*corner) for room in rooms):
                raise ScenarioError(
                    f"{place}: {thing.name!r}: not wholly inside the districts; move it."
                )


def _patch(
    entry: GroundEntry, bounds: tuple[float, float, float, float], place: str
) -> GroundPatch:
    if entry.material not in GROUND:
        raise ScenarioError(unknown_name("material", entry.material, GROUND, f"{place}: material"))
    if entry.marking and entry.marking not in MARKINGS:
        raise ScenarioError(unknown_name("marking", entry.marking, MARKINGS, f"{place}: marking"))
    if not entry.category:
        raise ScenarioError(f"{place}: category: empty; say what a person calls it.")
    x0, y0, x1, y1 = _four(entry.rectangle, place)
    if x0 < bounds[0] or y0 < bounds[1] or x1 > bounds[2] or y1 > bounds[3]:
        raise ScenarioError(f"{place}: rectangle: {entry.rectangle} is not inside the districts.")
    return GroundPatch(
        entry.name, entry.category, entry.material, (x0, y0, x1, y1), entry.marking, entry.round
    )


def _building(entry: BuildingEntry, place: str) -> Building:
    for key, value, valid in (
        ("facade", entry.facade, tuple(FACADES)),
        ("roof", entry.roof, ROOF_FORMS),
        ("windows", entry.windows, WINDOWS),
        ("roof_color", entry.roof_color, tuple(ROOFS)),
    ):
        if value not in valid:
            raise ScenarioError(unknown_name(key, value, valid, f"{place}: {key}"))
    x, y = _two(entry.position, f"{place}: position")
    depth, width = _two(entry.size, f"{place}: size")
    if not (min(depth, width) >= 2.0 and max(depth, width) <= 120.0 and 2.0 <= entry.height <= 120):
        raise ScenarioError(f"{place}: size: {entry.size}, height {entry.height}; give 2 to 120 m.")
    if not 0.5 <= entry.roof_height <= 30.0 or not 0 <= entry.chimneys <= 4:
        raise ScenarioError(f"{place}: roof_height must be 0.5 to 30 m, chimneys 0 to 4.")
    if len(entry.sign) > _LONGEST_SIGN:
        raise ScenarioError(f"{place}: sign: {entry.sign!r}; at most {_LONGEST_SIGN} letters.")
    tower = None
    if entry.tower:
        side, height = _two(entry.tower, f"{place}: tower")
        if not 2.0 <= side <= 20.0 or not entry.height < height <= 80.0:
            raise ScenarioError(f"{place}: tower: {entry.tower}; 2 to 20 m wide, above the walls.")
        tower = (side, height)
    return Building(
        place=(x, y, 0.0, math.radians(entry.yaw_degrees)),
        size=(depth, width),
        height=entry.height,
        facade=entry.facade,
        roof=entry.roof,
        roof_color=entry.roof_color,
        roof_height=entry.roof_height,
        windows=entry.windows,
        shop=entry.shop,
        chimneys=entry.chimneys,
        sign=entry.sign,
        tower=tower,
        # Few different pictures: those that are the same are kept once.
        seed=zlib.crc32(entry.name.encode()) % 12,
    )


def _shape(
    name: str, category: str, color: str, district: str, places: tuple[Place, ...], here: str
) -> WorldObject:
    if category not in SHAPES:
        raise ScenarioError(unknown_name("category", category, SHAPES, f"{here}: category"))
    shape = SHAPES[category]
    if color and color not in PALETTE:
        raise ScenarioError(unknown_name("color", color, PALETTE, f"{here}: color"))
    if color and not shape.painted:
        raise ScenarioError(f"{here}: color: a {category} is {shape.color}; leave it out.")
    visual = Exterior(category, color or shape.color, places, zlib.crc32(name.encode()))
    return WorldObject(
        name=name,
        category=category,
        color=color or shape.color,
        room=district,
        boxes=tuple(box for spot in places for box in shape_boxes(category, spot)),
        visual=visual,
    )


def _district(middle: tuple[float, ...], rooms: tuple[Room, ...], place: str) -> str:
    for room in rooms:
        if room.contains(middle[0], middle[1]):
            return room.name
    raise ScenarioError(f"{place}: its middle {middle} is in no district; move it.")


def _two(values: list[float], place: str) -> tuple[float, float]:
    if len(values) != 2 or not all(math.isfinite(value) for value in values):
        raise ScenarioError(f"{place}: {values}; expected 2 numbers.")
    return values[0], values[1]


def _four(values: list[float], place: str) -> tuple[float, float, float, float]:
    if len(values) != 4 or not all(math.isfinite(value) for value in values):
        raise ScenarioError(f"{place}: rectangle: {values}; expected 4 numbers.")
    if values[0] >= values[2] or values[1] >= values[3]:
        raise ScenarioError(
            f"{place}: rectangle: {values} is empty; give x_min, y_min, x_max, y_max."
        )
    return values[0], values[1], values[2], values[3]
