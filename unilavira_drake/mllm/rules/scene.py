"""What is around the robot now, in its own frame, from the detections of the four views."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import VIEW_YAW
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import ViewNote
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.exits import find_exits
from unilavira_drake.mllm.rules.floor_camera import FloorCamera
from unilavira_drake.mllm.rules.sight import Exit, Sight, inside
from unilavira_drake.mllm.rules.vocabulary import (
    class_match,
    color_name,
    room_kind,
    thing_class,
)

_FULL_VOTE = 0.15
"""Share of a view that floor must cover for the view's full vote on where the robot is."""

_SEEN_AROUND = 2.5
"""What stands beside a thing nearer than this is in one of the views, metres."""
_BESIDE = 2.0
"""Two things nearer to each other than this stand side by side, metres between their middles."""


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
        """Returns the things a clause means, best class match first, then nearest.

        What stands near the robot without the clause's landmark beside it is not meant; around
        farther things not everything is seen.
        """
        found = [
            (-class_match(clause.category, s.category), s.near, i)
            for i, s in enumerate(self.things)
            if class_match(clause.category, s.category)
            and (not clause.color or s.color == clause.color)
            and (
                not clause.landmark
                or s.near > _SEEN_AROUND
                or self.beside(s, clause.landmark) <= _BESIDE
            )
        ]
        best = min((rank for rank, _, _ in found), default=0)
        return [self.things[i] for rank, _, i in sorted(found) if rank == best]

    def beside(self, sight: Sight, landmark: str) -> float:
        """Returns how far a thing or door is from the nearest landmark of a class, metres.

        Infinite where no such landmark is in view.
        """
        marks = self.matching(Clause("see", landmark))
        return min((math.dist(sight.position, m.position) for m in marks), default=math.inf)


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
        exits=find_exits(doors, floors, room, views),
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
            framed = any(inside(floor, d) and floor.near > d.distance for d in doors)
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
