"""Real episodes, decided by a script: the whole system, only the two models are a test's own."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from unilavira_drake import EpisodeResult, load_scenario, model_pair, run_episode
from unilavira_drake.mapping.projection import project_to_pixel
from unilavira_drake.messages import Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables

Point = tuple[float, float]
Reply = dict[str, Any]


@dataclass
class Script:
    """A model that says what a script has for each number; the vision half marks floor points.

    An entry of the script is the reply to the language call of that number, and ``marks`` holds
    the floor point (x, y), metres in the world, to mark for it.  ``otherwise`` answers, by call,
    what the script leaves out.
    """

    replies: Mapping[int, Reply] = field(default_factory=dict)
    marks: Mapping[int, Point] = field(default_factory=dict)
    otherwise: Mapping[str, Reply] = field(default_factory=dict)
    name: str = "script"
    perception: str = "images"
    reasoning: str = "model"
    description: str = "a script"
    box_space: str = "pixels"
    deadline: float = 60.0
    requests: list[MllmRequest] = field(default_factory=list)
    panorama: Panorama = field(default_factory=Panorama)

    def complete(self, request: MllmRequest) -> Completion:
        """Answers from the script."""
        self.requests.append(request)
        if isinstance(request.variables, VisionVariables):
            return Completion(json.dumps(self._mark(request.n, request.variables.direction)))
        reply = self.replies.get(request.n) or self.otherwise[request.call]
        return Completion(json.dumps(reply))

    def close(self) -> None:
        """Does nothing."""

    def asked(self, n: int) -> MllmRequest:
        """Returns the language request of a number."""
        return next(r for r in self.requests if r.n == n and r.role == "language")

    def told(self, n: int) -> LanguageVariables:
        """Returns what the language prompt of a number says."""
        variables = self.asked(n).variables
        assert isinstance(variables, LanguageVariables)
        return variables

    def _mark(self, n: int, direction: str) -> Reply:
        frame = self.panorama.frame(direction)
        u, v, _ = project_to_pixel(
            (*self.marks[n], 0.0), intrinsics=frame.intrinsics, X_WC=frame.X_WC
        )
        assert 0 <= u < frame.intrinsics.width, f"mark {n} is not in the {direction} view"
        assert 0 <= v < frame.intrinsics.height, f"mark {n} is not in the {direction} view"
        return {
            "target_desc": f"floor {n}", "box": None, "point": [u, v], "confidence": 1.0,
            "reason": "",
        }  # fmt: skip


@dataclass
class Played:
    """An episode, and the messages of the ring in their order."""

    result: EpisodeResult
    messages: list[tuple[float, str, Any]]

    def of(self, event: str) -> list[Any]:
        """Returns the messages of one kind."""
        return [message for _, kind, message in self.messages if kind == event]

    def position_at(self, event: str, n: int) -> Point:
        """Returns where the robot really was when the message of this number appeared, to 0.3 m."""
        time = next(
            t
            for t, kind, message in self.messages
            if kind == event and getattr(message, "n", None) == n
        )
        return next(
            message.position
            for t, _, message in reversed(self.messages)
            if isinstance(message, EpisodeMetrics) and t <= time
        )

    def track(self) -> NDArray[np.float64]:
        """Returns where the robot really was, (k, 2) metres."""
        return np.array([metrics.position for metrics in self.of("metrics")])


def play(script: Script, overlay: str = "", **options: Any) -> Played:
    """Runs an episode of the scenario ``flat`` in which the script is both models."""
    messages: list[tuple[float, str, Any]] = []

    def listen(t: float, system: str, event: str, message: Any) -> None:
        if isinstance(message, Panorama):
            script.panorama = message
        messages.append((t, event, message))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model_pair, "make_backend", lambda spec, *, role, place: script)
        result = run_episode(load_scenario("flat", overlay), on_event=listen, **options)
    return Played(result, messages)


def turn(direction: str) -> Reply:
    return _decision({"tool": "turn", "direction": direction})


def backtrack(waypoint: int) -> Reply:
    return _decision({"tool": "backtrack", "waypoint": waypoint})


def ask_to_stop() -> Reply:
    return _decision({"tool": "double_check"})


def verdict(confirmed: bool, reason: str = "") -> Reply:
    return {"reasoning": "", "confirmed": confirmed, "reason": reason}


def _decision(action: Reply) -> Reply:
    return {"progress_analysis": "", "reasoning_action": "", "action": action, "scene": "here"}


def gap(a: Point, b: Point) -> float:
    """Returns the distance of two floor points, metres."""
    return math.dist(a[:2], b[:2])
