"""One question to a model, and its answer.

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
from typing import Any, Protocol

from unilavira_drake.messages import Message, TodoItem
from unilavira_drake.mllm.evidence import ViewEvidence


@dataclass(frozen=True)
class ViewNote(Message):
    """What the prompt says of a view beside its picture."""

    direction: str = "front"
    free_distance: float = 0.0
    """Measured free distance along the view's axis, metres."""


@dataclass(frozen=True)
class WaypointNote(Message):
    """A remembered place, told relative to where the robot is now (``front`` = 0 degrees)."""

    id: int = 0
    distance: float = 0.0
    bearing: float = 0.0
    heading: float = 0.0
    """Where this waypoint's own ``front`` points, degrees left of the present ``front``."""
    caption: str = ""
    tried: tuple[str, ...] = ()
    """One text a direction tried from there, e.g. ``left: arrived at waypoint 3``."""
    offered: bool = False
    """Whether ``backtrack`` may name it."""


@dataclass(frozen=True)
class DecisionNote(Message):
    """One past decision in the history window."""

    n: int = 0
    text: str = ""
    """E.g. ``turn left to 'white door': arrived``."""


@dataclass(frozen=True)
class LanguageVariables(Message):
    """Everything a language prompt may say."""

    family: str = "vln"
    task: str = ""
    views: tuple[ViewNote, ...] = ()
    last_action: str = ""
    """The previous action and its outcome in words; empty at the first call."""
    outcome: str = ""
    """``arrived`` | ``failed: reason`` of the previous action; empty at the first call."""
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
    failed_edges: tuple[str, ...] = ()
    failed_direction: str = ""
    """On ``recover``: the direction that failed from here."""
    can_climb: bool = False


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


@dataclass(frozen=True)
class ImagePart(Message):
    """A labelled JPEG image of a request."""

    label: str = ""
    jpeg: bytes = b""


@dataclass(frozen=True)
class MllmRequest(Message):
    """One attempt of one call to one model; (role, n, attempt) names it within an episode."""

    role: str = "language"
    """``language`` | ``vision``."""
    n: int = 0
    attempt: int = 0
    seed: int = 0
    call: str = ""
    """One of ``messages.CALLS`` for language, ``ground`` for vision."""
    variables: LanguageVariables | VisionVariables = LanguageVariables()
    images: tuple[ImagePart, ...] = ()
    evidence: tuple[ViewEvidence, ...] | None = None
    """Only for a model that declares ``perception: ground_truth``."""
    feedback: str = ""
    """On a re-ask: what was wrong with the reply to the previous attempt."""

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of the content; images count by their own hash."""
        return hashlib.sha256(json.dumps(_plain(self), sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Usage(Message):
    """What a reply cost; zero for models that count no tokens."""

    input_tokens: int = 0
    output_tokens: int = 0
    images: int = 0
    cost_usd: float | None = None

    def __add__(self, other: Usage) -> Usage:
        known = self.cost_usd is not None and other.cost_usd is not None
        return Usage(
            self.input_tokens + other.input_tokens,
            self.output_tokens + other.output_tokens,
            self.images + other.images,
            (self.cost_usd or 0.0) + (other.cost_usd or 0.0) if known else None,
        )


@dataclass(frozen=True)
class Completion(Message):
    """What a backend returns: the raw text and its cost."""

    text: str = ""
    usage: Usage = Usage()


@dataclass(frozen=True)
class MllmReply(Message):
    """A reply as it becomes visible on a port, or the named error that took its place."""

    n: int = 0
    attempt: int = 0
    text: str = ""
    error: str = ""
    usage: Usage = Usage()
    latency: float = 0.0
    """Simulated seconds from request to reply."""


class Mllm(Protocol):
    """A model backend: a deterministic function of one request, safe to call from a thread."""

    @property
    def name(self) -> str:
        """Name for results and the first line of a run."""

    @property
    def perception(self) -> str:
        """``ground_truth`` (gets the simulator's labels as evidence) or ``images``."""

    @property
    def reasoning(self) -> str:
        """``rules`` | ``model`` | ``human``."""

    @property
    def description(self) -> str:
        """One honest sentence about what this model is."""

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request.

        Raises:
            MllmError: if no reply can be had.
        """


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
