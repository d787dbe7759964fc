"""A few of the flights of the quadrotor's benchmark, through doors in which it cannot turn."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from unilavira_drake.flight_navigation import PLANNED_BESIDE
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.flight_governor import LEAST_BESIDE
from unilavira_drake.robots.flight_path_following import IN_LINE, NOSE_IN_LINE
from unilavira_drake.robots.quadrotor import Quadrotor

FINE = FlightConfig(resolution=0.05)


@pytest.fixture(scope="module")
def flights(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("flights")


def test_a_planned_gap_has_room_for_what_counts_as_in_line() -> None:
    """A nose that is off by an angle moves the corners aside by half the length times it."""
    aside = 0.5 * Quadrotor().length * NOSE_IN_LINE
    assert IN_LINE + aside <= PLANNED_BESIDE
    assert PLANNED_BESIDE > LEAST_BESIDE


@pytest.mark.parametrize("seed", [0, 3, 8])
def test_it_flies_through_a_door_little_wider_than_itself(flights: Any, seed: int) -> None:
    flight = flights.seeded_flight(Quadrotor(), seed, ratio=1.35, config=FINE)
    assert (flight.state, flight.reason, flight.through) == ("arrived", "", True)
    assert flight.off_goal < 0.3
    assert flight.contact == 0.0
    assert flight.clearance > 0.01


def test_on_the_map_of_rooms_too_where_their_voxels_leave_it_the_room(flights: Any) -> None:
    ends = (-2.0, 1.0, 1.0), (2.0, -1.0, 1.5)
    flight = flights.fly(
        Quadrotor(), FlightConfig(), start=ends[0], goal=ends[1], door=0.05, width=0.6, seed=1
    )
    assert (flight.state, flight.reason, flight.contact) == ("arrived", "", 0.0)
    assert flight.off_goal < 0.3


def test_a_door_that_is_too_narrow_is_told(flights: Any) -> None:
    flight = flights.fly(
        Quadrotor(), FINE, start=(-2.0, 0.0, 0.0), goal=(2.5, 0.0, 1.0), door=0.0, width=0.4, seed=1
    )
    assert (flight.state, flight.reason) == ("failed", "unreachable")
    assert (flight.through, flight.contact) == (False, 0.0)
