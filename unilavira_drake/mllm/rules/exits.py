"""Which doors and borders lead out of the room that the robot is in, each once."""

from __future__ import annotations

import math
from collections.abc import Sequence

from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.rules.sight import Exit, Sight, angle_between, inside
from unilavira_drake.mllm.rules.vocabulary import HUBS

_AT_HAND = 1.2
"""Metres."""


def find_exits(
    doors: Sequence[Sight],
    floors: Sequence[Sight],
    room: str,
    views: Sequence[ViewEvidence],
) -> tuple[Exit, ...]:
    """Returns the exits of a kind of room; doors of other rooms in view are left out."""
    # In a corridor doors stand in a row; from a room, what lies past its own door is another's.
    own = [
        door
        for door in doors
        if not _behind(door, doors)
        and not _stands_elsewhere(door, floors, room)
        and (room in HUBS or not _past_threshold(door, doors))
    ]
    exits = _distinct([_door_exit(door, floors, room) for door in own], views)
    for floor in sorted(floors, key=lambda f: f.distance):
        framed = any(inside(floor, door) for door in doors)
        if floor.room == room or framed or _known(floor, exits):
            continue
        exits.append(Exit(floor.room, floor, floor))
    return tuple(exits)


def _behind(door: Sight, doors: Sequence[Sight]) -> bool:
    """Whether a door is seen through the opening of another one."""
    u_min, _, u_max, _ = door.detection.box
    return any(
        other.direction == door.direction
        and other.detection.box[0] <= u_min
        and u_max <= other.detection.box[2]
        and other.distance < door.distance - 0.5
        for other in doors
        if other is not door
    )


def _door_exit(door: Sight, floors: Sequence[Sight], room: str) -> Exit:
    beyond = [
        f for f in floors if f.room != room and inside(f, door) and f.distance > door.distance - 0.4
    ]
    if not beyond and door.distance < _AT_HAND:
        # So near that the frame fills the gap between two views: the floor behind is in another.
        beyond = [
            f for f in floors if f.room != room and angle_between(f.bearing, door.bearing) < 40.0
        ]
    if not beyond:
        return Exit("", door)
    nearest = min(beyond, key=lambda f: f.near)
    return Exit(nearest.room, door, nearest)


def _distinct(exits: list[Exit], views: Sequence[ViewEvidence]) -> list[Exit]:
    """Keeps one exit where the same door is seen at the edges of two views.

    A frame cut by the edge of an image is misplaced by up to its width.
    """
    width = {view.direction: view.width for view in views}
    kept: list[Exit] = []
    for candidate in sorted(exits, key=lambda e: (not e.kind, -e.sight.pixels)):
        twin = next((k for k in kept if _same_door(k, candidate, width)), None)
        if twin is None:
            kept.append(candidate)
    return kept


def _same_door(a: Exit, b: Exit, width: dict[str, int]) -> bool:
    if a.sight.direction == b.sight.direction or (a.kind and b.kind and a.kind != b.kind):
        return False
    cut = any(
        e.sight.detection.box[0] <= 2 or e.sight.detection.box[2] >= width[e.sight.direction] - 2
        for e in (a, b)
    )
    apart = math.dist(a.sight.position, b.sight.position)
    return apart < (1.4 if cut and angle_between(a.sight.bearing, b.sight.bearing) < 60 else 0.9)


def _stands_elsewhere(door: Sight, floors: Sequence[Sight], room: str) -> bool:
    """Whether the floor at the foot of a door is that of another room."""
    u_min, _, u_max, v_max = door.detection.box
    u, v = (u_min + u_max) / 2, v_max + 4.0
    at_foot = [
        (f.detection.box[2] - f.detection.box[0], f.room != room)
        for f in floors
        if f.direction == door.direction
        and f.detection.box[0] <= u <= f.detection.box[2]
        and f.detection.box[1] <= v <= f.detection.box[3]
    ]
    return bool(at_foot) and min(at_foot)[1]


def _past_threshold(door: Sight, doors: Sequence[Sight]) -> bool:
    """Whether a door is seen through one at hand whose frame does not fit into the view."""
    return any(
        other.distance < _AT_HAND
        and other.distance < door.distance - 1.0
        and angle_between(other.bearing, door.bearing) < 40.0
        for other in doors
    )


def _known(floor: Sight, exits: Sequence[Exit]) -> bool:
    return any(
        e.kind == floor.room and angle_between(e.sight.bearing, floor.bearing) < 50.0 for e in exits
    )
