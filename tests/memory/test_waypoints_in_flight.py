"""The waypoint memory in flight: ways without a bearing, flights by numbers, heights."""

from __future__ import annotations

import math

import numpy as np
import pytest

from unilavira_drake.memory.waypoints import MemoryBounds, Sight, WaypointState, remember
from unilavira_drake.messages import (
    DIRECTIONS,
    DOWN,
    Frame,
    LanguageAction,
    Outcome,
    Panorama,
    VisionAction,
    direction_of,
)

BOUNDS = MemoryBounds(8, 4, 6, 0.5)
Place = tuple[float, float, float]


def seen(n: int, place: Place, yaw: float = 0.0, outcome: Outcome = Outcome()) -> Panorama:  # noqa: B008
    c, s = math.cos(yaw), math.sin(yaw)
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[c, -s], [s, c]]
    X_WB[:3, 3] = place
    frames = tuple(Frame(view) for view in (*DIRECTIONS, DOWN))
    return Panorama(n=n, first=n, X_WB=X_WB, frames=frames, outcome=outcome)


def flown(*actions: LanguageAction, places: tuple[Place, ...]) -> WaypointState:
    state = remember(
        WaypointState(), seen(1, (0, 0, 10)), LanguageAction(), VisionAction(), Sight(), BOUNDS
    )
    for action, place in zip(actions, places, strict=True):
        n = action.n + 1
        state = remember(state, seen(n, place), action, VisionAction(n=action.n), Sight(), BOUNDS)
    return state


def turn(n: int, direction: str) -> LanguageAction:
    return LanguageAction(n, "decide", "turn", direction)


def back(n: int, waypoint: int) -> LanguageAction:
    return LanguageAction(n, "decide", "backtrack", waypoint=waypoint)


def test_a_way_straight_down_has_no_bearing_and_is_given_up_as_down() -> None:
    state = flown(turn(1, DOWN), back(2, 1), places=((0, 0, 3), (0, 0, 10)))
    (edge,) = state.history.edges
    assert (edge.direction, edge.bearing, edge.to) == (DOWN, None, 2)
    assert edge.outcome == "returned"
    assert state.second_chance.failed_direction == DOWN
    assert direction_of(None) == DOWN


def test_places_above_each_other_are_different_waypoints() -> None:
    state = flown(turn(1, DOWN), places=((0, 0, 3),))
    assert [w.position[2] for w in state.history.waypoints] == [10, 3]
    assert state.history.current == 2


@pytest.mark.parametrize(
    ("bearing", "distance", "climb", "direction", "world"),
    [
        (80.0, 10.0, 3.0, "left", math.radians(80.0)),
        (-100.0, 10.0, 0.0, "right", math.radians(-100.0)),
        (170.0, 10.0, 0.0, "back", math.radians(170.0)),
        (0.0, 0.0, -5.0, DOWN, None),
    ],
)
def test_a_flight_by_numbers_is_a_way_too(
    bearing: float, distance: float, climb: float, direction: str, world: float | None
) -> None:
    fly = LanguageAction(1, "decide", "fly", bearing=bearing, distance=distance, climb=climb)
    (edge,) = flown(fly, places=((7.0, 7.0, 12.0),)).history.edges
    assert edge.direction == direction
    assert edge.bearing == (None if world is None else pytest.approx(world))


def test_a_flight_straight_up_is_no_way() -> None:
    fly = LanguageAction(1, "decide", "fly", climb=9.0)
    state = flown(fly, places=((0.0, 0.0, 19.0),))
    assert state.history.edges == ()
    assert [d.argument for d in state.history.decisions] == ["9 m up"]
