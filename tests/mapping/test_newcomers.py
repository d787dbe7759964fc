"""Things that move: the map believes at once what appears on free floor, and forgets it as fast."""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np
import pytest

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters, integrate
from unilavira_drake.messages import Intrinsics, OccupancyMap

LENS = Intrinsics(160, 120, 97.0, 97.0, 79.5, 59.5)
MOVING = MappingParameters(newest=4)
# z looks forward (+x) and ten degrees down, x to the right, a metre up.
TILT = math.radians(10.0)
X_WC = np.eye(4)
X_WC[:3, 0] = 0.0, -1.0, 0.0
X_WC[:3, 1] = -math.sin(TILT), 0.0, -math.cos(TILT)
X_WC[:3, 2] = math.cos(TILT), 0.0, -math.sin(TILT)
X_WC[:3, 3] = 0.0, 0.0, 1.0


def look(person=None, wall=4.0):
    """The depth of a floor, a wall ahead, and a person: a plane 0.5 m wide and 1.7 m high."""
    v, u = np.indices((LENS.height, LENS.width))
    rays = np.stack(((u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones(u.shape)), -1)
    rays = rays @ X_WC[:3, :3].T
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -1.0 / rays[..., 2], np.inf)
    depth = np.minimum(depth, wall / rays[..., 0])
    if person is not None:
        x, y = person
        s = x / rays[..., 0]
        high, across = 1.0 + s * rays[..., 2], s * rays[..., 1]
        hit = (np.abs(across - y) < 0.25) & (high > 0.0) & (high < 1.7)
        depth = np.where(hit, np.minimum(depth, s), depth)
    return DepthView(depth.astype(np.float32), LENS, X_WC)


def after(*looks, parameters=MOVING, step=0.1):
    occupancy = OccupancyMap()
    for k, view in enumerate(looks, start=1):
        occupancy = integrate(
            occupancy,
            () if view is None else (view,),
            parameters=parameters,
            position=(0.0, 0.0),
            floor_height=0.0,
            n=1,
            time=k * step,
        )
    return occupancy


def at(occupancy, x, y):
    """The log-odds in the cells where a person's front may have been put."""
    x0, y0 = occupancy.origin
    row = math.floor((y - y0) / occupancy.resolution)
    column = math.floor((x - x0) / occupancy.resolution + 1e-6)
    return occupancy.log_odds[row, column - 1 : column + 2].max()


@pytest.mark.parametrize("x", [0.6, 2.0])
def test_who_steps_onto_free_floor_is_there_at_the_first_look_and_gone_at_the_next(x):
    free = [look() for _ in range(12)]
    assert at(after(*free, look((x, 0.0))), x, 0.0) > 0
    # At 0.6 m the camera sees no floor any more: it looks over what is low.
    assert at(after(*free, *[look((x, 0.0))] * 8, look()), x, 0.0) < 0


def test_without_it_the_first_look_is_not_believed():
    still = dc.replace(MOVING, newest=0)
    assert at(after(*[look()] * 12, look((2.0, 0.0)), parameters=still), 2.0, 0.0) < 0


def test_out_of_view_it_is_remembered_for_some_seconds():
    seen = [look()] * 12 + [look((2.0, 0.0))]
    assert at(after(*seen, *[None] * 2, step=1.0), 2.0, 0.0) > 0
    assert at(after(*seen, *[None] * 5, step=1.0), 2.0, 0.0) < 0


def test_what_always_stood_there_is_as_before():
    views = [look(wall=2.5)] * 8
    still = after(*views, parameters=dc.replace(MOVING, newest=0))
    moving = after(*views)
    assert at(still, 2.5, 0.0) == 40
    np.testing.assert_array_equal(moving.log_odds, still.log_odds)


def test_it_cannot_outlive_a_look():
    with pytest.raises(ValueError, match="newest"):
        MappingParameters(newest=5)
