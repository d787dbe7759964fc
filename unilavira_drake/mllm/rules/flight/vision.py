"""Grounding in flight: finds in one view what the language model's sentence asks for."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from unilavira_drake.messages import DOWN
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import VisionVariables
from unilavira_drake.mllm.rules.flight.moves import BELOW, OPEN_GROUND
from unilavira_drake.mllm.rules.flight.parser import parse_directive
from unilavira_drake.mllm.rules.flight.words import (
    GROUND,
    WAYS,
    landmark_class,
    landmark_match,
    looks,
)
from unilavira_drake.mllm.rules.vocabulary import color_name

_ORDER = re.compile(r"Target: (.+?), about ([\d.]+) m, ([\d.]+) deg (left|right) of")
_FILLED = 0.6
"""A thing that fills less of its box than this is pointed at."""
_AHEAD = 0.08
"""Open ground is marked this far below the horizon, share of the picture's height."""
_FAR_END = 0.2
"""A way is marked this far down from the upper end of what is seen of it, share of its height."""


def ground_in_flight(
    variables: VisionVariables, evidence: Sequence[ViewEvidence]
) -> dict[str, Any]:
    """Returns the reply to ``ground``, in the request's box space."""
    view = next((v for v in evidence if v.direction == variables.direction), None)
    reply = _nothing("there is no evidence for this view")
    if view is not None:
        reply = _mark(variables, view)
    space, size = BOX_SPACES[variables.box_space], (variables.width, variables.height)
    if reply["box"] is not None:
        reply["box"] = space.from_pixels_box(reply["box"], *size)
    if reply["point"] is not None:
        reply["point"] = space.from_pixels_point(reply["point"], *size)
    return reply


def _mark(variables: VisionVariables, view: ViewEvidence) -> dict[str, Any]:
    found = _ORDER.search(variables.reasoning_action)
    if found is None:
        return _free_text(variables, view)
    target, off = found.group(1), float(found.group(3))
    bearing = off if found.group(4) == "left" else -off
    if target == BELOW and view.direction == DOWN:
        middle = [view.width / 2.0, view.height / 2.0]
        return _reply(BELOW, "straight below", point=middle)
    if target in (OPEN_GROUND, "open floor"):
        return _open_ground(view, bearing)
    named = [d for d in view.detections if _name(d) == target]
    if not named:
        return _nothing(f"no {target} in this view")
    distance = float(found.group(2))
    best = min(named, key=lambda d: (_misfit(view, d, distance, bearing), d.id))
    return _marked(target, best, view)


def _name(d: Detection) -> str:
    category = landmark_class(d.room if d.category == "floor" and d.room else d.category)
    return f"{color_name(d.color)} {category}".strip()


def _misfit(view: ViewEvidence, d: Detection, distance: float, bearing: float) -> float:
    off = 0.0
    if view.direction != DOWN:
        off = abs(math.degrees(view.bearing(d.point[0])) - bearing) / 10.0
    return off + min(abs(d.distance - distance), abs(d.point_distance - distance))


def _marked(name: str, d: Detection, view: ViewEvidence) -> dict[str, Any]:
    category = landmark_class(d.room if d.category == "floor" and d.room else d.category)
    if category in WAYS and view.direction != DOWN:
        u = (d.box[0] + d.box[2]) / 2.0 if d.pixels > _FILLED * _area(d) else d.point[0]
        v = d.box[1] + _FAR_END * (d.box[3] - d.box[1])
        return _reply(name, f"the far part of {d.id}", point=[u, min(v, d.point[1])])
    if category in GROUND or d.pixels < _FILLED * _area(d):
        return _reply(name, f"detection {d.id}", point=[*d.point])
    return _reply(name, f"detection {d.id}", box=[*d.box])


def _area(d: Detection) -> float:
    return (d.box[2] - d.box[0]) * (d.box[3] - d.box[1])


def _open_ground(view: ViewEvidence, bearing: float) -> dict[str, Any]:
    """Marks the farthest ground near a bearing, else the farthest thing to fly over."""
    if not view.detections:
        return _nothing("nothing but sky is in this view")

    def worth(d: Detection) -> float:
        off = abs(math.degrees(view.bearing(d.point[0])) - bearing)
        flat = landmark_class(d.category) in GROUND or d.category == "floor"
        return d.point_distance - 0.5 * off + (20.0 if flat else 0.0)

    focal = view.width / (2.0 * math.tan(view.horizontal_fov / 2.0))
    u = view.width / 2.0 - focal * math.tan(math.radians(min(max(bearing, -40.0), 40.0)))
    ahead = [u, (0.5 + _AHEAD) * view.height]
    best = max(view.detections, key=lambda d: (_holds(d, ahead), round(worth(d), 3), d.id))
    point = ahead if _holds(best, ahead) else [*best.point]
    return _reply(f"{OPEN_GROUND} towards the {_name(best)}", f"detection {best.id}", point=point)


def _holds(d: Detection, pixel: list[float]) -> bool:
    """Whether a pixel lies in the box of something flat."""
    flat = landmark_class(d.category) in GROUND or d.category == "floor"
    u_min, v_min, u_max, v_max = d.box
    return flat and u_min <= pixel[0] <= u_max and v_min <= pixel[1] <= v_max


def _free_text(variables: VisionVariables, view: ViewEvidence) -> dict[str, Any]:
    """Grounds a sentence in other words, then the plan's open items, then the ground."""
    texts = [variables.reasoning_action]
    texts += [item.content for item in variables.todo or () if item.status == "pending"]
    for text in texts:
        for leg in reversed(parse_directive(text)):
            for d in view.detections:
                category = landmark_class(d.category)
                if leg.landmark and landmark_match(leg.landmark, category):
                    above = view.direction == DOWN
                    if looks(leg.color, leg.roof, d.color, above=above):
                        return _marked(_name(d), d, view)
    return _open_ground(view, 0.0)


def _reply(target: str, why: str, **selected: Any) -> dict[str, Any]:
    return {
        "target_desc": target[:120],
        "box": selected.get("box"),
        "point": selected.get("point"),
        "confidence": 1.0 if selected else None,
        "reason": why,
    }


def _nothing(why: str) -> dict[str, Any]:
    return _reply("", why)
