"""Reads one part of a sentence of a flight directive: what to do with which landmark."""

from __future__ import annotations

import dataclasses
import re

from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.words import WAYS, landmark_at
from unilavira_drake.mllm.rules.lexicon import words_of
from unilavira_drake.mllm.rules.vocabulary import COLOR_NAMES, color_name

LOW = 8.0
"""Height to which one descends if no number is given, metres."""
CLIMB = 15.0
"""By which one climbs if no number is given, metres."""
NUMBER = r"(\d+(?:\.\d+)?) ?(?:m|meters?|metres?)\b"
_UP = re.compile(r"\b(?:climb|rise|ascend|take off|gain height|go up|fly up)\b")
_DOWN = re.compile(r"\b(?:descend|sink|land|lower yourself|go down|come down|drop|fly down)\b")
_ABOUT = "(?: about| around| roughly)?"
_TO_HEIGHT = re.compile(rf"\b(?:to|at|of)(?: a height of| an altitude of)?{_ABOUT} {NUMBER}")
_BY_HEIGHT = re.compile(rf"\b(?:by |another |)({NUMBER})")
_TURN = re.compile(
    r"\b(?:turn|bear|veer|swing|head|bank) (?:to (?:the|your) )?(left|right)\b(?! of)"
)
_AROUND = re.compile(r"\bturn (?:around|round|back)\b")
_STANDS = re.compile(
    r"\b(?:stands?|lies|rises|waits|opens|there is|is)\b(?: (?:low|also))?( an?\b)?"
)
_DESCRIBES = re.compile(
    r"^(?:just |right )?(?:south|north|east|west|between|behind|beside|beyond|next to|near"
    r"|in front of|about|an?|the|of|for)\b(?!.*\b(?:fly|go|turn|stop|pass|cross|follow)\b)"
)
"""A part that says where the last landmark is."""
_LANDING = re.compile(r"\b(?:to|over|above|beside|next to|at|near|on|onto)\b")
_ROLES = (
    ("stop", r"stop|hover|halt|finish|end|land|wait|stay"),
    ("along", r"along|follow|following|down the|up the"),
    ("past", r"past|pass|passing|by the|leave the"),
    ("over", r"over|above|cross|crossing|across"),
    ("go", r"to|towards|toward|reach|reaching|find|approach|at|near|for|see|it is|looks like|is"),
)
_NEXT = re.compile(r"\b(?:to the|towards?|past|over|across|as far as|up to)\b")
"""Between two landmarks: the second is gone to as well, and does not tell where the first is."""
ROOF = rf"(?:an? |the |its |their )?(?P<color>{'|'.join(sorted(COLOR_NAMES))}) roofs?\b"
_ROOF = re.compile(f"with {ROOF}")
_BESIDE = re.compile(r"\b(?:near|beside|next to|by|in front of|behind|opposite|at|of|in|on)\b")


@dataclasses.dataclass(frozen=True)
class Mention:
    """A landmark named in a part of a sentence, and where its words begin and end."""

    leg: Leg
    start: int
    end: int


def legs_of(part: str, height: float) -> list[Leg]:
    """Returns the legs of one part of a sentence.

    Args:
        part: lower-case words between two cuts.
        height: at which it begins, metres above the ground.
    """
    if not part or re.search(r"\bdegrees?\b", part):
        return []
    stands = _STANDS.search(part)
    if stands is not None:
        # "In the car park stands a red van": the van is meant. "A car stands on it": the car.
        after = _landmark_legs(part[stands.end() :]) if stands.group(1) else []
        named = after[:1] or _landmark_legs(part[: stands.start()])[-1:]
        return [dataclasses.replace(leg, kind="go") for leg in named]
    if _DESCRIBES.search(part):
        return []
    legs = _landmark_legs(part)
    up, down = _UP.search(part), _DOWN.search(part)
    if up:
        legs.insert(0, Leg("climb", height=_height(part, height, True)))
    elif down and (re.search(NUMBER, part) or not legs):
        legs.append(Leg("descend", height=_height(part, height, False)))
    return _with_turns(part, legs)


def _landmark_legs(part: str) -> list[Leg]:
    landing = _DOWN.search(part) is not None and re.search(NUMBER, part) is None
    words, legs, begin = words_of(part), list[Leg](), 0
    for mention in mentions_of(part):
        between = " ".join(words[begin : mention.start])
        begin = mention.end
        if legs and (legs[-1].kind == "stop" or not _NEXT.search(between)):
            if _BESIDE.search(between) and not legs[-1].beside:
                legs[-1] = _joined(legs[-1], mention.leg)
            continue
        lands = landing and _LANDING.search(between) is not None
        legs.append(_with_role(part, between, mention, landing=lands))
    return legs


def _with_turns(part: str, legs: list[Leg]) -> list[Leg]:
    turn = _TURN.search(part)
    if _AROUND.search(part):
        return [*legs, Leg("turn", side="around")]
    if turn is None:
        return legs
    leg = Leg("turn", side=turn.group(1))
    after = re.search(r"\b(?:at|after|behind) (?:the|a)\b", part[turn.end() :])
    if after and legs and legs[0].kind in ("go", "along"):
        legs[0] = dataclasses.replace(legs[0], kind="past")
    return [*legs, leg] if after or part.startswith("at ") else [leg, *legs]


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


def mentions_of(part: str) -> list[Mention]:
    """Returns the landmarks that a part of a sentence names, in their order."""
    words = words_of(part)
    found: list[Mention] = []
    color, i = "", 0
    while i < len(words):
        name, length = landmark_at(words, i)
        if words[i] == "with" and (more := _roof_at(words, i)[1]):
            i += more - 1
        elif words[i] in COLOR_NAMES and not name:
            color = color_name(words[i])
        elif name:
            roof, more = _roof_at(words, i + length)
            leg = Leg("go", name, color, roof=roof)
            found.append(Mention(leg, i - bool(color), i + length + more))
            color = ""
            i += length + more - 1
        i += 1
    return found


def _roof_at(words: list[str], start: int) -> tuple[str, int]:
    """Returns the colour of ``with a red roof`` at a place, and its number of words, 0 for none."""
    found = _ROOF.match(" ".join(words[start : start + 4]))
    if found is None:
        return "", 0
    return color_name(found.group("color")), len(found.group().split())


def _with_role(part: str, before: str, mention: Mention, *, landing: bool) -> Leg:
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
    if other.landmark == leg.landmark or leg.kind == "along":
        return leg
    return dataclasses.replace(leg, beside=other.landmark)
