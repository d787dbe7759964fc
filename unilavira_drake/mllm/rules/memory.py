"""Visited places, read back from the captions that earlier replies left in the history."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.mllm.request import OTHER_FLOOR, LanguageVariables, WaypointNote
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.scene import Scene
from unilavira_drake.mllm.rules.vocabulary import HUBS, class_match, color_name

SCENE_LIMIT = 110
"""Characters of a scene sentence."""

_ROOM = re.compile(r"In the ([a-z' ]+?)(?=[;.]|$)")
_EXIT = re.compile(r"([a-z' ]+|\?) ([+-]\d+) deg (\d+\.\d) m")
_CLIMBED = re.compile(r"go_stair (up|down): arrived")


@dataclass(frozen=True)
class Place:
    """A remembered waypoint relative to the robot: x ahead, y to the left, metres."""

    id: int
    room: str
    position: tuple[float, float]
    exits: tuple[tuple[str, tuple[float, float]], ...]
    """Kind of room behind (or empty) and position of each exit seen from there."""
    sees: str
    offered: bool
    tried: tuple[str, ...]
    elsewhere: bool = False
    """Whether it is on another floor: near only on a plan."""

    @property
    def distance(self) -> float:
        """Metres from the robot."""
        return math.hypot(*self.position)


def recall(variables: LanguageVariables) -> tuple[Place, ...]:
    """Returns the remembered places, oldest first."""
    return tuple(_place(note) for note in sorted(variables.waypoints, key=lambda n: n.id))


def _place(note: WaypointNote) -> Place:
    bearing = math.radians(note.bearing)
    x, y = note.distance * math.cos(bearing), note.distance * math.sin(bearing)
    room = _ROOM.search(note.caption)
    exits = []
    for kind, degrees, metres in _EXIT.findall(note.caption):
        angle = math.radians(note.heading + float(degrees))
        position = (x + float(metres) * math.cos(angle), y + float(metres) * math.sin(angle))
        exits.append((kind.strip().removeprefix("?"), position))
    sees = note.caption.partition("sees ")[2]
    return Place(
        note.id,
        room.group(1) if room else "",
        (x, y),
        tuple(exits),
        sees,
        note.offered,
        note.tried,
        note.scene.startswith(OTHER_FLOOR),
    )


def climbed(decision: str) -> str:
    """Returns ``up`` or ``down`` where a past decision led over stairs, else nothing."""
    found = _CLIMBED.search(decision)
    return found.group(1) if found else ""


def scene_sentence(scene: Scene, heading: float) -> str:
    """Returns the caption of this place: room, exits with bearing and distance, what is seen.

    Args:
        heading: where the waypoint's own ``front`` points, degrees left of the present one.
    """
    text = f"In the {scene.room or 'unknown'}"
    for i, door in enumerate(sorted(scene.exits, key=lambda e: e.sight.distance)[:4]):
        bearing = round(math.remainder(door.sight.bearing - heading, 360.0))
        part = f"{door.kind or '?'} {bearing:+d} deg {door.sight.distance:.1f} m"
        extended = text + ("; exits: " if i == 0 else ", ") + part
        if len(extended) > SCENE_LIMIT:
            break
        text = extended
    names = dict.fromkeys(s.name for s in sorted(scene.things, key=lambda s: s.near))
    for i, name in enumerate(names):
        extended = text + ("; sees " if i == 0 else ", ") + name
        if len(extended) > SCENE_LIMIT:
            break
        text = extended
    return text


def explored(kind: str, position: tuple[float, float], places: Sequence[Place]) -> bool:
    """Whether the robot has already been behind an exit.

    Either a place of that kind lies close behind it, or a leg between two rooms led through it.
    """
    for place in places:
        if kind and place.room == kind and math.dist(place.position, position) < 3.5:
            return True
    return any(
        a.room != b.room
        and (not kind or kind in (a.room, b.room))
        and _off_leg(position, a.position, b.position) < (0.7 if kind else 0.5)
        for a, b in itertools.pairwise(places)
    )


def open_ends(place: Place, places: Sequence[Place]) -> int:
    """Returns how many exits that were seen from a place have not been explored."""
    return sum(not explored(kind, position, places) for kind, position in place.exits)


def is_hub(room: str) -> bool:
    """Whether a room's purpose is to lead to other rooms."""
    return room in HUBS


def remembers(place: Place, clause: Clause) -> bool:
    """Whether a place's caption says that the thing of a clause was seen from there."""
    for name in place.sees.split(", "):
        color, _, category = name.partition(" ")
        if class_match(clause.category, name):
            return not clause.color
        if class_match(clause.category, category):
            return not clause.color or color_name(color) == clause.color
    return False


def _off_leg(p: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    t = 0.0 if length == 0.0 else ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length
    t = min(max(t, 0.0), 1.0)
    return math.dist(p, (a[0] + t * dx, a[1] + t * dy))
