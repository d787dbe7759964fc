"""Grounding: finds in one view what the language model's sentence asks for."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import VisionVariables
from unilavira_drake.mllm.rules.floor_camera import FloorCamera
from unilavira_drake.mllm.rules.lexicon import tokenize
from unilavira_drake.mllm.rules.vocabulary import (
    HUBS,
    STAIRS,
    class_match,
    color_name,
    room_kind,
    thing_class,
)

_ORDER = re.compile(r"Target: (.+?), about ([\d.]+) m, ([\d.]+) deg (left|right) of")
_INSIDE = 1.2
"""How far behind a door the robot is to go, metres."""
_FAR = 9.0
"""A thing farther than this is near the end of the depth camera's range, metres ..."""
_STRIDE = 5.0
"""... and is approached over the floor first, metres."""
_FILLED = 0.6
"""A thing that fills less of its box than this is pointed at."""
_INSIDE_HUB = 0.8
"""The same for corridors, which are narrow."""


def ground(variables: VisionVariables, evidence: Sequence[ViewEvidence]) -> dict[str, Any]:
    """Returns the reply to ``ground``: a box, or a point on the floor, or why there is neither.

    It is written in the request's box space, as every model's reply is.
    """
    reply = _selection(variables, evidence)
    space, size = BOX_SPACES[variables.box_space], (variables.width, variables.height)
    if reply["box"] is not None:
        reply["box"] = space.from_pixels_box(reply["box"], *size)
    if reply["point"] is not None:
        reply["point"] = space.from_pixels_point(reply["point"], *size)
    return reply


def _selection(variables: VisionVariables, evidence: Sequence[ViewEvidence]) -> dict[str, Any]:
    """Returns the same in pixels of the view."""
    view = next((v for v in evidence if v.direction == variables.direction), None)
    if view is None:
        return _nothing("there is no evidence for this view")
    if variables.stair:
        return _stairs(view)
    found = _ORDER.search(variables.reasoning_action)
    if found is None:
        return _free_text(variables, view)
    target, distance, off = found.group(1), float(found.group(2)), float(found.group(3))
    bearing = off if found.group(4) == "left" else -off
    if target == "open floor":
        return _open_floor(view, distance, bearing)
    if " beyond the " in target:
        room = target.partition(" beyond the ")[0].removeprefix("floor of the ")
        return _beyond(view, room, distance, bearing)
    if target.startswith("floor of the "):
        return _floor(view, target.removeprefix("floor of the "), bearing)
    return _thing(view, target, distance, bearing)


def _stairs(view: ViewEvidence) -> dict[str, Any]:
    """Selects the stairs of a view: their steps as far as they are seen."""
    seen = [d for d in view.detections if d.category == STAIRS]
    if not seen:
        return _nothing("no stairs in this view")
    d = max(seen, key=lambda d: (d.pixels, d.id))
    return _reply(STAIRS, f"detection {d.id}", box=[*d.box])


def _reply(target: str, why: str, **selected: Any) -> dict[str, Any]:
    return {
        "target_desc": target,
        "box": selected.get("box"),
        "point": selected.get("point"),
        "confidence": 1.0 if selected else None,
        "reason": why,
    }


def _nothing(why: str) -> dict[str, Any]:
    return _reply("", why)


def _degrees(view: ViewEvidence, u: float) -> float:
    return math.degrees(view.bearing(u))


def _misfit(view: ViewEvidence, d: Detection, u: float, distance: float, bearing: float) -> float:
    own = d.point_distance if d.category == "floor" else d.distance
    return abs(_degrees(view, u) - bearing) / 10.0 + abs(own - distance)


def _thing(view: ViewEvidence, name: str, distance: float, bearing: float) -> dict[str, Any]:
    candidates = []
    for d in view.detections:
        own = f"{color_name(d.color)} {thing_class(d.category)}".strip()
        if own == name or thing_class(d.category) == name:
            middle = (d.box[0] + d.box[2]) / 2
            candidates.append((_misfit(view, d, middle, distance, bearing), d.id, d))
    if not candidates:
        return _nothing(f"no {name} in this view")
    d = min(candidates)[2]
    if d.category == "door":
        middle, foot = (d.box[0] + d.box[2]) / 2, min(d.box[3], view.height - 1.0) - 2.0
        return _reply(name, "the floor in the opening", point=[middle, foot])
    if d.distance > _FAR:
        return _towards(view, f"the {name}", _degrees(view, (d.box[0] + d.box[2]) / 2))
    area = (d.box[2] - d.box[0]) * (d.box[3] - d.box[1])
    if d.pixels < _FILLED * area:
        # Most of the box shows what is behind a thin thing.
        return _reply(name, f"detection {d.id}", point=[*d.point])
    return _reply(name, f"detection {d.id}", box=[*d.box])


def _floor_of(view: ViewEvidence, room: str, bearing: float) -> Detection | None:
    floors = [d for d in view.detections if d.category == "floor" and room_kind(d.room) == room]
    return min(
        floors, key=lambda d: (abs(_degrees(view, d.point[0]) - bearing), d.id), default=None
    )


def _floor(view: ViewEvidence, room: str, bearing: float) -> dict[str, Any]:
    floor = _floor_of(view, room, bearing)
    if floor is None:
        return _nothing(f"no floor of the {room} in this view")
    if floor.point_distance > _FAR:
        return _towards(view, f"the {room}", _degrees(view, floor.point[0]))
    return _reply(f"floor of the {room}", f"detection {floor.id}", point=[*floor.point])


def _towards(view: ViewEvidence, what: str, bearing: float) -> dict[str, Any]:
    """Selects floor on the way to what is too far for the depth camera."""
    return {**_open_floor(view, _STRIDE, bearing), "target_desc": f"floor towards {what}"}


def _beyond(view: ViewEvidence, room: str, distance: float, bearing: float) -> dict[str, Any]:
    """Selects floor a step behind a door, on a line of sight through its opening."""
    floor = _floor_of(view, room, bearing)
    if floor is None:
        return _nothing(f"no floor of the {room} in this view")
    if floor.point_distance > _FAR and distance > _STRIDE:
        return _towards(view, f"the {room}", bearing)
    camera = FloorCamera.fit([view])
    goal = distance + (_INSIDE_HUB if room in HUBS else _INSIDE)
    u_min, v_min, u_max, v_max = floor.box
    door = _door_of(view, floor, distance)
    columns = [floor.point[0]]
    if door is not None:
        columns.insert(0, (door.box[0] + door.box[2]) / 2)
    for u in columns:
        row = camera.row(u, goal)
        inside = u_min + 2.0 <= u <= u_max - 2.0 and v_min + 2.0 <= row <= v_max - 2.0
        if inside:
            return _reply(f"door to the {room}", f"detection {floor.id}", point=[u, row])
    return _reply(f"door to the {room}", f"detection {floor.id}", point=[*floor.point])


def _door_of(view: ViewEvidence, floor: Detection, distance: float) -> Detection | None:
    """Returns the door, wholly in view, through whose opening a floor is seen."""
    doors = [
        d
        for d in view.detections
        if d.category == "door"
        and d.box[0] > 2.0
        and d.box[2] < view.width - 2.0
        and d.box[0] <= floor.point[0] <= d.box[2]
    ]
    return min(doors, key=lambda d: (abs(d.distance - distance), d.id), default=None)


def _open_floor(view: ViewEvidence, distance: float, bearing: float) -> dict[str, Any]:
    focal = view.width / (2.0 * math.tan(view.horizontal_fov / 2.0))
    u = view.width / 2.0 - focal * math.tan(math.radians(bearing))
    u = min(max(u, 1.0), view.width - 2.0)
    row = FloorCamera.fit([view]).row(u, distance)
    return _reply("open floor", f"floor {distance:.1f} m ahead", point=[u, row])


def _free_text(variables: VisionVariables, view: ViewEvidence) -> dict[str, Any]:
    """Grounds a sentence in other words, then the plan's open items, then the farthest floor."""
    texts = [variables.reasoning_action]
    texts += [item.content for item in variables.todo or () if item.status == "pending"]
    for text in texts:
        for token in reversed(tokenize(text)):
            for d in view.detections:
                if token.kind == "thing" and class_match(token.value, thing_class(d.category)):
                    name = f"{d.color} {d.category}".strip()
                    return _thing(view, name, d.distance, _degrees(view, d.point[0]))
                is_floor = d.category == "floor" and token.kind == "room"
                if is_floor and room_kind(d.room) == token.value:
                    return _floor(view, token.value, _degrees(view, d.point[0]))
    floors = [d for d in view.detections if d.category == "floor"]
    if not floors:
        return _nothing("nothing that was asked for and no floor is in this view")
    far = max(floors, key=lambda d: (d.point_distance, d.id))
    return _reply("open floor", f"detection {far.id}", point=[*far.point])
