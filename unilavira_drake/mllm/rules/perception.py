"""What ``rules`` perceives of a request: worse detections, and the history within a window."""

from __future__ import annotations

import dataclasses
import re

from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.mllm.rules.confusion import similar
from unilavira_drake.mllm.rules.dials import RulesDials
from unilavira_drake.mllm.rules.draws import Draws
from unilavira_drake.mllm.rules.vocabulary import room_kind, thing_class

_BORDER = 2.0
"""An edge this close to the picture's border lies on it, pixels."""
_PLACE = re.compile(r"at waypoint (\d+):")


def perceived(request: MllmRequest, dials: RulesDials) -> MllmRequest:
    """Returns the request as it is perceived; with all dials zero it is the same."""
    if dials.forgets_after and isinstance(request.variables, LanguageVariables):
        variables = _remembered(request.variables, dials.forgets_after)
        request = dataclasses.replace(request, variables=variables)
    if request.evidence and (dials.label_dropout or dials.box_jitter or dials.confusion):
        draws = Draws.of(request, dials.seed)
        evidence = tuple(_seen(view, dials, draws) for view in request.evidence)
        request = dataclasses.replace(request, evidence=evidence)
    return request


def _remembered(variables: LanguageVariables, window: int) -> LanguageVariables:
    """Returns the variables with the last decisions, their waypoints and the latest ones."""
    decisions = variables.decisions[-window:]
    known = {variables.current_waypoint}
    known |= {int(number) for note in decisions for number in _PLACE.findall(note.text)}
    known |= set(sorted(note.id for note in variables.waypoints)[-window:])
    waypoints = tuple(note for note in variables.waypoints if note.id in known)
    return dataclasses.replace(variables, decisions=decisions, waypoints=waypoints)


def _seen(view: ViewEvidence, dials: RulesDials, draws: Draws) -> ViewEvidence:
    detections = []
    for detection in view.detections:
        thing = f"{view.direction}/{detection.id}"
        if draws.happens(dials.label_dropout, "dropout", thing):
            continue
        if draws.happens(dials.confusion, "confusion", thing):
            detection = _confused(detection, draws, thing)
        if dials.box_jitter:
            detection = _jittered(detection, view, dials.box_jitter, draws, thing)
        detections.append(detection)
    return dataclasses.replace(view, detections=tuple(detections))


def _confused(detection: Detection, draws: Draws, thing: str) -> Detection:
    """Returns a detection with a similar class or room, or the same where nothing is similar."""
    is_floor = detection.category == "floor"
    name = room_kind(detection.room) if is_floor else thing_class(detection.category)
    others = similar(name)
    if not others:
        return detection
    other = draws.choice(others, "taken for", thing)
    if is_floor:
        return dataclasses.replace(detection, room=other)
    return dataclasses.replace(detection, category=other)


def _jittered(
    detection: Detection, view: ViewEvidence, share: float, draws: Draws, thing: str
) -> Detection:
    u_min, v_min, u_max, v_max = detection.box
    spread_u, spread_v = share * (u_max - u_min), share * (v_max - v_min)
    moved = [
        _edge(value, spread, side, draws.normal("jitter", name, thing))
        for name, value, spread, side in (
            ("u_min", u_min, spread_u, view.width),
            ("v_min", v_min, spread_v, view.height),
            ("u_max", u_max, spread_u, view.width),
            ("v_max", v_max, spread_v, view.height),
        )
    ]
    u, v = detection.point
    u += spread_u * draws.normal("jitter", "u", thing)
    v += spread_v * draws.normal("jitter", "v", thing)
    return dataclasses.replace(
        detection,
        box=(
            min(moved[0], moved[2]),
            min(moved[1], moved[3]),
            max(moved[0], moved[2]),
            max(moved[1], moved[3]),
        ),
        point=(_clipped(u, view.width - 1.0), _clipped(v, view.height - 1.0)),
    )


def _edge(value: float, spread: float, side: int, normal: float) -> float:
    if value <= _BORDER or value >= side - _BORDER:
        return value
    return _clipped(value + spread * normal, float(side))


def _clipped(value: float, most: float) -> float:
    return min(max(value, 0.0), most)
