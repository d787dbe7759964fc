"""Replies in flight: the fifth view, climbs, and flights by numbers."""

from __future__ import annotations

from typing import Any

import pytest
from test_reply import _decide as decide

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.mllm.request import DirectionNote

IN_FLIGHT = {"in_flight": True}
BY_NUMBERS = {"in_flight": True, "bearings": DirectionNote()}


@pytest.mark.parametrize("climb", [None, -4.0, 12.5])
def test_a_turn_in_flight_may_look_down_and_climb(climb: float | None) -> None:
    tool = {"tool": "turn", "direction": "down", "climb": climb}
    action = decide(action=tool, variables=IN_FLIGHT)
    assert (action.tool, action.direction, action.climb) == ("turn", "down", climb)


def test_a_turn_in_flight_needs_no_climb() -> None:
    action = decide(action={"tool": "turn", "direction": "left"}, variables=IN_FLIGHT)
    assert (action.direction, action.climb) == ("left", None)


def test_down_is_no_direction_on_the_ground() -> None:
    with pytest.raises(ReplyFormatError, match="'front', 'left', 'right' or 'back'"):
        decide(action={"tool": "turn", "direction": "down"})


def test_a_flight_by_numbers_is_read() -> None:
    fly = {"tool": "fly", "bearing": "-35", "distance": 22.5, "climb": 4}
    action = decide(action=fly, variables=BY_NUMBERS)
    assert (action.tool, action.bearing, action.distance, action.climb) == ("fly", -35.0, 22.5, 4.0)
    assert action.argument == "22 m at 35 degrees to the right, 4 m up"
    assert action.repairs


@pytest.mark.parametrize(
    ("fly", "variables", "complaint"),
    [
        ({"bearing": 0.0, "distance": 9.0, "climb": 0.0}, IN_FLIGHT, "offered only where nothing"),
        ({"bearing": 190.0, "distance": 9.0, "climb": 0.0}, BY_NUMBERS, "less than or equal"),
        ({"bearing": 0.0, "distance": 900.0, "climb": 0.0}, BY_NUMBERS, "less than or equal"),
        ({"bearing": 0.0, "distance": -1.0, "climb": 0.0}, BY_NUMBERS, "greater than or equal"),
        ({"bearing": 0.0, "distance": 9.0}, BY_NUMBERS, "climb is missing"),
    ],
)
def test_wrong_numbers_are_named(fly: Any, variables: Any, complaint: str) -> None:
    with pytest.raises(ReplyFormatError, match=complaint):
        decide(action={"tool": "fly", **fly}, variables=variables)


def test_a_recovery_in_flight_names_the_remaining_views() -> None:
    with pytest.raises(ReplyFormatError, match="choose among front, left, right, back"):
        decide(
            "recover",
            action={"tool": "turn", "direction": "down"},
            variables={**IN_FLIGHT, "failed_direction": "down"},
        )
