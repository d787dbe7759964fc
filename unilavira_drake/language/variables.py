"""From what the ports carry to the typed variables of a language prompt."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from unilavira_drake.language.bearings import direction_note
from unilavira_drake.language.people_notes import people_in_view
from unilavira_drake.messages import (
    DecisionRecord,
    Edge,
    Frame,
    History,
    KeyPicture,
    LanguageAction,
    Panorama,
    SecondChance,
    TodoList,
    Waypoint,
    direction_of,
)
from unilavira_drake.messages.people import PeopleTracks
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.request import (
    OTHER_FLOOR,
    VIEW_LABEL,
    DecisionNote,
    ImagePart,
    LanguageVariables,
    MllmRequest,
    ViewNote,
    WaypointNote,
)
from unilavira_drake.tasks import TaskSpec

FLOORS_APART = 1.2
"""A place higher or lower than this is on another floor, metres."""


def language_request(
    *,
    call: str,
    seed: int,
    task: TaskSpec,
    panorama: Panorama,
    history: History,
    second_chance: SecondChance | None,
    todo: TodoList | None,
    last_action: LanguageAction,
    can_climb: bool,
    free_distance: Callable[[Frame], float],
    detector: Callable[[Frame], ViewEvidence] | None,
    view_detail: str = "medium",
    history_detail: str = "low",
    people: PeopleTracks | None = None,
    time: float = 0.0,
    stairs_barred: bool = False,
    reach: float = 0.0,
) -> MllmRequest:
    """Returns the first attempt of call ``panorama.n``.

    ``second_chance`` and ``todo`` are None when SCB and TDM are not wired.  The detector's
    evidence is added only when one is given, that is for a model declared ``ground_truth``.
    ``people`` are told of beside the views, as they were seen up to ``time``; None where nobody is
    looked for.  Its images are the pictures of the past, oldest first, those of a failed leg that
    the history no longer shows, and the views; no picture is sent twice.
    """
    failed_frames = () if second_chance is None else second_chance.failed_frames
    rejected = last_action.call == "double_check" and last_action.confirmed is False
    variables = LanguageVariables(
        family=task.family,
        task=task.text,
        views=tuple(
            ViewNote(
                direction,
                round(free_distance(_over_floor(panorama, direction)), 2),
                () if people is None else people_in_view(people, panorama, direction, time),
            )
            for direction in panorama.directions
        ),
        people=people is not None,
        last_action=_last_action(last_action, history),
        outcome=panorama.outcome.words if last_action.n else "",
        rejection=last_action.reason if rejected else "",
        todo=None if todo is None else todo.items,
        todo_feedback=() if todo is None else todo.feedback,
        current_waypoint=history.current,
        waypoints=tuple(
            _waypoint_note(waypoint, panorama, history, second_chance)
            for waypoint in history.waypoints
        ),
        decisions=tuple(DecisionNote(d.n, decision_text(d)) for d in history.decisions),
        second_chance=second_chance is not None,
        failed_direction="" if second_chance is None else second_chance.failed_direction,
        failed_pictures=tuple(picture.name for picture in failed_frames),
        can_climb=can_climb,
        stairs_barred=stairs_barred,
        view_degrees=round(math.degrees(panorama.frame("front").intrinsics.horizontal_fov)),
        choices=task.choices,
        forgotten=_forgotten(history),
        in_flight=panorama.in_flight,
        reach=reach if panorama.in_flight else 0.0,
        compass=round(90.0 - math.degrees(panorama.yaw)) % 360.0 if panorama.in_flight else 0.0,
        bearings=direction_note(task.text, last_action, panorama, history)
        if call in ("decide", "recover")
        else None,
    )
    return MllmRequest(
        role="language",
        n=panorama.n,
        seed=seed,
        call=call,
        variables=variables,
        images=_past_images(history, failed_frames, history_detail)
        + tuple(
            ImagePart(f"{VIEW_LABEL}{d}", panorama.frame(d).jpeg, view_detail)
            for d in panorama.directions
        ),
        evidence=None
        if detector is None
        else tuple(detector(panorama.frame(direction)) for direction in panorama.directions),
    )


def _over_floor(panorama: Panorama, direction: str) -> Frame:
    """Returns a view with its height counted from the floor, also on an upper one."""
    frame, floor = panorama.frame(direction), panorama.position[2]
    if panorama.in_flight or floor == 0.0:
        return frame
    X_WC = np.array(frame.X_WC)
    X_WC[2, 3] -= floor
    return dataclasses.replace(frame, X_WC=X_WC)


_NOT_A_MOVE = {
    ("plan_todo", "stay"): "the plan was made",
    ("double_check", "stay"): "the stop was checked",
    ("decide", "double_check"): "asked to stop",
    ("recover", "double_check"): "asked to stop",
}


def decision_text(record: DecisionRecord) -> str:
    """Returns a past decision in words, e.g. ``turn left to 'white door': arrived``."""
    place = f"at waypoint {record.waypoint}"
    known = _NOT_A_MOVE.get((record.call, record.tool))
    if known is not None:
        return f"{place}: {known}"
    action = " ".join(part for part in (record.tool, record.argument) if part)
    target = f" to '{record.target_desc}'" if record.target_desc else ""
    return f"{place}: {action}{target}: {record.outcome}"


def _last_action(action: LanguageAction, history: History) -> str:
    if not action.n:
        return ""
    if history.decisions and history.decisions[-1].n == action.n:
        return decision_text(history.decisions[-1])
    return " ".join(part for part in (action.tool, action.argument) if part)


def _forgotten(history: History) -> tuple[int, ...]:
    """Returns the numbers that have left the buffer; numbers are given in order, from 1 on."""
    kept = {waypoint.id for waypoint in history.waypoints}
    return tuple(n for n in range(1, max(kept, default=0)) if n not in kept)


def _degrees(angle: float) -> float:
    return round(math.degrees(math.remainder(angle, 2 * math.pi)), 1)


def _waypoint_note(
    waypoint: Waypoint,
    panorama: Panorama,
    history: History,
    second_chance: SecondChance | None,
) -> WaypointNote:
    x, y, z = panorama.position
    dx, dy = waypoint.position[0] - x, waypoint.position[1] - y
    front = _front(waypoint, panorama, history)
    target, scene = waypoint.caption
    if not panorama.in_flight and abs(waypoint.position[2] - z) > FLOORS_APART:
        scene = OTHER_FLOOR + scene
    return WaypointNote(
        id=waypoint.id,
        distance=round(math.hypot(dx, dy), 2),
        bearing=_degrees(math.atan2(dy, dx) - panorama.yaw) if dx or dy else 0.0,
        heading=_degrees(waypoint.heading - panorama.yaw),
        target=target,
        scene=scene,
        tried=tuple(_edge_text(edge, front) for edge in _tried(waypoint, history, second_chance)),
        offered=second_chance is not None and waypoint.id in second_chance.offers,
        picture=next((p.name for p in history.keyframes if p.number == waypoint.picture), ""),
        height=round(waypoint.position[2] - z, 1) if panorama.in_flight else 0.0,
    )


def _tried(waypoint: Waypoint, history: History, second_chance: SecondChance | None) -> list[Edge]:
    """Returns the directions tried from a waypoint; failures are a second chance's to tell."""
    edges = [edge for edge in history.edges if edge.arrived]
    edges += () if second_chance is None else second_chance.failed_edges
    return sorted((e for e in edges if e.waypoint == waypoint.id), key=lambda edge: edge.n)


def _edge_text(edge: Edge, front: float) -> str:
    direction = direction_of(None if edge.bearing is None else edge.bearing - front)
    if edge.outcome == "returned":
        place = f" after waypoint {edge.to}" if edge.to is not None else ""
        return f"{direction}: given up{place}"
    place = f" at waypoint {edge.to}" if edge.to is not None else ""
    return f"{direction}: {edge.outcome}{place}"


def _front(waypoint: Waypoint, panorama: Panorama, history: History) -> float:
    """Returns the world yaw to which the four words refer at a waypoint, radians."""
    return panorama.yaw if waypoint.id == history.current else waypoint.heading


def _past_images(
    history: History, failed_frames: tuple[KeyPicture, ...], detail: str
) -> tuple[ImagePart, ...]:
    dropped = tuple(picture for picture in failed_frames if picture not in history.keyframes)
    return tuple(
        ImagePart(picture.label, picture.jpeg, detail) for picture in (*history.keyframes, *dropped)
    )
