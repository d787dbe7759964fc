"""What goes wrong on the way out: refusals, wrong directions, texts that cannot be used."""

from __future__ import annotations

import json
import math
import re
from typing import Any

from unilavira_drake.errors import ReplyRefused
from unilavira_drake.messages import DIRECTIONS, VIEW_YAW
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.mllm.rules.dials import RulesDials
from unilavira_drake.mllm.rules.draws import Draws
from unilavira_drake.mllm.rules.option import Option

_STEP = (0.5, 3.5)
"""Shortest and longest move that is meant in a wrong direction, metres."""
_MARGIN = 0.6
"""What is left of the free floor ahead, metres."""
_ORDER = re.compile(r"Target: .*", re.DOTALL)
_PROSE = "I have looked at the pictures and would go on from here, but let me think once more."


def refuse(request: MllmRequest, dials: RulesDials) -> None:
    """Refuses to answer, by chance.

    Raises:
        ReplyRefused: if it does.
    """
    if Draws.of(request, dials.seed).happens(dials.refused, "refused"):
        error = ReplyRefused(f"rules: refused by its dial refused={dials.refused}.")
        error.latency = dials.latency or None
        raise error


def misdirected(reply: dict[str, Any], request: MllmRequest, dials: RulesDials) -> dict[str, Any]:
    """Returns a reply whose turn, by chance, leads in one of the other directions.

    It believes in it: the rest of the reply stays, and what is to be grounded is the floor there.
    A direction that the request excludes is never named.
    """
    variables, draws = request.variables, Draws.of(request, dials.seed)
    action = reply.get("action", {})
    if action.get("tool") != "turn" or not isinstance(variables, LanguageVariables):
        return reply
    if not draws.happens(dials.wrong_direction, "direction"):
        return reply
    excluded = (action["direction"], variables.failed_direction)
    direction = draws.choice([word for word in DIRECTIONS if word not in excluded], "led astray")
    free = next((view.free_distance for view in variables.views if view.direction == direction), 0)
    reach = min(max(free - _MARGIN, _STEP[0]), _STEP[1])
    order = Option(direction, math.degrees(VIEW_YAW[direction]), reach, "open floor", 0.0, "").order
    return {
        **reply,
        "reasoning_action": _ORDER.sub(order, reply["reasoning_action"]),
        "action": {"tool": "turn", "direction": direction},
    }


def written(reply: dict[str, Any], request: MllmRequest, dials: RulesDials) -> str:
    """Returns the text of a reply, which by chance is of no use.

    It is then cut off, words without JSON, or JSON without its first field.
    """
    text, draws = json.dumps(reply, ensure_ascii=False), Draws.of(request, dials.seed)
    if not draws.happens(dials.malformed, "malformed"):
        return text
    rest = dict(list(reply.items())[1:])
    forms = (text[: len(text) // 2], _PROSE, json.dumps(rest, ensure_ascii=False))
    return draws.choice(forms, "form")
