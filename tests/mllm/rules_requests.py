"""Requests made by hand for ``rules`` with dials, and what it perceives of them."""

import dataclasses
import math

from unilavira_drake.messages import DIRECTIONS, TodoItem
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import (
    LanguageVariables,
    MllmRequest,
    ViewNote,
    VisionVariables,
    WaypointNote,
)
from unilavira_drake.mllm.rules import RulesDials
from unilavira_drake.mllm.rules.perception import perceived

PER_VIEW = 5


def within(count, total, probability, sigmas=4.0):
    spread = math.sqrt(total * probability * (1.0 - probability))
    return abs(count - total * probability) <= sigmas * spread


def view(direction, category="sofa"):
    things = (
        Detection(
            id=f"{direction}#{i}", category=category, color="red", room="kitchen", pixels=9000,
            box=(100.0 + i, 200.0, 300.0 + i, 320.0), point=(200.0 + i, 280.0), distance=2.5,
            point_distance=2.5,
        )
        for i in range(PER_VIEW)
    )  # fmt: skip
    return ViewEvidence(direction, detections=tuple(things))


def request(n, call="decide", category="sofa", **changes):
    if call == "ground":
        changes.setdefault("role", "vision")
        variables = VisionVariables(
            reasoning_action="Target: red sofa, about 2.5 m, 2 deg left of the front view's axis."
        )
    else:
        variables = LanguageVariables(
            task="Go to the red sofa.",
            views=tuple(ViewNote(d, 2.0 + i) for i, d in enumerate(DIRECTIONS)),
            todo=(TodoItem("Go to the red sofa"),),
            current_waypoint=1,
            waypoints=(WaypointNote(id=1),),
            failed_direction="back" if call == "recover" else "",
        )
    evidence = tuple(view(d, category) for d in DIRECTIONS)
    return dataclasses.replace(
        MllmRequest(n=n, call=call, variables=variables, evidence=evidence), **changes
    )


def seen(request_, **dials):
    """Returns (id, detection) of what is perceived."""
    views = perceived(request_, RulesDials(**dials)).evidence
    return {d.id: d for v in views for d in v.detections}
