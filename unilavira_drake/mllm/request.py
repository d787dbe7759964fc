"""One question to a model.

A request carries *typed prompt variables*: the templates in ``prompts/`` turn them into text for
a real model, and the offline backends read the same variables.  Bearings are degrees to the left
of ``front``, distances metres.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from dataclasses import dataclass
from typing import Any

from unilavira_drake.messages import ON_THE_WAY, Message, TodoItem
from unilavira_drake.mllm.evidence import ViewEvidence


@dataclass(frozen=True)
class ViewNote(Message):
    """What the prompt says of a view beside its picture."""

    direction: str = "front"
    free_distance: float = 0.0
    """Measured free distance along the view's axis, metres."""
    people: tuple[str, ...] = ()
    """Who is there and moves how, e.g. ``person in blue, 2.1 m, walking towards you``."""


OTHER_FLOOR = "on another floor: "
"""Begins what is told of a place that is not on the robot's floor."""


@dataclass(frozen=True)
class WaypointNote(Message):
    """A remembered place, told relative to where the robot is now (``front`` = 0 degrees)."""

    id: int = 0
    distance: float = 0.0
    bearing: float = 0.0
    heading: float = 0.0
    """Where this waypoint's own ``front`` points, degrees left of the present ``front``."""
    scene: str = ""
    """What it saw there."""
    tried: tuple[str, ...] = ()
    """One text a direction tried from there, e.g. ``left: arrived at waypoint 3``."""
    offered: bool = False
    """Whether ``backtrack`` may name it."""
    picture: str = ""
    """Name of the picture of its front view, e.g. ``H3``; empty when no picture shows it."""
    target: str = ""
    """What the robot went there for."""
    height: float = 0.0
    """In flight: metres higher than the robot is now."""

    @property
    def caption(self) -> str:
        """Target and scene in one line."""
        return "; ".join(part for part in (self.target, self.scene) if part)


@dataclass(frozen=True)
class DecisionNote(Message):
    """One past decision in the history window."""

    n: int = 0
    text: str = ""
    """E.g. ``turn left to 'white door': arrived``."""


@dataclass(frozen=True)
class DirectionNote(Message):
    """The direction-constrained module of the paper (V): what is known where vision failed.

    Nothing of it is the goal that scores the task: a goal direction is
    told only if the task's own words state one.
    """

    now: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Present pose as seen from the start: metres along the first ``front``, to its left and
    higher, and yaw in degrees to the left of it."""
    goal_distance: float | None = None
    """Metres along the ground to the place that the task's words state; None: they state none."""
    goal_bearing: float = 0.0
    """Degrees to the left of the present front."""


@dataclass(frozen=True)
class LanguageVariables(Message):
    """Everything a language prompt may say."""

    family: str = "vln"
    task: str = ""
    views: tuple[ViewNote, ...] = ()
    last_action: str = ""
    """The previous action and its outcome in words; empty at the first call."""
    outcome: str = ""
    """``arrived`` | ``on the way`` (in flight) | ``failed: reason`` of the previous action; empty
    at the first call."""
    rejection: str = ""
    """Why the last double check was rejected; empty when it was not."""
    todo: tuple[TodoItem, ...] | None = None
    """None without TODO List Memory."""
    todo_feedback: tuple[str, ...] = ()
    current_waypoint: int = 0
    waypoints: tuple[WaypointNote, ...] = ()
    decisions: tuple[DecisionNote, ...] = ()
    second_chance: bool = True
    """Whether ``backtrack`` exists (SCB)."""
    failed_direction: str = ""
    """On ``recover``: the direction that failed from here."""
    failed_pictures: tuple[str, ...] = ()
    """On ``recover``: names of the pictures of the way that failed, e.g. ``H5``."""
    can_climb: bool = False
    stairs_barred: bool = False
    """Whether there are stairs that the robot cannot take: all it can do is on this floor."""
    view_degrees: int = 79
    """How wide a view is, degrees."""
    choices: tuple[str, ...] = ()
    """The closed vocabulary of a question's answer; empty when any words will do."""
    forgotten: tuple[int, ...] = ()
    """Numbers of the waypoints that the buffer had no room for any more."""
    in_flight: bool = False
    """Whether the robot flies: there is a view straight down."""
    people: bool = False
    """Whether people are told of beside the views."""
    reach: float = 0.0
    """In flight: how far one move goes, metres."""
    compass: float = 0.0
    """In flight: where ``front`` looks, degrees clockwise from north, which is the world's y."""
    bearings: DirectionNote | None = None
    """In flight, where vision could not ground the last view: what to reason on instead."""

    @property
    def failed_edges(self) -> tuple[str, ...]:
        """What is told as failed or given up, e.g. ``waypoint 2, left: failed: stuck``."""
        return tuple(
            f"waypoint {note.id}, {text}"
            for note in self.waypoints
            for text in note.tried
            if not text.partition(": ")[2].startswith(("arrived", ON_THE_WAY))
        )


@dataclass(frozen=True)
class VisionVariables(Message):
    """Everything a vision prompt may say."""

    family: str = "vln"
    task: str = ""
    direction: str = "front"
    progress_analysis: str = ""
    reasoning_action: str = ""
    stair: str = ""
    todo: tuple[TodoItem, ...] | None = None
    width: int = 640
    height: int = 480
    box_space: str = "pixels"
    """How this model writes places in a picture, a key of ``boxes.BOX_SPACES``."""
    in_flight: bool = False
    """Whether the robot flies."""


@dataclass(frozen=True)
class FreeVariables(Message):
    """A text that is sent to the model word for word, outside of any episode."""

    text: str = ""


VIEW_LABEL = "view "
"""Begins the label of a picture that was taken just now; the direction follows."""


@dataclass(frozen=True)
class ImagePart(Message):
    """A labelled JPEG image of a request."""

    label: str = ""
    jpeg: bytes = b""
    detail: str = "high"
    """How finely the model should look at it: ``low`` | ``medium`` | ``high``; each provider has
    its own price for each."""


@dataclass(frozen=True)
class MllmRequest(Message):
    """One attempt of one call to one model; (role, n, attempt) names it within an episode."""

    role: str = "language"
    """``language`` | ``vision``; ``judge`` for the judge of an answer, no part of the agent."""
    n: int = 0
    attempt: int = 0
    seed: int = 0
    call: str = ""
    """One of ``messages.CALLS`` for language, ``ground`` for vision; ``free`` for a free text."""
    variables: LanguageVariables | VisionVariables | FreeVariables = LanguageVariables()
    images: tuple[ImagePart, ...] = ()
    evidence: tuple[ViewEvidence, ...] | None = None
    """Only for a model that declares ``perception: ground_truth``."""
    feedback: str = ""
    """On a re-ask: what was wrong with the reply to the previous attempt."""

    @property
    def picture_names(self) -> tuple[str, ...]:
        """How a reply names its pictures: ``front`` and the other views, ``H3`` of the past."""
        labels = (image.label.removeprefix(VIEW_LABEL) for image in self.images)
        return tuple(label.partition(":")[0] for label in labels)

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of the content; images count by their own hash."""
        return hashlib.sha256(json.dumps(_plain(self), sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
