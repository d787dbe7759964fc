"""Where a task's own words say that its goal lies: ``120 m at 30 degrees from you``.

Flight directives of OpenUAV state distance and angle as seen from the start.  Who reads them knows
nothing of the goal beyond the words.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from unilavira_drake.messages import Message

_NUMBER = r"(\d{1,3}(?:,\d{3})+(?:\.\d+)?|\d+(?:\.\d+)?)"
_DISTANCE = re.compile(rf"(?<![\d.,]){_NUMBER} ?(?:m|meters?|metres?)\b")
_ANGLE = re.compile(
    rf"(-?){_NUMBER} ?(?:degrees?|deg|°)(?: (?:to|on|from|at) (?:the|your|you))?(?: (left|right))?"
)
_PLAIN = {
    "ahead": 0.0,
    "in front of you": 0.0,
    "to your left": 90.0,
    "to your right": -90.0,
    "behind you": 180.0,
}
_A_LITTLE = re.compile(r"\b(?:a little|slightly) to (?:your|the) (?:left|right)\b")
SLIGHT = 12.0
"""What ``a little to your left`` means, degrees."""
_STATES = re.compile(r"\b(?:is|lies|located|stands|away|waits)\b")


@dataclass(frozen=True)
class StatedDirection(Message):
    """A place as a task tells it, seen from where and as the robot started."""

    distance: float = 0.0
    """Metres along the ground."""
    bearing: float = 0.0
    """Degrees to the left of the first ``front``."""


def stated_direction(task: str) -> StatedDirection | None:
    """Returns the place that a task states by distance and angle, or None where it states none.

    An angle without a side counts to the right, as OpenUAV's yaw does.  An order (``fly 40 m
    ahead``) states no place.  Of several distances that counts which stands nearest to the bearing.
    """
    for sentence in re.split(r"(?<=[.;!?])\s+", task.lower()):
        bearing = _bearing(sentence)
        if bearing is None or not _STATES.search(sentence):
            continue
        degrees, where = bearing
        distance = _nearest(sentence, where)
        if distance is not None:
            return StatedDirection(distance, degrees)
    return None


def _nearest(sentence: str, where: int) -> float | None:
    """Returns the distance that stands nearest to a place of a sentence, metres."""
    nearest = min(
        _DISTANCE.finditer(sentence), key=lambda match: abs(match.start() - where), default=None
    )
    return None if nearest is None else _number(nearest.group(1))


def _number(digits: str) -> float:
    return float(digits.replace(",", ""))


def _bearing(sentence: str) -> tuple[float, int] | None:
    """Returns degrees to the left, and where in the sentence they stand."""
    angle = _ANGLE.search(sentence)
    if angle is not None:
        sign = 1.0 if angle.group(3) == "left" else -1.0
        degrees = _number(angle.group(2))
        return (-sign if angle.group(1) else sign) * degrees, angle.start()
    little = _A_LITTLE.search(sentence)
    if little is not None and "ahead" in sentence:
        return (SLIGHT if "left" in little.group() else -SLIGHT), sentence.index("ahead")
    return next(
        ((value, sentence.index(words)) for words, value in _PLAIN.items() if words in sentence),
        None,
    )
