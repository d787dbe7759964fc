"""Doorways of a world file, checked against the walls."""

from __future__ import annotations

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.worlds.entry_numbers import numbers
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.schema import DoorEntry, WorldFile
from unilavira_drake.worlds.structure import doorway
from unilavira_drake.worlds.world import Doorway, Room

NARROWEST = 0.5
"""Clear width of a doorway at least, metres."""


def opening_of(entry: DoorEntry, rooms: dict[str, Room], entries: WorldFile, place: str) -> Doorway:
    """Returns the doorway of an entry.

    Raises:
        ScenarioError: names the place in the file, the value and the remedy.
    """
    place = f"{place}: doors: {entry.name!r}"
    if entry.color not in PALETTE:
        raise ScenarioError(unknown_name("color", entry.color, PALETTE, place))
    if len(entry.rooms) != 2:
        raise ScenarioError(f"{place}: rooms: {entry.rooms}; name the two rooms it joins.")
    for name in entry.rooms:
        if name not in rooms:
            raise ScenarioError(unknown_name("room", name, rooms, place))
    x, y = numbers(entry.position, 2, f"{place}: position")
    if not entry.width >= NARROWEST:
        raise ScenarioError(f"{place}: width: {entry.width}; give at least {NARROWEST} m.")
    joined = (rooms[entry.rooms[0]], rooms[entry.rooms[1]])
    floor = joined[0].elevation
    if joined[1].elevation != floor:
        raise ScenarioError(f"{place}: rooms: {entry.rooms} are on two storeys; join by stairs.")
    opening = doorway(
        Doorway(x, y, entry.width, open=entry.open, elevation=floor),
        joined,
        entries.wall_thickness,
    )
    if opening is None:
        raise ScenarioError(
            f"{place}: position: {entry.position} with width {entry.width} is not on a wall "
            f"shared by {' and '.join(entry.rooms)}; put it on their common edge."
        )
    return opening


def check_apart(doors: list[DoorEntry], openings: tuple[Doorway, ...], place: str) -> None:
    """Checks that no two doorways overlap.

    Raises:
        ScenarioError: if two do.
    """
    for i, a in enumerate(openings):
        for k, b in enumerate(openings[:i]):
            along, across = (b.x - a.x, b.y - a.y) if a.along_x else (b.y - a.y, b.x - a.x)
            same = a.along_x == b.along_x and abs(across) < 1e-6 and a.elevation == b.elevation
            if same and abs(along) < a.gap + b.gap:
                raise ScenarioError(
                    f"{place}: doors: {doors[k].name!r} and {doors[i].name!r} overlap; move one."
                )
