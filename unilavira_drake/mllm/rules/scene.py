"""What is around the robot now, in its own frame, from the detections of the four views."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import VIEW_YAW
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import ViewNote
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.floor_camera import FloorCamera
from unilavira_drake.mllm.rules.vocabulary import (
    HUBS,
    class_match,
    color_name,
    room_kind,
    thing_class,
)

_AT_HAND = 1.2
"""Metres."""
_FULL_VOTE = 0.15
"""Share of a view that floor must cover for the view's full vote on where the robot is."""


@dataclass(frozen=True)
class Sight:
    """One detection, placed relative to the robot: x ahead, y to the left, metres."""

    id: str
    category: str
    color: str
    room: str
    direction: str
    bearing: float
    """Degrees to the left of ``front``."""
    distance: float
    near: float
    """Distance to its nearest visible part on the floor, metres."""
    far: float
    """Distance to the farthest floor in view, for floors; metres."""
    pixels: int
    detection: Detection

    @property
    def position(self) -> tuple[float, float]:
        """(x ahead, y to the left), metres."""
        angle = math.radians(self.bearing)
        return self.distance * math.cos(angle), self.distance * math.sin(angle)

    @property
    def name(self) -> str:
        """The thing in words."""
        return f"{self.color} {self.category}".strip()


@dataclass(frozen=True)
class Exit:
    """A door, or the border to another room's floor where there is no door."""

    kind: str
    """Kind of the room behind; empty where its floor is not in view."""
    sight: Sight
    beyond: Sight | None = None
    """The floor behind."""


@dataclass(frozen=True)
class Scene:
    """The panorama as the reasoner sees it."""

    room: str
    """Kind of the room underfoot; empty when no floor is in view."""
    room_id: str
    """Detection that shows it."""
    things: tuple[Sight, ...]
    floors: tuple[Sight, ...]
    exits: tuple[Exit, ...]
    free: dict[str, float]
    """Measured free distance along each view's axis, metres."""

    def matching(self, clause: Clause) -> list[Sight]:
        """Returns the things a clause means, best class match first, then nearest."""
        found = [
            (-class_match(clause.category, s.category), s.near, i)
            for i, s in enumerate(self.things)
            if class_match(clause.category, s.category)
            and (not clause.color or s.color == clause.color)
        ]
        best = min((rank for rank, _, _ in found), default=0)
        return [self.things[i] for rank, _, i in sorted(found) if rank == best]


def angle_between(a: float, b: float) -> float:
    """Returns the unsigned angle between two bearings, degrees."""
    return abs(math.remainder(a - b, 360.0))


def look(views: Sequence[ViewEvidence], notes: Sequence[ViewNote]) -> Scene:
    """Returns the scene of one panorama."""
    camera = FloorCamera.fit(views)
    sights = [_sight(d, view, camera) for view in views for d in view.detections]
    floors = tuple(s for s in sights if s.category == "floor")
    doors = [s for s in sights if s.category == "door"]
    room, room_id = _underfoot(floors, doors, views)
    things = tuple(s for s in sights if s.category not in ("floor", "door", "wall", "ceiling"))
    return Scene(
        room=room,
        room_id=room_id or (sights[0].id if sights else ""),
        things=things,
        floors=floors,
        exits=_exits(doors, floors, room, views),
        free={note.direction: note.free_distance for note in notes},
    )


def _sight(detection: Detection, view: ViewEvidence, camera: FloorCamera) -> Sight:
    is_floor = detection.category == "floor"
    u_min, _, u_max, v_max = detection.box
    u = detection.point[0] if is_floor else (u_min + u_max) / 2
    bearing = math.degrees(VIEW_YAW[view.direction] + view.bearing(u))
    distance = detection.point_distance if is_floor else detection.distance
    category = thing_class(detection.category)
    foot = camera.reach((u_min + u_max) / 2, min(v_max, view.height - 1))
    return Sight(
        id=detection.id,
        category=category,
        color=color_name(detection.color),
        room=room_kind(detection.room) if detection.room else "",
        direction=view.direction,
        bearing=math.remainder(bearing, 360.0),
        distance=distance,
        near=min(distance, foot),
        far=min(camera.reach(u, detection.box[1] + 1.0), 10.0) if is_floor else distance,
        pixels=detection.pixels,
        detection=detection,
    )


def _underfoot(
    floors: Sequence[Sight], doors: Sequence[Sight], views: Sequence[ViewEvidence]
) -> tuple[str, str]:
    """Returns the kind of room underfoot and the detection that shows it.

    Each view votes with the shares of the floors that reach its lower edge; a floor behind a
    door frame counts little.  The camera never sees the floor under the robot itself.
    """
    votes: dict[str, float] = {}
    largest: dict[str, Sight] = {}
    for view in views:
        weights: list[tuple[Sight, float]] = []
        for floor in (f for f in floors if f.direction == view.direction):
            near = floor.detection.box[3] >= view.height - 3
            framed = any(_inside(floor, d) and floor.near > d.distance for d in doors)
            weight = floor.pixels * (1.0 if near else 0.1) * (0.2 if framed else 1.0)
            weights.append((floor, weight))
        area = _FULL_VOTE * view.width * view.height
        total = max(sum(weight for _, weight in weights), area)
        for floor, weight in weights:
            votes[floor.room] = votes.get(floor.room, 0.0) + weight / total
            if floor.room not in largest or floor.pixels > largest[floor.room].pixels:
                largest[floor.room] = floor
    if not votes:
        return "", ""
    room = max(votes, key=lambda kind: votes[kind])
    return room, largest[room].id


def _exits(
    doors: Sequence[Sight],
    floors: Sequence[Sight],
    room: str,
    views: Sequence[ViewEvidence],
) -> tuple[Exit, ...]:
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
        framed = any(_inside(floor, door) for door in doors)
        if floor.room == room or framed or _known(floor, exits):
            continue
        exits.append(Exit(floor.room, floor, floor))
    return tuple(exits)


def _inside(sight: Sight, door: Sight, margin: float = 12.0) -> bool:
    u_min, _, u_max, _ = door.detection.box
    u = sight.detection.point[0]
    return sight.direction == door.direction and u_min - margin <= u <= u_max + margin


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
        f
        for f in floors
        if f.room != room and _inside(f, door) and f.distance > door.distance - 0.4
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
