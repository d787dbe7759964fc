"""Lower bounds: a random choice, the nearest unvisited floor, and always the same moves.

They speak the same replies as every other model and none of them reads the task.
"""

from __future__ import annotations

import hashlib
import json
import math
import random
from typing import Any

from unilavira_drake.errors import MllmError
from unilavira_drake.messages import DIRECTIONS, VIEW_YAW
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables

STOP_CHANCE = 0.1
"""Chance that ``random`` asks to stop, at each decision."""
FRONTIER_DECISIONS = 12
"""``frontier`` stops after this many decisions."""
FIXED_DECISIONS = 12
"""``fixed`` stops after this many decisions."""
_LEAST_FREE = 1.0
"""A view with less free floor along its axis is blocked, metres."""
_FLOOR_ROW = 0.62
"""Share of the image height at which floor a few metres ahead is looked for."""


class RandomModel:
    """Goes to a random point of a random view; stops by chance, never looks where it is."""

    name = "random"
    perception = "images"
    reasoning = "rules"
    box_space = "pixels"
    deadline = 60.0
    description = "random choices: a lower bound, not a model"

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request; equal requests get equal replies.

        Raises:
            MllmError: if the call is unknown.
        """
        generator = _generator(request)
        variables = request.variables
        if isinstance(variables, VisionVariables):
            u = generator.uniform(0.1, 0.9) * variables.width
            v = generator.uniform(0.55, 0.95) * variables.height
            return _completion(_point(u, v, "a random point", variables))
        if request.call in ("decide", "recover"):
            if generator.random() < STOP_CHANCE:
                return _completion(_action({"tool": "double_check"}, "a random stop"))
            direction = generator.choice(DIRECTIONS)
            action = {"tool": "turn", "direction": direction}
            return _completion(_action(action, "a random direction"))
        return _completion(_fixed_reply(request, self.name))

    def close(self) -> None:
        """Does nothing: there are no connections."""


class FrontierModel:
    """Goes where there is free floor and no visited place; stops after a fixed count."""

    name = "frontier"
    perception = "images"
    reasoning = "rules"
    box_space = "pixels"
    deadline = 60.0
    description = "goes to unvisited free floor and never reads the task: a lower bound"

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request; equal requests get equal replies.

        Raises:
            MllmError: if the call is unknown.
        """
        variables = request.variables
        if isinstance(variables, VisionVariables):
            return _completion(_floor_ahead(variables))
        if isinstance(variables, LanguageVariables) and request.call in ("decide", "recover"):
            if request.n > FRONTIER_DECISIONS:
                return _completion(_action({"tool": "double_check"}, "enough was seen"))
            direction = _frontier(variables, _generator(request))
            action = {"tool": "turn", "direction": direction}
            return _completion(_action(action, "free floor not visited yet"))
        return _completion(_fixed_reply(request, self.name))

    def close(self) -> None:
        """Does nothing: there are no connections."""


class FixedModel:
    """Goes ahead until the way is blocked, then the freest other way; stops after a fixed count.

    Neither the task nor the seed, the pictures or the history change what it does.
    """

    name = "fixed"
    perception = "images"
    reasoning = "rules"
    box_space = "pixels"
    deadline = 60.0
    description = "always the same moves, whatever the task: a lower bound"

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request; equal free distances get equal replies.

        Raises:
            MllmError: if the call is unknown.
        """
        variables = request.variables
        if isinstance(variables, VisionVariables):
            return _completion(_floor_ahead(variables))
        if isinstance(variables, LanguageVariables) and request.call in ("decide", "recover"):
            if request.n > FIXED_DECISIONS:
                return _completion(_action({"tool": "double_check"}, "the sequence is over"))
            action = {"tool": "turn", "direction": _straight_on(variables)}
            return _completion(_action(action, "ahead, or the freest other way"))
        return _completion(_fixed_reply(request, self.name))

    def close(self) -> None:
        """Does nothing: there are no connections."""


def _straight_on(variables: LanguageVariables) -> str:
    """Returns ``front``, or where that is blocked the freest of left, right and back."""
    free = {view.direction: view.free_distance for view in variables.views}
    if free.get("front", 0.0) >= _LEAST_FREE:
        return "front"
    return max(("left", "right", "back"), key=lambda direction: free.get(direction, 0.0))


def _frontier(variables: LanguageVariables, generator: random.Random) -> str:
    """Returns the direction with the most free floor, less what lies near visited places."""
    scores = []
    for view in variables.views:
        if view.free_distance < _LEAST_FREE or view.direction not in VIEW_YAW:
            continue
        bearing = math.degrees(VIEW_YAW[view.direction])
        visits = sum(
            abs(math.remainder(w.bearing - bearing, 360.0)) < 45.0
            and w.distance < view.free_distance + 1.0
            for w in variables.waypoints
            if w.id != variables.current_waypoint
        )
        here = (w for w in variables.waypoints if w.id == variables.current_waypoint)
        tried = sum(text.startswith(view.direction) for w in here for text in w.tried)
        score = min(view.free_distance, 5.0) - 3.0 * visits - 4.0 * tried
        scores.append((score, generator.random(), view.direction))
    return max(scores)[2] if scores else generator.choice(DIRECTIONS)


def _generator(request: MllmRequest) -> random.Random:
    key = f"{request.seed}/{request.role}/{request.n}/{request.attempt}".encode()
    return random.Random(int.from_bytes(hashlib.sha256(key).digest()[:8], "big"))


def _completion(reply: dict[str, Any]) -> Completion:
    return Completion(json.dumps(reply), Usage(cost_usd=0.0))


def _point(u: float, v: float, target: str, variables: VisionVariables) -> dict[str, Any]:
    space = BOX_SPACES[variables.box_space]
    return {
        "target_desc": target,
        "box": None,
        "point": space.from_pixels_point((u, v), variables.width, variables.height),
        "confidence": None,
        "reason": "chosen without looking at the picture",
    }


def _floor_ahead(variables: VisionVariables) -> dict[str, Any]:
    u, v = variables.width / 2.0, _FLOOR_ROW * variables.height
    return _point(u, v, "floor ahead", variables)


def _action(action: dict[str, Any], why: str) -> dict[str, Any]:
    return {
        "progress_analysis": "not judged",
        "reasoning_todo": "the task is not read",
        "todo_updates": [],
        "reasoning_action": why,
        "action": action,
        "scene": "",
    }


def _fixed_reply(request: MllmRequest, name: str) -> dict[str, Any]:
    call, variables = request.call, request.variables
    if call == "plan_todo":
        return {"reasoning": f"{name} does not read the task", "todo": ["Move through the place"]}
    if call == "double_check":
        return {"reasoning": f"{name} does not check", "confirmed": True, "reason": ""}
    if call == "answer":
        choices = variables.choices if isinstance(variables, LanguageVariables) else ()
        first = next(iter(choices), "unknown")
        return {"reasoning": f"{name} does not read the question", "evidence": [], "answer": first}
    raise MllmError(f"{name}: unknown call {call!r}.")
