"""Reads a flight directive: sentence by sentence, order by order.

A sentence is cut at commas and conjunctions before an order.  In each part the verb or preposition
before a landmark says what to do with it.  ``The target is 120 m at 30 degrees from you. It is a
red car.`` is a heading and a landmark.
"""

from __future__ import annotations

import dataclasses
import re

from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.parts import NUMBER, ROOF, legs_of, mentions_of
from unilavira_drake.stated_direction import stated_direction

MAX_LEGS = 30

_START_HEADING = re.compile(
    rf"fly {NUMBER} at (\d+) degrees to the (left|right) of the start", re.IGNORECASE
)
_CUT = re.compile(
    r"[.;!?]\s+|\s*,\s*(?:and\s+)?(?:then\s+)?|\s+and\s+(?:then\s+)?(?=(?:fly|go|head|climb|rise|ascend|"
    r"descend|sink|land|turn|bear|stop|hover|pass|cross|follow|continue|find|finish|circle|end)\b)"
    r"|\s+then\s+"
)
_STOP = re.compile(r"\b(?:stop|hover|halt|land|end)\b")
_IDLE = re.compile(r"\bthere are\b|\bis not\b|^the other\b|\bruns\b")
"""A sentence that gives no order and names no goal."""
_UNTIL = re.compile(r",?\s+(?:until|till)\s+")
_WITH = re.compile(
    rf"\bwith (?!{ROOF})(?:\w+ ){{0,6}}?"
    r"(?:roofs?|legs|band|gates|towers?|ponds?|gardens|left|right|side)\b"
)
"""What something looks like, or what is seen on the way; the colour of a roof is kept."""


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
    for sentence in re.split(r"(?<=[.;:!?])\s+", text.lower()):
        stated = stated_direction(sentence)
        if stated is not None:
            legs.insert(0, Leg("heading", distance=stated.distance, bearing=stated.bearing))
            goals += [mention.leg for mention in mentions_of(sentence)[:1]]
            continue
        if _IDLE.search(sentence):
            continue
        sentence = _UNTIL.sub(", to ", _WITH.sub("", sentence))
        for part in _CUT.split(sentence.strip(" .;:!?")):
            if _STOP.search(part) and not mentions_of(part):
                _stop_at_last(legs)
            for leg in legs_of(part.strip(" .,"), height):
                started = part.strip().startswith("take off")
                changes = leg.kind in ("climb", "descend") and not started
                height = leg.height if changes else height
                legs.append(leg)
    named = {leg.landmark for leg in legs}
    legs += [goal for goal in goals if goal.landmark not in named]
    return tuple(_merged(legs)[:MAX_LEGS])


def _stop_at_last(legs: list[Leg]) -> None:
    """``Stop over it``: at the landmark that was named last."""
    last = next((i for i in reversed(range(len(legs))) if legs[i].landmark), None)
    if last is not None and legs[last].hard:
        legs[last] = dataclasses.replace(legs[last], kind="stop")


def plan_legs(text: str, height: float) -> tuple[Leg, ...]:
    """Returns the legs of a directive; at the last landmark it is stopped, others are only passed.

    Arguments as for :func:`parse_directive`.
    """
    legs = list(parse_directive(text, height))
    last = max((i for i, leg in enumerate(legs) if leg.landmark and leg.hard), default=None)
    if last is not None and legs[last].kind == "go":
        legs[last] = dataclasses.replace(legs[last], kind="stop")
    return tuple(legs)


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
            merged[-1] = dataclasses.replace(
                leg, color=last.color, roof=leg.roof or last.roof, beside=last.beside
            )
        else:
            merged.append(leg)
    return merged
