"""A grounder on the simulator's labels: finds what a description names as a detector would."""

from __future__ import annotations

from collections.abc import Callable

from unilavira_drake.messages import Candidate, Frame
from unilavira_drake.messages.grounding import Box
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.rules.nouns import DOOR
from unilavira_drake.mllm.rules.vocabulary import (
    class_match,
    color_name,
    room_kind,
    thing_class,
)
from unilavira_drake.sensors.grounder_words import FLOOR, TargetWords, read_target

SAME_CLASS = 1.0
GENERAL_CLASS = 0.7
"""Score where one word is the more general one: ``chair`` for an armchair."""
OTHER_COLOR = 0.4
"""Factor for a thing whose pixels have another colour than the description says."""
_SILL = 2.0
"""The floor in a doorway is marked this far above the lower edge of its frame, pixels."""


class LabelGrounder:
    """Matches descriptions with the labelled regions of a view: ``perception: ground_truth``.

    Things are matched by class and colour, floors by the kind of their room; a room means its
    floor.  A door is marked on the floor behind it where its room is named and seen, else on the
    floor in its opening.

    Args:
        detector: what is in a view, e.g. a ``GroundTruthDetector``.
    """

    def __init__(self, detector: Callable[[Frame], ViewEvidence]) -> None:
        self._detector = detector

    def __call__(self, frame: Frame, target_desc: str, box: Box) -> list[Candidate]:
        """Returns every region of the view that the description may mean."""
        wanted = read_target(target_desc)
        if not (wanted.category or wanted.room):
            return []
        view = self._detector(frame)
        scored = ((_score(wanted, d), d) for d in view.detections)
        return [_candidate(d, score, view) for score, d in scored if score > 0.0]


def _score(wanted: TargetWords, seen: Detection) -> float:
    if seen.category == FLOOR:
        # Behind a door the floor itself is meant, not the colour of the door.
        named = wanted.category in ("", DOOR, FLOOR) and room_kind(seen.room) == wanted.room
        return SAME_CLASS if named or (wanted.category, wanted.room) == (FLOOR, "") else 0.0
    match = class_match(wanted.category, thing_class(seen.category))
    score = (0.0, GENERAL_CLASS, SAME_CLASS)[match]
    if wanted.category == DOOR and wanted.room:
        score *= GENERAL_CLASS
    if wanted.color and color_name(seen.color) != wanted.color:
        score *= OTHER_COLOR
    return score


def _candidate(seen: Detection, score: float, view: ViewEvidence) -> Candidate:
    if thing_class(seen.category) != DOOR:
        return Candidate(seen.box, score, seen.point)
    u_min, _, u_max, v_max = seen.box
    return Candidate(seen.box, score, ((u_min + u_max) / 2, min(v_max, view.height - 1.0) - _SILL))
