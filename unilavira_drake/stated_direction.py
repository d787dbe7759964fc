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
_SIZE_BEFORE = re.compile(
    r"\b(?:height|altitude|width|length)(?: of)?(?: about)? $"
    r"|\b(?:climb|rise|ascend|descend|sink)(?:s|ing)?(?: to| by)?(?: about)? $"
)
_SIZE_AFTER = re.compile(
    r" (?:(?:in|of) )?(?:height|high|altitude|tall|long|length|wide|width|deep|above)\b"
)
"""A length that these words stand at is none between the start and the place."""
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
    ahead``) states no place.  Of several distances that counts which stands nearest to the bearing;
    heights and sizes are none.
    """
    for sentence in re.split(r"(?<=[.;!?])\s+", task.lower()):
        bearing = _bearing(sentence)
        if bearing is None or not _STATES.search(sentence):
            continue
        degrees, span = bearing
        distance = _nearest(sentence, span)
        if distance is not None:
            return StatedDirection(distance, degrees)
    return None


def _nearest(sentence: str, span: tuple[int, int]) -> float | None:
    """Returns the distance that stands nearest to a span of a sentence, metres."""
    distances = (
        match
        for match in _DISTANCE.finditer(sentence)
        if not _SIZE_AFTER.match(sentence, match.end())
        and not _SIZE_BEFORE.search(sentence[: match.start()])
    )
    nearest = min(
        distances,
        key=lambda match: max(span[0] - match.end(), match.start() - span[1]),
        default=None,
    )
    return None if nearest is None else _number(nearest.group(1))


def _number(digits: str) -> float:
    return float(digits.replace(",", ""))


def _bearing(sentence: str) -> tuple[float, tuple[int, int]] | None:
    """Returns degrees to the left, and the span of the sentence where they stand."""
    angle = _ANGLE.search(sentence)
    if angle is not None:
        sign = 1.0 if angle.group(3) == "left" else -1.0
        degrees = _number(angle.group(2))
        return (-sign if angle.group(1) else sign) * degrees, angle.span()
    little = _A_LITTLE.search(sentence)
    if little is not None and "ahead" in sentence:
        return (SLIGHT if "left" in little.group() else -SLIGHT), _span(sentence, "ahead")
    return next(
        ((value, _span(sentence, words)) for words, value in _PLAIN.items() if words in sentence),
        None,
    )


def _span(sentence: str, words: str) -> tuple[int, int]:
    begin = sentence.index(words)
    return begin, begin + len(words)
