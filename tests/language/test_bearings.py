"""The direction block: when it is there, and what its numbers are."""

import math

import numpy as np
import pytest

from unilavira_drake.language.bearings import direction_note
from unilavira_drake.messages import (
    DIRECTIONS,
    DOWN,
    Frame,
    History,
    LanguageAction,
    Outcome,
    Panorama,
    Waypoint,
)
from unilavira_drake.stated_direction import StatedDirection, stated_direction

TASK = "The target is 100 m at 90 degrees to your left. It is a red car."
TURN = LanguageAction(4, "decide", "turn", "front")
FAILED = Outcome("failed", "no target: only sky")


def panorama(outcome=FAILED, *, down=True, position=(0.0, 0.0, 10.0), yaw=0.0):
    c, s = math.cos(yaw), math.sin(yaw)
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[c, -s], [s, c]]
    X_WB[:3, 3] = position
    frames = tuple(Frame(view) for view in (*DIRECTIONS, *((DOWN,) if down else ())))
    return Panorama(n=5, X_WB=X_WB, frames=frames, outcome=outcome)


def history(position=(0.0, 0.0, 10.0), heading=0.0):
    return History(n=5, current=2, waypoints=(Waypoint(1, 1, position, heading), Waypoint(2)))


@pytest.mark.parametrize(
    ("action", "seen", "there"),
    [
        (TURN, panorama(), True),
        (TURN, panorama(Outcome("failed", "no target: model error: cut off")), True),
        (TURN, panorama(down=False), False),
        (TURN, panorama(Outcome()), False),
        (TURN, panorama(Outcome("failed", "unreachable")), False),
        (TURN, panorama(Outcome("failed", "stuck")), False),
        (LanguageAction(4, "decide", "fly", distance=9.0), panorama(), False),
        (LanguageAction(4, "decide", "backtrack", waypoint=1), panorama(), False),
        (LanguageAction(), panorama(), False),
    ],
)
def test_it_is_there_exactly_where_vision_failed_in_flight(action, seen, there):
    assert (direction_note(TASK, action, seen, history()) is not None) is there


def test_poses_are_told_as_seen_from_the_start():
    # The start faces north; the aircraft has flown 30 m north and 10 m east, and faces south.
    seen = panorama(position=(15.0, 36.0, 22.0), yaw=-math.pi / 2)
    note = direction_note(TASK, TURN, seen, history((5.0, 6.0, 10.0), math.pi / 2))
    assert note.now[:3] == (30.0, -10.0, 12.0)
    assert abs(note.now[3]) == 180.0
    # The stated place is 100 m to the left of the start, that is west; now it lies to the right.
    assert note.goal_distance == pytest.approx(math.hypot(30.0, 110.0), abs=0.1)
    assert note.goal_bearing == pytest.approx(-math.degrees(math.atan2(110.0, 30.0)), abs=0.1)


@pytest.mark.parametrize("yaw", np.linspace(-3.0, 3.0, 7))
def test_flying_as_the_block_says_leads_to_the_stated_place(yaw):
    start, heading = (4.0, -7.0, 9.0), 0.8
    seen = panorama(position=(-11.0, 13.0, 20.0), yaw=float(yaw))
    note = direction_note(TASK, TURN, seen, history(start, heading))
    angle = yaw + math.radians(note.goal_bearing)
    x = seen.position[0] + note.goal_distance * math.cos(angle)
    y = seen.position[1] + note.goal_distance * math.sin(angle)
    stated = heading + math.pi / 2
    there = (start[0] + 100.0 * math.cos(stated), start[1] + 100.0 * math.sin(stated))
    assert (x, y) == pytest.approx(there, abs=0.3)


def test_a_task_that_states_no_place_gets_no_goal_direction():
    note = direction_note("Fly to the red car.", TURN, panorama(), history())
    assert note.goal_distance is None


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("the target is 120 m at 30 degrees from you.", (120.0, -30.0)),
        ("The target is 120 m at -30 degrees from you.", (120.0, 30.0)),
        ("Climb. The car is 80 meters away, 45 degrees to your left.", (80.0, 45.0)),
        ("It lies 60.5 metres ahead of you.", (60.5, 0.0)),
        ("The church is 90 m behind you.", (90.0, 180.0)),
        ("It stands 40 m to your right.", (40.0, -90.0)),
        ("Climb to 20 m, the target is 100 m ahead.", (100.0, 0.0)),
        ("The target is 100 m ahead, so climb to 20 m.", (100.0, 0.0)),
        ("The car is 3 m long and stands 80 m to your right.", (80.0, -90.0)),
        ("The car is 80 m away, 45 degrees to your left, and 3 m long.", (80.0, 45.0)),
        ("The tower is 1,200 m ahead of you.", (1200.0, 0.0)),
        ("At 10 degrees to your left, 1,050.5 m away, lies a lake.", (1050.5, 10.0)),
        (
            "At 20 m height, 40 degrees to your left and 290 metres away, lies the target.",
            (290.0, 40.0),
        ),
        ("The tower, 30 metres tall, stands 40 degrees to your left, 290 m away.", (290.0, 40.0)),
        ("At a height of 20 m, 5 degrees to your right and 90 m away, it waits.", (90.0, -5.0)),
        ("Climb to about 20 m: 5 degrees to your left, it lies 90 m away.", (90.0, 5.0)),
        ("The target is 40 degrees to your left and 20 m above the ground.", None),
        ("Its distance is 100 m, 30 degrees to the left, 8 m before a wall.", (100.0, 30.0)),
        ("Ahead it is 1,000 metres at 30 degrees to your left; 9 m on.", (1000.0, 30.0)),
        ("Fly 40 m ahead, then turn 30 degrees to the left.", None),
        ("The car is red. Fly 30 m.", None),
        ("Fly to the church.", None),
        ("", None),
    ],
)
def test_a_stated_place_is_read_from_the_words(text, place):
    found = stated_direction(text)
    assert found == (None if place is None else StatedDirection(*place))
