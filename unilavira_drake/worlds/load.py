"""Reads a world file into a ``World``."""

from __future__ import annotations

import dataclasses as dc
import functools
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.resources import models_path
from unilavira_drake.worlds.build import build_world
from unilavira_drake.worlds.outdoors.entries import BuildingEntry, GroundEntry, RowEntry
from unilavira_drake.worlds.outdoors.things import Building, Exterior, Place
from unilavira_drake.worlds.schema import (
    DoorEntry,
    ObjectEntry,
    PanelEntry,
    RoomEntry,
    StairsEntry,
    StoreyEntry,
    WorldFile,
)
from unilavira_drake.worlds.stairs import Stairs
from unilavira_drake.worlds.world import Box, Panel, Placement, World, WorldObject

_LISTS = {
    "storeys": StoreyEntry,
    "rooms": RoomEntry,
    "stairs": StairsEntry,
    "doors": DoorEntry,
    "objects": ObjectEntry,
    "panels": PanelEntry,
    "ground": GroundEntry,
    "buildings": BuildingEntry,
    "rows": RowEntry,
}


def load_world(name_or_file: str, *, mirror: bool = False) -> World:
    """Reads ``models/worlds/NAME.yaml``, or a file that ends in ``.yaml``.

    Args:
        name_or_file: e.g. ``flat``.
        mirror: negates y of everything, and every yaw.

    Raises:
        ScenarioError: names file, key, value and remedy.
    """
    path = _find(name_or_file)
    try:
        stamp = path.stat().st_mtime_ns
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error}.") from None
    world = _built(path, path.resolve(), stamp)
    return _mirrored(world) if mirror else world


@functools.lru_cache(8)
def _built(path: Path, resolved: Path, stamp: int) -> World:
    """Returns the world of a file; an episode asks for it four times, a fifth of a second each."""
    return build_world(_read(path), str(path))


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
        if key is True:
            raise ScenarioError(f"{place}: 'on' means true in YAML; write stands_on.")
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
    """Returns the world with y negated; boxes and rectangles stay boxes and rectangles.

    A model of the furniture library is turned and moved, not mirrored in itself.
    """
    return dc.replace(
        world,
        rooms=tuple(
            dc.replace(room, rectangle=_flipped_rectangle(room.rectangle)) for room in world.rooms
        ),
        objects=tuple(_flipped_object(thing) for thing in world.objects),
        walls=tuple(map(_flipped_box, world.walls)),
        doorways=tuple(dc.replace(opening, y=-opening.y) for opening in world.doorways),
        stairs=tuple(map(_flipped_stairs, world.stairs)),
        mirrored=True,
        ground=tuple(
            dc.replace(patch, rectangle=_flipped_rectangle(patch.rectangle))
            for patch in world.ground
        ),
    )


def _flipped_stairs(stairs: Stairs) -> Stairs:
    x_min, y_min, x_max, y_max = stairs.rectangle
    return dc.replace(stairs, rectangle=(x_min, -y_max, x_max, -y_min), heading=-stairs.heading)


def _flipped_object(thing: WorldObject) -> WorldObject:
    visual = thing.visual
    if isinstance(visual, Placement):
        x, y, z = visual.position
        visual = dc.replace(visual, position=(x, -y, z), yaw=-visual.yaw)
    elif isinstance(visual, Panel):
        facing = None if visual.facing is None else -visual.facing
        visual = dc.replace(visual, box=_flipped_box(visual.box), facing=facing)
    elif isinstance(visual, Building):
        visual = dc.replace(visual, place=_flipped_place(visual.place), mirrored=True)
    elif isinstance(visual, Exterior):
        places = tuple(map(_flipped_place, visual.places))
        visual = dc.replace(visual, places=places, mirrored=True)
    return dc.replace(thing, boxes=tuple(map(_flipped_box, thing.boxes)), visual=visual)


def _flipped_box(box: Box) -> Box:
    x, y, z = box.center
    return dc.replace(box, center=(x, -y, z), yaw=-box.yaw)


def _flipped_rectangle(
    rectangle: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    x_min, y_min, x_max, y_max = rectangle
    return x_min, -y_max, x_max, -y_min


def _flipped_place(place: Place) -> Place:
    x, y, z, yaw = place
    return x, -y, z, -yaw
