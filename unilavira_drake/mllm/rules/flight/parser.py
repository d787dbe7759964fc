"""Reads a flight directive: sentence by sentence, order by order.

A sentence is cut at commas and conjunctions before an order.  In each part the verb or preposition
before a landmark says what to do with it.  ``The target is 120 m at 30 degrees from you. It is a
red car.`` is a heading and a landmark.
"""

from __future__ import annotations

import dataclasses
import re

from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.words import WAYS, landmark_at
from unilavira_drake.mllm.rules.lexicon import words_of
from unilavira_drake.mllm.rules.vocabulary import COLOR_NAMES, color_name
from unilavira_drake.stated_direction import stated_direction

LOW = 8.0
"""Height to which one descends if no number is given, metres."""
CLIMB = 15.0
"""By which one climbs if no number is given, metres."""
MAX_LEGS = 30

_NUMBER = r"(\d+(?:\.\d+)?) ?(?:m|meters?|metres?)\b"
_UP = re.compile(r"\b(?:climb|rise|ascend|take off|gain height|go up|fly up)\b")
_DOWN = re.compile(r"\b(?:descend|sink|land|lower yourself|go down|come down|drop|fly down)\b")
_TO_HEIGHT = re.compile(rf"\b(?:to|at|of)(?: a height of| an altitude of)? {_NUMBER}")
_BY_HEIGHT = re.compile(rf"\b(?:by |another |)({_NUMBER})")
_START_HEADING = re.compile(
    rf"fly {_NUMBER} at (\d+) degrees to the (left|right) of the start", re.IGNORECASE
)
_TURN = re.compile(
    r"\b(?:turn|bear|veer|swing|head|bank) (?:to (?:the|your) )?(left|right)\b(?! of)"
)
_AROUND = re.compile(r"\bturn (?:around|round|back)\b")
_CUT = re.compile(
    r"[.;!?]\s+|\s*,\s*(?:and\s+)?(?:then\s+)?|\s+and\s+(?:then\s+)?(?=(?:fly|go|head|climb|rise|ascend|"
    r"descend|sink|land|turn|bear|stop|hover|pass|cross|follow|continue|find|finish|circle|end)\b)"
    r"|\s+then\s+|\s+until\s+|\s+till\s+"
)
_ROLES = (
    ("stop", r"stop|hover|halt|finish|end|land|wait|stay"),
    ("along", r"along|follow|following|down the|up the"),
    ("past", r"past|pass|passing|by the|leave the"),
    ("over", r"over|above|cross|crossing|across"),
    ("go", r"to|towards|toward|reach|reaching|find|approach|at|near|for|see|it is|looks like|is"),
)
_NEXT = re.compile(r"\b(?:to the|towards?|past|over|across|as far as|up to)\b")
"""Between two landmarks: the second is gone to as well, and does not tell where the first is."""
_BESIDE = re.compile(r"\b(?:near|beside|next to|by|in front of|behind|opposite|at|of|in|on)\b")


@dataclasses.dataclass(frozen=True)
class _Mention:
    """A landmark named in a part of a sentence, and where its words begin and end."""

    leg: Leg
    start: int
    end: int


def parse_directive(text: str, height: float = 0.0) -> tuple[Leg, ...]:
    """Returns the legs of a directive in their order.

    Args:
        text: the directive, or one leg in its own words.
        height: of the start above the ground, metres; a climb ``by`` counts from there.
    """
    own = _START_HEADING.search(text)
    if own is not None:
        sign = 1.0 if own.group(3).lower() == "left" else -1.0
        bearing = sign * float(own.group(2))
        return (Leg("heading", distance=float(own.group(1)), bearing=bearing),)
    legs: list[Leg] = []
    goals: list[Leg] = []
    for sentence in re.split(r"(?<=[.;!?])\s+", text.lower()):
        stated = stated_direction(sentence)
        if stated is not None:
            legs.insert(0, Leg("heading", distance=stated.distance, bearing=stated.bearing))
            goals += [mention.leg for mention in _mentions(sentence)[:1]]
            continue
        for part in _CUT.split(sentence.strip(" .;!?")):
            for leg in _part(part.strip(" .,"), height):
                started = part.strip().startswith("take off")
                changes = leg.kind in ("climb", "descend") and not started
                height = leg.height if changes else height
                legs.append(leg)
    named = {leg.landmark for leg in legs}
    legs += [goal for goal in goals if goal.landmark not in named]
    return tuple(_merged(legs)[:MAX_LEGS])


def plan_legs(text: str, height: float) -> tuple[Leg, ...]:
    """Returns the legs of a directive; at the last landmark it is stopped, others are only passed.

    Arguments as for :func:`parse_directive`.
    """
    legs = list(parse_directive(text, height))
    last = max((i for i, leg in enumerate(legs) if leg.landmark and leg.hard), default=None)
    if last is not None and legs[last].kind == "go":
        legs[last] = dataclasses.replace(legs[last], kind="stop")
    return tuple(legs)


def _part(part: str, height: float) -> list[Leg]:
    if not part or re.search(r"\bdegrees?\b", part):
        return []
    up, down = _UP.search(part), _DOWN.search(part)
    mentions = _mentions(part)
    legs: list[Leg] = []
    numbered = re.search(_NUMBER, part) is not None
    begin = 0
    for mention in mentions:
        between = " ".join(words_of(part)[begin : mention.start])
        begin = mention.end
        if legs and not _NEXT.search(between):
            if _BESIDE.search(between) and not legs[-1].beside:
                legs[-1] = _joined(legs[-1], mention.leg)
            continue
        legs.append(_with_role(part, between, mention, landing=bool(down) and not numbered))
    if up:
        legs.insert(0, Leg("climb", height=_height(part, height, True)))
    elif down and (numbered or not mentions):
        legs.append(Leg("descend", height=_height(part, height, False)))
    turn = _TURN.search(part)
    if _AROUND.search(part):
        legs.append(Leg("turn", side="around"))
    elif turn is not None:
        after = re.search(r"\b(?:at|after|behind) (?:the|a)\b", part[turn.end() :])
        place = len(legs) if after or part.startswith("at ") else 0
        legs.insert(place, Leg("turn", side=turn.group(1)))
        if after and legs and legs[0].kind in ("go", "along"):
            legs[0] = dataclasses.replace(legs[0], kind="past")
    return legs


def _height(part: str, height: float, up: bool) -> float:
    """Returns the height that a climb or a descent ends at, metres above what is below."""
    goal = _TO_HEIGHT.search(part)
    if goal is not None:
        return float(goal.group(1))
    change = _BY_HEIGHT.search(part)
    if change is not None:
        by = float(change.group(2))
        return height + by if up else max(height - by, 3.0)
    return height + CLIMB if up else LOW


def _mentions(part: str) -> list[_Mention]:
    words = words_of(part)
    found: list[_Mention] = []
    color, i = "", 0
    while i < len(words):
        name, length = landmark_at(words, i)
        if words[i] in COLOR_NAMES and not name:
            color = color_name(words[i])
        elif name:
            found.append(_Mention(Leg("go", name, color), i - bool(color), i + length))
            color = ""
            i += length - 1
        i += 1
    return found


def _with_role(part: str, before: str, mention: _Mention, *, landing: bool) -> Leg:
    """Returns a leg with what the words before its landmark say to do."""
    side = re.search(r"\bon (?:the|your) (left|right)\b", part)
    leg = dataclasses.replace(mention.leg, side=side.group(1) if side else "")
    said = f"{before} the"
    kind = next((kind for kind, w in _ROLES if re.search(rf"\b(?:{w})\b", said)), "go")
    if landing:
        kind = "stop"
    if kind == "along" and leg.landmark not in WAYS:
        kind = "past"
    return dataclasses.replace(leg, kind=kind)


def _joined(leg: Leg, other: Leg) -> Leg:
    """Returns a leg with the other landmark beside it; a roof is that of its building."""
    if leg.landmark in ("roof", "chimney"):
        return dataclasses.replace(leg, landmark=other.landmark, color=leg.color or other.color)
    return dataclasses.replace(leg, beside=other.landmark)


def _merged(legs: list[Leg]) -> list[Leg]:
    """Leaves out a leg whose landmark the next one names again: find it, then stop at it."""
    merged: list[Leg] = []
    for leg in legs:
        last = merged[-1] if merged else None
        if last is not None and last.kind == leg.kind == "climb":
            merged[-1] = leg
        elif (
            last is not None
            and leg.landmark
            and last.landmark == leg.landmark
            and last.kind == "go"
            and leg.color in ("", last.color)
        ):
            merged[-1] = dataclasses.replace(leg, color=last.color, beside=last.beside)
        else:
            merged.append(leg)
    return merged
