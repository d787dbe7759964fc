"""People are remembered beside the map: where they stand, until their place is seen empty."""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np
import pytest

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.moving_layer import BERTH, with_moving
from unilavira_drake.mapping.moving_things import (
    BESIDE,
    BODY,
    ELSEWHERE,
    LEAST_PIXELS,
    LONGEST_GAP,
    STOOD,
    Look,
    cells_around,
    remembered,
    wanted,
    without,
)
from unilavira_drake.mapping.occupancy import MappingParameters
from unilavira_drake.messages import Intrinsics, OccupancyMap

LENS = Intrinsics(160, 120, 97.0, 97.0, 79.5, 59.5)
PARAMETERS = MappingParameters(newest=4, free_step=10)
WALL = 4.0
ANNA, BEN = 7, 9


def look(time, *people, yaw=0.0):
    """What a camera a metre above the origin sees: round people 1.7 m high, before a wall."""
    v, u = np.indices((LENS.height, LENS.width))
    across, up = -(u - LENS.cx) / LENS.fx, -(v - LENS.cy) / LENS.fy
    depth = np.full(u.shape, WALL)
    labels = np.zeros(u.shape, np.int16)
    for label, x, y in people:
        ahead = math.cos(yaw) * x + math.sin(yaw) * y
        left = math.cos(yaw) * y - math.sin(yaw) * x
        # s (1, across) meets the circle: |s (1, across) - p| = BODY.
        a, b, c = 1.0 + across**2, ahead + left * across, ahead**2 + left**2 - BODY**2
        root = b**2 - a * c
        s = (b - np.sqrt(np.maximum(root, 0.0))) / a
        hit = (root > 0.0) & (s > 0.0) & (s < depth) & (s * up > -1.0) & (s * up < 0.7)
        depth, labels = np.where(hit, s, depth), np.where(hit, np.int16(label), labels)
    X_WC = np.eye(4)
    X_WC[:3, 0] = math.sin(yaw), -math.cos(yaw), 0.0
    X_WC[:3, 1] = 0.0, 0.0, -1.0
    X_WC[:3, 2] = math.cos(yaw), math.sin(yaw), 0.0
    X_WC[2, 3] = 1.0
    return Look(DepthView(depth.astype(np.float32), LENS, X_WC), labels, time)


def known(*looks, until=None, robot=(0.0, 0.0)):
    """The things that are known after these looks, and after a time in which nothing is seen."""
    things = ()
    for one in looks:
        things = remembered(
            things, (one,), PARAMETERS, robot=robot, floor_height=0.0, time=one.time
        )
    if until is not None:
        things = remembered(things, (), PARAMETERS, robot=robot, floor_height=0.0, time=until)
    return things


@pytest.mark.parametrize(("x", "y"), [(0.8, 0.0), (1.5, 0.6), (3.0, -1.0)])
def test_the_middle_of_who_is_seen(x, y):
    (anna,) = known(look(0.0, (ANNA, x, y)))
    assert anna.label == ANNA
    assert anna.position == pytest.approx((x, y), abs=0.15)


def test_who_stands_beside_the_robot_is_remembered_out_of_view():
    standing = [look(0.1 * k, (ANNA, 1.0, 0.3)) for k in range(7)]
    # It looks away; nothing tells that she has gone.
    away = look(1.0, yaw=math.pi / 2)
    assert known(*standing, away, until=0.6 + STOOD - 0.1)
    assert not known(*standing, away, until=0.6 + STOOD + 0.1)


def test_who_is_glimpsed_once_is_not_taken_for_standing():
    # Somebody who walks by: before the first look, and between looks far apart, nobody knows.
    glimpse = look(0.0, (ANNA, 1.0, 0.3))
    again = [look(0.1 * k, (ANNA, 1.0, 0.3)) for k in range(7)]
    later = look(0.6 + LONGEST_GAP + 0.1, (ANNA, 1.0, 0.3))
    for looks in ((glimpse,), (*again, later)):
        last = looks[-1].time
        assert known(*looks, until=last + ELSEWHERE - 0.1)
        assert not known(*looks, until=last + ELSEWHERE + 0.1)


def test_who_walks_or_is_farther_off_is_forgotten_sooner():
    walking = [look(0.1 * k, (ANNA, 1.0, 0.3 - 0.1 * k)) for k in range(5)]
    far = [look(0.1 * k, (ANNA, BESIDE + 0.3, 0.0)) for k in range(5)]
    for looks in (walking, far):
        assert known(*looks, until=0.4 + ELSEWHERE - 0.1)
        assert not known(*looks, until=0.4 + ELSEWHERE + 0.1)


def test_who_was_seen_to_stand_for_long_is_remembered_from_afar():
    waiting = [look(0.3 * k, (ANNA, BESIDE + 0.5, 0.0)) for k in range(9)]
    assert known(*waiting, until=2.4 + STOOD - 0.1)
    assert not known(*waiting, until=2.4 + STOOD + 0.1)


def test_who_stops_walking_stands():
    walking = [look(0.1 * k, (ANNA, 1.0, 0.3 - 0.1 * k)) for k in range(5)]
    stopped = [look(0.4 + 0.1 * k, (ANNA, 1.0, -0.1)) for k in range(1, 8)]
    assert known(*walking, *stopped, until=10.0)


def test_a_place_that_is_seen_empty_is_free_at_once():
    seen = look(0.0, (ANNA, 1.2, 0.0))
    assert known(seen, look(0.1)) == ()
    # An older view tells nothing; and one whose border cuts her place off does not, either.
    assert len(known(look(0.2, (ANNA, 1.2, 0.0)), look(0.1))) == 1
    assert len(known(seen, look(0.1, yaw=math.radians(36.0)))) == 1


def test_somebody_before_her_place_tells_nothing_of_it():
    anna, ben = known(look(0.0, (ANNA, 2.0, 0.0)), look(0.1, (BEN, 1.0, 0.0)))
    assert (anna.label, ben.label) == (ANNA, BEN)
    assert anna.time == 0.0


def test_who_is_seen_elsewhere_is_no_more_where_they_were():
    (anna,) = known(look(0.0, (ANNA, 1.5, 0.5)), look(1.0, (ANNA, 0.5, 1.5), yaw=math.pi / 2))
    assert anna.position == pytest.approx((0.5, 1.5), abs=0.15)


def only(one, shown):
    """A look in which something hides people but for these pixels."""
    before = (one.labels != 0) & ~shown
    depth = np.where(before, np.float32(0.5), one.view.depth)
    labels = np.where(before, np.int16(0), one.labels)
    return Look(dc.replace(one.view, depth=depth), labels, one.time)


def test_the_head_alone_over_a_shelf_is_enough():
    rows = np.indices((LENS.height, LENS.width))[0]
    # Of her, only what is higher than the map's band.
    head = rows < LENS.cy - 0.45 / 1.2 * LENS.fy
    (anna,) = known(look(0.0, (ANNA, 1.4, 0.0)), only(look(0.1, (ANNA, 1.4, 0.2)), head))
    assert anna.time == 0.1
    assert anna.position == pytest.approx((1.4, 0.2), abs=0.15)
    assert not len(anna.cells)
    map_ = OccupancyMap(1, 1, 0.0, 0.05, (0.0, -2.0), np.full((80, 80), -20, np.int8))
    assert with_moving(map_, (anna,), PARAMETERS, 0.0).log_odds.max() == PARAMETERS.newest


def test_who_is_out_of_range_or_on_another_storey_is_no_more_where_they_were():
    seen = look(0.0, (ANNA, 1.4, 0.0))
    short = dc.replace(PARAMETERS, max_range=2.0)
    for parameters, floor_height in ((short, 0.0), (PARAMETERS, 3.0)):
        things = known(seen)
        one = look(0.1, (ANNA, 2.5, 0.0))
        assert not remembered(
            things, (one,), parameters, robot=(0.0, 0.0), floor_height=floor_height, time=0.1
        )


def test_a_few_pixels_move_nobody():
    seen, other = look(0.0, (ANNA, 1.2, 0.0)), look(0.1, (ANNA, 2.0, 1.0))
    few = np.zeros(other.labels.shape, bool)
    few[tuple(np.argwhere(other.labels == ANNA).T[:, : LEAST_PIXELS // 2])] = True
    stray = Look(seen.view, np.where(few, other.labels, np.int16(0)), 0.1)
    assert (stray.labels == ANNA).any()
    (anna,) = known(seen, stray)
    assert anna.position == pytest.approx((1.2, 0.0), abs=0.15)
    assert anna.time == 0.0
    assert not known(stray)


@pytest.mark.parametrize("turn", [-45.0, 45.0])
def test_the_middle_of_who_is_cut_off_by_the_border(turn):
    whole = look(0.0, (ANNA, 1.0, 0.0))
    # Less than half of her is in view then.
    cut = look(0.0, (ANNA, 1.0, 0.0), yaw=math.radians(turn))
    assert 0 < (cut.labels == ANNA).sum() < 0.5 * (whole.labels == ANNA).sum()
    (anna,) = known(cut)
    assert anna.position == pytest.approx((1.0, 0.0), abs=0.15)


def test_looks_that_make_no_sense_are_left_out():
    good = look(0.0, (ANNA, 1.2, 0.0))
    lost = dc.replace(good.view, X_WC=np.full((4, 4), math.nan))
    assert known(dc.replace(good, view=lost)) == ()


def test_a_view_says_nothing_where_somebody_is():
    one = look(0.0, (ANNA, 1.2, 0.0))
    depth = without(one).depth
    np.testing.assert_array_equal(depth == 0.0, one.labels == ANNA)
    empty = look(0.0)
    assert without(empty) is empty.view
    assert wanted((ANNA, BEN))[[ANNA, BEN, 8]].tolist() == [ANNA, BEN, 0]


def test_cells_around_a_point():
    found = {tuple(cell) for cell in cells_around(0.13, -0.42, 0.25, 0.05).tolist()}
    brute = {
        (i, j)
        for i in range(-30, 30)
        for j in range(-30, 30)
        if math.hypot(0.05 * (i + 0.5) + 0.42, 0.05 * (j + 0.5) - 0.13) <= 0.25
    }
    assert found == brute


def test_the_layer_lies_over_the_map_and_leaves_walls_as_they_are():
    log_odds = np.full((80, 80), -20, np.int8)
    log_odds[40:, :] = 30
    map_ = OccupancyMap(1, 1, 0.0, 0.05, (0.0, -2.0), log_odds)
    things = known(look(0.0, (ANNA, 1.5, -0.1)))
    layered = with_moving(map_, things, PARAMETERS, 0.0)
    ((x, y),) = [thing.position for thing in things]
    rows, columns = np.indices(log_odds.shape)
    away = np.hypot((columns + 0.5) * 0.05 - x, (rows + 0.5) * 0.05 - 2.0 - y)
    free = rows < 40
    cells = layered.log_odds
    assert (cells[free & (away <= BODY)] == 4).all()
    ring = free & (away > BODY + 0.1) & (away <= BODY + BERTH)
    assert np.isin(cells[ring], (3, 4)).all()
    assert (cells[free & (away > BODY + 0.15)] == -20).all()
    assert (cells[~free] == 30).all()
    # The map itself is as it was, and on another storey nobody is met.
    assert (map_.log_odds == log_odds).all()
    assert with_moving(map_, things, PARAMETERS, 3.0) is map_
