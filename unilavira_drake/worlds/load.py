"""Reads a world file into a ``World``."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.resources import models_path
from unilavira_drake.worlds.furniture import CATEGORIES, furniture_boxes
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.schema import DoorEntry, ObjectEntry, RoomEntry, WorldFile
from unilavira_drake.worlds.structure import Doorway, doorway, frame_boxes, walls
from unilavira_drake.worlds.world import Box, LabelEntry, Room, World, WorldObject

_LISTS = {"rooms": RoomEntry, "doors": DoorEntry, "objects": ObjectEntry}


def load_world(name_or_file: str, *, mirror: bool = False) -> World:
    """Reads ``models/worlds/NAME.yaml``, or a file that ends in ``.yaml``.

    Args:
        name_or_file: e.g. ``flat``.
        mirror: negates y of everything, and every yaw.

    Raises:
        ScenarioError: names file, key, value and remedy.
    """
    path = _find(name_or_file)
    world = _build(_read(path), str(path))
    return _mirrored(world) if mirror else world


def _find(name_or_file: str) -> Path:
    if name_or_file.endswith((".yaml", ".yml")):
        path = Path(name_or_file)
        if not path.is_file():
            raise ScenarioError(f"world.name: no file {name_or_file!r}; check the path.")
        return path
    folder = models_path() / "worlds"
    path = folder / f"{name_or_file}.yaml"
    if not path.is_file():
        known = [file.stem for file in folder.glob("*.yaml")]
        raise ScenarioError(unknown_name("world", name_or_file, known, "world.name"))
    return path


def _read(path: Path) -> WorldFile:
    try:
        text = path.read_text(encoding="utf-8")
        data = yaml.safe_load(text)
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}.") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ScenarioError(f"{path}: not valid YAML: {error}") from None
    if not isinstance(data, dict):
        raise ScenarioError(f"{path}: expected keys such as 'rooms' and 'objects' at the top.")
    _check(data, WorldFile, str(path))
    for key, schema in _LISTS.items():
        if not isinstance(data.get(key, []), list):
            raise ScenarioError(f"{path}: {key}: expected a list, got {data[key]!r}.")
        for index, entry in enumerate(data.get(key, [])):
            named = isinstance(entry, dict) and "name" in entry
            label = repr(entry["name"]) if named else f"{index + 1}"
            _check(entry, schema, f"{path}: {key}: entry {label}")
    entries: WorldFile = _typed(WorldFile, text, str(path))
    return entries


def _check(data: Any, schema: type, place: str) -> None:
    """Raises a ScenarioError for an unknown key or a wrong type in one mapping."""
    fields = {field.name: field for field in dc.fields(schema)}
    if not isinstance(data, dict):
        raise ScenarioError(
            f"{place}: expected a mapping with the keys {', '.join(fields)}, got {data!r}."
        )
    for key, value in data.items():
        if key not in fields:
            raise ScenarioError(unknown_name("key", str(key), fields, place))
        if key not in _LISTS:
            _typed(schema, yaml.safe_dump({key: value}), f"{place}: {key}")


def _typed(schema: type, text: str, place: str) -> Any:
    try:
        return yaml_load_typed(schema=schema, data=text)
    except (RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise ScenarioError(f"{place}: wrong type: {error}") from None


def _mirrored(world: World) -> World:
    """Returns the world with y negated; boxes and rectangles stay boxes and rectangles."""

    def flip(box: Box) -> Box:
        x, y, z = box.center
        return dc.replace(box, center=(x, -y, z), yaw=-box.yaw)

    rooms = []
    for room in world.rooms:
        x_min, y_min, x_max, y_max = room.rectangle
        rooms.append(dc.replace(room, rectangle=(x_min, -y_max, x_max, -y_min)))
    things = (dc.replace(thing, boxes=tuple(map(flip, thing.boxes))) for thing in world.objects)
    return dc.replace(
        world,
        rooms=tuple(rooms),
        objects=tuple(things),
        walls=tuple(map(flip, world.walls)),
        mirrored=True,
    )


def _build(entries: WorldFile, place: str) -> World:
    rooms = tuple(_room(entry, f"{place}: rooms: {entry.name!r}") for entry in entries.rooms)
    if not rooms:
        raise ScenarioError(f"{place}: rooms: empty; a world needs at least one room.")
    for key, size, low, high in (
        ("wall_height", entries.wall_height, 2.2, 20.0),
        ("wall_thickness", entries.wall_thickness, 0.02, 1.0),
    ):
        if not low <= size <= high:
            raise ScenarioError(f"{place}: {key}: {size} is not usable; give {low} to {high} m.")
    _unique((*entries.rooms, *entries.doors, *entries.objects), place)
    by_name = {room.name: room for room in rooms}
    things = tuple(_thing(entry, by_name, place) for entry in entries.objects)
    openings = tuple(_opening(entry, by_name, entries, place) for entry in entries.doors)
    doors = tuple(
        WorldObject(
            name=entry.name,
            category="door",
            color=entry.color,
            room="|".join(entry.rooms),
            boxes=frame_boxes(opening),
        )
        for entry, opening in zip(entries.doors, openings, strict=True)
    )
    return World(
        name=entries.name,
        rooms=rooms,
        objects=(*things, *doors),
        walls=walls(rooms, openings, entries.wall_height, entries.wall_thickness),
        labels=_labels((*things, *doors), rooms),
        wall_height=entries.wall_height,
        wall_color=_rgb(entries.wall_color, f"{place}: wall_color"),
    )


def _labels(things: tuple[WorldObject, ...], rooms: tuple[Room, ...]) -> dict[int, LabelEntry]:
    entries = [LabelEntry(category=thing.category, instance=thing.name) for thing in things]
    entries += [LabelEntry("floor", f"{room.name}_floor", room.kind) for room in rooms]
    entries.append(LabelEntry("wall", "walls"))
    return dict(enumerate(entries, start=1))


def _room(entry: RoomEntry, place: str) -> Room:
    x_min, y_min, x_max, y_max = _numbers(entry.rectangle, 4, f"{place}: rectangle")
    if x_min >= x_max or y_min >= y_max:
        raise ScenarioError(
            f"{place}: rectangle: {entry.rectangle} is empty; give x_min, y_min, x_max, y_max."
        )
    return Room(
        name=entry.name,
        kind=entry.kind or entry.name,
        rectangle=(x_min, y_min, x_max, y_max),
        floor_color=_rgb(entry.floor_color, f"{place}: floor_color"),
    )


def _thing(entry: ObjectEntry, rooms: dict[str, Room], place: str) -> WorldObject:
    place = f"{place}: objects: {entry.name!r}"
    for key, value, valid in (
        ("category", entry.category, CATEGORIES),
        ("color", entry.color, PALETTE),
        ("room", entry.room, rooms),
    ):
        if value not in valid:
            raise ScenarioError(unknown_name(key, value, valid, place))
    x, y = _numbers(entry.position, 2, f"{place}: position")
    yaw = math.radians(entry.yaw_degrees)
    boxes = furniture_boxes(entry.category, x, y, yaw, entry.height)
    room = rooms[entry.room]
    if not all(room.contains(*corner) for box in boxes for corner in box.corners()):
        raise ScenarioError(
            f"{place}: position: at {entry.position} it is not wholly inside room {room.name!r} "
            f"{room.rectangle}; move it or correct its room."
        )
    return WorldObject(entry.name, entry.category, entry.color, entry.room, boxes)


def _opening(entry: DoorEntry, rooms: dict[str, Room], entries: WorldFile, place: str) -> Doorway:
    place = f"{place}: doors: {entry.name!r}"
    if entry.color not in PALETTE:
        raise ScenarioError(unknown_name("color", entry.color, PALETTE, place))
    if len(entry.rooms) != 2:
        raise ScenarioError(f"{place}: rooms: {entry.rooms}; name the two rooms it joins.")
    for name in entry.rooms:
        if name not in rooms:
            raise ScenarioError(unknown_name("room", name, rooms, place))
    x, y = _numbers(entry.position, 2, f"{place}: position")
    joined = (rooms[entry.rooms[0]], rooms[entry.rooms[1]])
    opening = doorway(x, y, entry.width, joined, entries.wall_thickness)
    if opening is None:
        raise ScenarioError(
            f"{place}: position: {entry.position} with width {entry.width} is not on a wall "
            f"shared by {' and '.join(entry.rooms)}; put it on their common edge."
        )
    return opening


def _unique(entries: Iterable[RoomEntry | DoorEntry | ObjectEntry], place: str) -> None:
    seen: set[str] = set()
    for entry in entries:
        if not entry.name or entry.name in seen:
            problem = f"the name {entry.name!r} is used twice" if entry.name else "a name is empty"
            raise ScenarioError(f"{place}: {problem}; every name must be unique.")
        seen.add(entry.name)


def _numbers(values: list[float], count: int, place: str) -> tuple[float, ...]:
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise ScenarioError(f"{place}: {values}; expected {count} numbers.")
    return tuple(values)


def _rgb(values: list[float], place: str) -> tuple[float, float, float]:
    red, green, blue = _numbers(values, 3, place)
    if not all(0.0 <= value <= 1.0 for value in values):
        raise ScenarioError(f"{place}: {values}; each of red, green, blue must lie in [0, 1].")
    return (red, green, blue)
