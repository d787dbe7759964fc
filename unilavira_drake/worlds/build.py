"""Makes a ``World`` of the entries of a world file, and says what is wrong with them."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Iterable, Mapping
from typing import Any

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.worlds.entry_numbers import numbers, rgb
from unilavira_drake.worlds.furniture import CATEGORIES, furniture_boxes
from unilavira_drake.worlds.furniture_library import furniture_model
from unilavira_drake.worlds.materials import FLOORS, WALLS
from unilavira_drake.worlds.openings import check_apart, opening_of
from unilavira_drake.worlds.outdoors import build as outdoors
from unilavira_drake.worlds.outdoors.materials import GROUND
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.panels import PATTERNS, SIGN, panel
from unilavira_drake.worlds.schema import (
    DoorEntry,
    ObjectEntry,
    PanelEntry,
    RoomEntry,
    StairsEntry,
    WorldFile,
)
from unilavira_drake.worlds.signs import MOST_LETTERS
from unilavira_drake.worlds.storeys import (
    make_stairs,
    stair_objects,
    storey_elevations,
    storey_walls,
)
from unilavira_drake.worlds.structure import frame_boxes
from unilavira_drake.worlds.world import (
    Box,
    LabelEntry,
    Placement,
    Room,
    World,
    WorldObject,
)

WALL_GAP = 0.02
"""Between a wall and what stands at it, metres."""

WALL_SIDES = ("north", "east", "south", "west")


def build_world(entries: WorldFile, place: str) -> World:
    """Returns the world of a file's entries.

    Raises:
        ScenarioError: names the place in the file, the value and the remedy.
    """
    if not entries.outdoors:
        _check_indoors(entries, place)
    floors = GROUND if entries.outdoors else FLOORS
    elevations = storey_elevations(entries, place)
    rooms = tuple(
        _room(entry, floors, elevations, f"{place}: rooms: {entry.name!r}")
        for entry in entries.rooms
    )
    if not rooms:
        raise ScenarioError(f"{place}: rooms: empty; a world needs at least one room.")
    for key, size, low, high in (
        ("wall_height", entries.wall_height, 2.2, 20.0),
        ("wall_thickness", entries.wall_thickness, 0.02, 1.0),
    ):
        if not low <= size <= high:
            raise ScenarioError(f"{place}: {key}: {size} is not usable; give {low} to {high} m.")
    _unique(
        (*entries.rooms, *entries.stairs, *entries.doors, *entries.objects, *entries.panels), place
    )
    if entries.outdoors:
        return _outdoors(entries, rooms, place)
    by_name = {room.name: room for room in rooms}
    _check_materials(rooms, place)
    things = _things(entries.objects, by_name, entries.wall_thickness, place)
    panels = tuple(_panel(entry, by_name, entries, place) for entry in entries.panels)
    openings = tuple(opening_of(entry, by_name, entries, place) for entry in entries.doors)
    check_apart(entries.doors, openings, place)
    stairs = tuple(make_stairs(entry, by_name, entries, place) for entry in entries.stairs)
    doors = tuple(
        WorldObject(
            name=entry.name,
            category="door",
            color=entry.color,
            room="|".join(entry.rooms),
            boxes=tuple(box.lowered(-opening.elevation) for box in frame_boxes(opening)),
        )
        for entry, opening in zip(entries.doors, openings, strict=True)
        if not opening.open
    )
    built = stair_objects(entries.stairs, stairs, by_name, entries.wall_thickness)
    objects = (*things, *panels, *doors, *built)
    return World(
        name=entries.name,
        rooms=rooms,
        objects=objects,
        walls=storey_walls(rooms, openings, entries.wall_height, entries.wall_thickness),
        stairs=stairs,
        labels=_labels(objects, rooms),
        wall_height=entries.wall_height,
        wall_color=rgb(entries.wall_color, f"{place}: wall_color"),
        wall_thickness=entries.wall_thickness,
        doorways=openings,
    )


def _outdoors(entries: WorldFile, rooms: tuple[Room, ...], place: str) -> World:
    """Returns a world under the open sky; of its objects the models are of the library."""
    outdoors.check(entries, place)
    _unique((*entries.rooms, *entries.objects, *outdoors.named(entries)), place)
    by_name = {room.name: room for room in rooms}
    models = [entry for entry in entries.objects if entry.model]
    things = (
        *outdoors.buildings(entries, rooms, place),
        *outdoors.rows(entries, rooms, place),
        *outdoors.shapes(entries, by_name, place),
        *_things(models, by_name, 0.0, place),
    )
    for thing in things:
        outdoors.check_inside(thing, rooms, place)
    ground = outdoors.ground(entries, place)
    return World(
        name=entries.name,
        rooms=rooms,
        objects=things,
        labels=outdoors.labels(things, rooms, ground),
        wall_height=entries.wall_height,
        outdoors=True,
        ground=ground,
    )


def _check_indoors(entries: WorldFile, place: str) -> None:
    for key in ("ground", "buildings", "rows", "surroundings"):
        if getattr(entries, key):
            raise ScenarioError(f"{place}: {key}: needs a world under the open sky; set outdoors.")


def _labels(things: tuple[WorldObject, ...], rooms: tuple[Room, ...]) -> dict[int, LabelEntry]:
    entries = [LabelEntry(category=thing.category, instance=thing.name) for thing in things]
    entries += [LabelEntry("floor", f"{room.name}_floor", room.kind) for room in rooms]
    entries.append(LabelEntry("wall", "walls"))
    return dict(enumerate(entries, start=1))


def _room(
    entry: RoomEntry, floors: Mapping[str, object], elevations: Mapping[str, float], place: str
) -> Room:
    x_min, y_min, x_max, y_max = numbers(entry.rectangle, 4, f"{place}: rectangle")
    if x_min >= x_max or y_min >= y_max:
        raise ScenarioError(
            f"{place}: rectangle: {entry.rectangle} is empty; give x_min, y_min, x_max, y_max."
        )
    for key, value, valid in (("floor", entry.floor, floors), ("walls", entry.walls, WALLS)):
        if value and value not in valid:
            raise ScenarioError(unknown_name("material", value, valid, f"{place}: {key}"))
    if entry.storey not in elevations:
        raise ScenarioError(
            unknown_name("storey", entry.storey, filter(None, elevations), f"{place}: storey")
        )
    return Room(
        elevation=elevations[entry.storey],
        floor=entry.floor,
        walls=entry.walls,
        name=entry.name,
        kind=entry.kind or entry.name,
        rectangle=(x_min, y_min, x_max, y_max),
        floor_color=rgb(entry.floor_color, f"{place}: floor_color"),
    )


def _check_materials(rooms: tuple[Room, ...], place: str) -> None:
    given = [bool(material) for room in rooms for material in (room.floor, room.walls)]
    if any(given) and not all(given):
        bare = next(room.name for room in rooms if not (room.floor and room.walls))
        raise ScenarioError(
            f"{place}: rooms: {bare!r}: floor or walls without a material; give both to all "
            "rooms, or none to any."
        )


def _things(
    entries: Iterable[ObjectEntry], rooms: dict[str, Room], thickness: float, place: str
) -> tuple[WorldObject, ...]:
    things: dict[str, WorldObject] = {}
    for entry in entries:
        here = f"{place}: objects: {entry.name!r}"
        if entry.room not in rooms:
            raise ScenarioError(unknown_name("room", entry.room, rooms, here))
        if entry.color and entry.color not in PALETTE:
            raise ScenarioError(unknown_name("color", entry.color, PALETTE, here))
        if entry.stands_on and entry.height:
            raise ScenarioError(f"{here}: height and stands_on are both given; keep one.")
        if entry.height < 0.0:
            raise ScenarioError(f"{here}: height: {entry.height} is under the floor.")
        if entry.wall and not entry.model:
            raise ScenarioError(f"{here}: wall: needs a model; give a position of two numbers.")
        floor = rooms[entry.room].elevation
        height = _top(entry.stands_on, things, here) if entry.stands_on else floor + entry.height
        if entry.model:
            thing = _modelled(entry, height, rooms[entry.room], thickness, here)
        else:
            thing = _boxed(entry, height, here)
        _check_inside(thing, rooms[entry.room], entry, here)
        things[entry.name] = thing
    return tuple(things.values())


def _top(name: str, things: Mapping[str, WorldObject], place: str) -> float:
    """Returns the height on which a thing stands that stands on another."""
    host = things.get(name)
    if host is None:
        raise ScenarioError(unknown_name("object", name, things, f"{place}: stands_on"))
    if isinstance(host.visual, Placement):
        support = furniture_model(host.visual.model, place).support_height
        if support is None:
            raise ScenarioError(
                f"{place}: stands_on: nothing can stand on {name!r}; give a height."
            )
        return host.visual.position[2] + support
    return max(box.center[2] + box.size[2] / 2 for box in host.boxes)


def _boxed(entry: ObjectEntry, height: float, place: str) -> WorldObject:
    for key, value, valid in (
        ("category", entry.category, CATEGORIES),
        ("color", entry.color, PALETTE),
    ):
        if value not in valid:
            raise ScenarioError(unknown_name(key, value, valid, place))
    x, y = numbers(entry.position, 2, f"{place}: position")
    boxes = furniture_boxes(entry.category, x, y, math.radians(entry.yaw_degrees), height)
    return WorldObject(entry.name, entry.category, entry.color, entry.room, boxes)


def _modelled(
    entry: ObjectEntry, height: float, room: Room, thickness: float, place: str
) -> WorldObject:
    model = furniture_model(entry.model, place)
    if entry.wall:
        x, y, yaw = _at_wall(entry, model.size, room, thickness / 2 + WALL_GAP, place)
    else:
        x, y = numbers(entry.position, 2, f"{place}: position")
        yaw = math.radians(entry.yaw_degrees)
    return WorldObject(
        name=entry.name,
        category=entry.category or model.category,
        color=entry.color or model.color,
        room=entry.room,
        boxes=tuple(_moved(part, x, y, height, yaw) for part in model.parts),
        visual=Placement(entry.model, entry.color, (x, y, height), yaw),
    )


def _moved(box: Box, x: float, y: float, z: float, yaw: float) -> Box:
    c, s = math.cos(yaw), math.sin(yaw)
    box_x, box_y, box_z = box.center
    center = (x + c * box_x - s * box_y, y + s * box_x + c * box_y, z + box_z)
    return Box(center, box.size, yaw + box.yaw)


def _at_wall(
    entry: ObjectEntry,
    size: tuple[float, float, float],
    room: Room,
    gap: float,
    place: str,
) -> tuple[float, float, float]:
    """Returns x, y and yaw of a model with its back, or at a turn its side, to a wall."""
    if entry.wall not in WALL_SIDES:
        raise ScenarioError(unknown_name("wall", entry.wall, WALL_SIDES, place))
    (along,) = numbers(entry.position, 1, f"{place}: position")
    turn = math.radians(entry.yaw_degrees)
    depth = abs(math.cos(turn)) * size[0] + abs(math.sin(turn)) * size[1]
    x_min, y_min, x_max, y_max = room.rectangle
    x, y, facing = {
        "west": (x_min + gap + depth / 2, along, 0.0),
        "east": (x_max - gap - depth / 2, along, math.pi),
        "south": (along, y_min + gap + depth / 2, math.pi / 2),
        "north": (along, y_max - gap - depth / 2, -math.pi / 2),
    }[entry.wall]
    return x, y, facing + turn


def _check_inside(thing: WorldObject, room: Room, entry: Any, place: str) -> None:
    if not all(room.contains(*corner) for box in thing.boxes for corner in box.corners()):
        raise ScenarioError(
            f"{place}: position: at {entry.position} it is not wholly inside room {room.name!r} "
            f"{room.rectangle}; move it or correct its room."
        )


def _panel(
    entry: PanelEntry, rooms: dict[str, Room], entries: WorldFile, place: str
) -> WorldObject:
    place = f"{place}: panels: {entry.name!r}"
    for key, value, valid in (
        ("category", entry.category, (*PATTERNS, SIGN)),
        ("color", entry.color, PALETTE),
        ("room", entry.room, rooms),
    ):
        if value not in valid:
            raise ScenarioError(unknown_name(key, value, valid, place))
    x, y = numbers(entry.position, 2, f"{place}: position")
    width, height = numbers(entry.size, 2, f"{place}: size")
    if min(width, height) < 0.05:
        raise ScenarioError(f"{place}: size: {entry.size}; give width and height above 0.05 m.")
    if not 0.0 <= entry.height <= entries.wall_height - height * (entry.category != "rug"):
        raise ScenarioError(
            f"{place}: height: {entry.height} does not fit under {entries.wall_height} m."
        )
    if bool(entry.text.strip()) != (entry.category == SIGN) or len(entry.text) > MOST_LETTERS:
        raise ScenarioError(
            f"{place}: text: {entry.text!r}; a sign says something in at most {MOST_LETTERS} "
            "letters, and no other panel has a text."
        )
    room = rooms[entry.room]
    visual = panel(entry, room, (x, y), (width, height), entries.wall_thickness)
    if room.elevation:
        visual = dc.replace(visual, box=visual.box.lowered(-room.elevation))
    thing = WorldObject(
        name=entry.name,
        category=entry.category,
        color=entry.color,
        room=entry.room,
        boxes=(visual.box,),
        visual=visual,
        solid=False,
    )
    _check_inside(thing, room, entry, place)
    return thing


def _unique(
    entries: Iterable[
        RoomEntry | StairsEntry | DoorEntry | ObjectEntry | PanelEntry | outdoors.Named
    ],
    place: str,
) -> None:
    seen: set[str] = set()
    for entry in entries:
        if not entry.name or entry.name in seen:
            problem = f"the name {entry.name!r} is used twice" if entry.name else "a name is empty"
            raise ScenarioError(f"{place}: {problem}; every name must be unique.")
        seen.add(entry.name)
