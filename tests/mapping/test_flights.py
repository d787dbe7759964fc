"""Where stairs begin, found in rendered depth, against where they stand."""

import math

import numpy as np
import pytest
from rendered_stairs import frames

from unilavira_drake.mapping.flights import find_flight
from unilavira_drake.worlds.load import load_world

UP = [
    (7.7, 1.0, 0.0, 1.57),
    (6.2, 1.0, 0.0, 1.2),
    (6.2, 1.0, 0.0, 0.8),
    (6.0, 2.0, 0.0, 0.5),
    (6.6, 0.8, 0.0, 1.57),
]
DOWN = [(7.7, 8.6, 2.8, -1.57), (6.9, 8.9, 2.8, -1.4)]
HALF = math.pi / 2


def columns(world, frame):
    seen = np.argwhere(frame.label == world.label_of("stairs_1"))[:, 1]
    return float(seen.min()), float(seen.max())


@pytest.mark.parametrize("height", [0.35, 1.0])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(("stair", "places"), [("up", UP), ("down", DOWN)])
def test_foot_heading_and_width(height, mirror, stair, places) -> None:
    world = load_world("two_storey", mirror=mirror)
    stairs, sign = world.stairs[0], -1.0 if mirror else 1.0
    places = [(x, sign * y, z, sign * yaw) for x, y, z, yaw in places]
    s = 0.0 if stair == "up" else stairs.length - stairs.tread
    heading = stairs.heading if stair == "up" else -stairs.heading
    for place, frame in zip(places, frames(world, places, height), strict=True):
        flight = find_flight(frame, columns(world, frame), stair, place[2])
        if place == places[-1] and stair == "down" and height < 0.5:
            # Aslant and low, too little of the edge is in sight.
            assert "from their front" in flight.reason
            continue
        assert flight.foot is not None, (place, flight.reason)
        assert math.dist(flight.foot, stairs.point(s)) < 0.12, place
        assert abs(math.remainder(flight.heading - heading, math.tau)) < 0.05, place
        assert flight.width == pytest.approx(stairs.width, abs=0.15)


def test_what_is_no_flight_gets_a_reason() -> None:
    world = load_world("two_storey")
    places = [
        (6.0, 2.5, 0.0, math.pi),  # a wall and a door
        (6.0, 5.0, 0.0, 0.0),  # the stairs from their side
        (6.0, 5.0, 2.8, 0.0),  # the railing from its side
        (6.2, 6.0, 0.0, HALF),  # along the hall
    ]
    for place, frame in zip(places, frames(world, places, 1.0), strict=True):
        for stair in ("up", "down"):
            flight = find_flight(frame, (100.0, 220.0), stair, place[2])
            assert flight.foot is None, (place, stair, flight)
            assert flight.reason


def test_an_empty_picture() -> None:
    (frame,) = frames(load_world("two_storey"), [(7.7, 1.0, 0.0, HALF)], 1.0)
    blind = type(frame)(
        depth=np.full_like(frame.depth, np.inf), intrinsics=frame.intrinsics, X_WC=frame.X_WC
    )
    assert find_flight(blind, (0.0, 10.0), "up", 0.0).foot is None
