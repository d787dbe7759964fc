"""The label grounder on synthetic label images."""

from __future__ import annotations

import numpy as np
import pytest

from unilavira_drake.messages import Candidate, Frame
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.grounder_labels import GENERAL_CLASS, OTHER_COLOR, LabelGrounder
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.worlds.world import LabelEntry

LABELS = {
    1: LabelEntry("sofa", "sofa_1"),
    2: LabelEntry("sofa", "sofa_2"),
    3: LabelEntry("armchair", "armchair_1"),
    4: LabelEntry("door", "kitchen_door"),
    5: LabelEntry("floor", "kitchen_floor", "kitchen"),
    6: LabelEntry("floor", "corridor_floor", "corridor"),
}
PLACES = {
    1: np.s_[10:40, 10:40],
    2: np.s_[10:40, 50:80],
    3: np.s_[10:40, 90:110],
    4: np.s_[10:80, 120:150],
    5: np.s_[50:80, 125:145],
    6: np.s_[90:120, 0:160],
}
MARK = (0.0, 0.0, 160.0, 120.0)


@pytest.fixture(scope="module")
def view() -> Frame:
    label = np.full((120, 160), 32766, np.int16)
    color = np.full((120, 160, 3), 200, np.uint8)
    for number, place in PLACES.items():
        label[place] = number
        color[place] = (30, 40, 200) if number == 2 else (200, 20, 20)
    return Frame(
        color=color,
        depth=np.full((120, 160), 3.0, np.float32),
        label=label,
        intrinsics=pinhole(160, 120, 79.0),
    )


def found(view: Frame, target: str) -> list[Candidate]:
    return LabelGrounder(GroundTruthDetector(LABELS))(view, target, MARK)


def scores(view: Frame, target: str) -> dict[int, float]:
    """Returns the score of each label that was found."""
    result = {}
    for candidate in found(view, target):
        assert candidate.point is not None
        columns, rows = (round(value) for value in candidate.point)
        result[int(view.label[rows, columns])] = candidate.score
    return result


def test_things_are_matched_by_class_and_colour(view: Frame) -> None:
    assert scores(view, "the couch") == {1: 1.0, 2: 1.0}
    assert scores(view, "blue couch near the red chair") == {1: OTHER_COLOR, 2: 1.0}
    assert scores(view, "red chair") == {3: GENERAL_CLASS}


def test_a_room_means_its_floor(view: Frame) -> None:
    assert scores(view, "the hallway") == {6: 1.0}
    assert scores(view, "floor of the kitchen") == {5: 1.0}
    assert scores(view, "open floor") == {5: 1.0, 6: 1.0}


def test_a_door_is_marked_in_its_opening_or_behind_it(view: Frame) -> None:
    (door,) = found(view, "white door")
    assert door.score == OTHER_COLOR
    assert door.point == (135.0, 78.0)
    by_score = {c.score: c.point for c in found(view, "door to the kitchen")}
    assert by_score[GENERAL_CLASS] == (135.0, 78.0)
    u, v = by_score[1.0] or (0.0, 0.0)
    assert view.label[round(v), round(u)] == 5


@pytest.mark.parametrize("target", ["", "something odd", "the fridge", "the bathroom"])
def test_what_is_not_there_is_not_found(view: Frame, target: str) -> None:
    assert found(view, target) == []
