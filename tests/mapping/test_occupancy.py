import dataclasses as dc
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from unilavira_drake.mapping.depth_scan import HIT_STEP, LIMIT, symmetric_columns
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MAX_FRAME, MappingParameters, integrate
from unilavira_drake.messages import Intrinsics, OccupancyMap

PARAMETERS = MappingParameters()
TABLE = (2.0, 0.0, 0.7, 3.0, 0.8, 0.75)
CRATE = (0.2, -1.0, 0.0, 0.7, -0.5, 0.5)
HALL = (-1.0, -1.5, 4.0, 3.0)


def build(views, start=None, position=(0.0, 0.0), parameters=PARAMETERS, **named):
    named = {"floor_height": 0.0, "n": 1, "time": 0.0, **named}
    return integrate(
        start or OccupancyMap(), views, parameters=parameters, position=position, **named
    )


def turn_around(look, ray_cast, intrinsics, boxes=(), steps=8, mirror=False, **kwargs):
    views = []
    for k in range(steps):
        X_WC = look(0.1, 0.2, yaw=0.1 + math.tau * k / steps, **kwargs)
        depth = ray_cast(X_WC, boxes)
        if mirror:
            X_WC = look(0.1, -0.2, yaw=-0.1 - math.tau * k / steps, **kwargs)
            depth = depth[:, ::-1]
        views.append(DepthView(depth, intrinsics, X_WC))
    return views


def centers(occupancy, mask):
    rows, columns = np.nonzero(mask)
    r = occupancy.resolution
    return occupancy.origin[0] + (columns + 0.5) * r, occupancy.origin[1] + (rows + 0.5) * r


def distance_to_rectangle(x, y, box):
    dx = np.maximum(np.maximum(box[0] - x, x - box[2]), 0)
    dy = np.maximum(np.maximum(box[1] - y, y - box[3]), 0)
    return np.hypot(dx, dy)


def outside_hall(x, y):
    return (x < HALL[0]) | (x > HALL[2]) | (y < HALL[1]) | (y > HALL[3])


@pytest.mark.parametrize("pitch", [0.0, 0.3, -0.1])
def test_a_hall_is_mapped_as_it_is(look, ray_cast, intrinsics, pitch):
    boxes = (TABLE, CRATE)
    occupancy = build(turn_around(look, ray_cast, intrinsics, boxes, steps=12, pitch=pitch))
    x, y = centers(occupancy, occupancy.log_odds > 0)
    to_wall = np.minimum.reduce(
        [np.abs(x - HALL[0]), np.abs(x - HALL[2]), np.abs(y - HALL[1]), np.abs(y - HALL[3])]
    )
    rectangles = [(b[0], b[1], b[3], b[4]) for b in boxes]
    to_box = np.minimum.reduce([distance_to_rectangle(x, y, r) for r in rectangles])
    assert np.minimum(to_wall, to_box).max() <= occupancy.resolution
    assert np.sum(to_wall < 0.06) > 200
    assert np.sum(to_box < 0.06) > 20
    x, y = centers(occupancy, occupancy.log_odds < 0)
    assert not outside_hall(x, y).any()
    deep = [(r[0] + 0.05, r[1] + 0.05, r[2] - 0.05, r[3] - 0.05) for r in rectangles]
    assert min(distance_to_rectangle(x, y, r).min() for r in deep) > 0
    assert len(x) > 0.5 * 5.0 * 4.5 / occupancy.resolution**2


def test_unknown_stays_unknown(look, ray_cast, intrinsics):
    occupancy = build([DepthView(ray_cast(look(0, 0), ()), intrinsics, look(0, 0))])
    x, y = centers(occupancy, occupancy.log_odds == 0)
    behind = (x < -0.5) & (x > -1) & (np.abs(y) < 1)
    assert behind.sum() == pytest.approx(10 * 40, abs=50)
    x, _ = centers(occupancy, occupancy.log_odds < 0)
    assert x.min() > -0.4  # only the footprint lies behind the camera


def test_a_mirrored_world_gives_the_mirrored_map(look, ray_cast, intrinsics):
    boxes = (TABLE, CRATE)
    here = build(turn_around(look, ray_cast, intrinsics, boxes), position=(0.1, 0.2))
    there = build(turn_around(look, ray_cast, intrinsics, boxes, mirror=True), position=(0.1, -0.2))
    assert here.shape == there.shape
    assert there.origin[1] == pytest.approx(-here.origin[1] - here.shape[0] * here.resolution)
    # A centre on the border of two bearings may fall on either side of it.
    assert np.mean(there.log_odds[::-1] != here.log_odds) < 1e-4
    assert np.array_equal(there.log_odds[::-1] > 0, here.log_odds > 0)


def test_a_new_value_each_time_and_the_old_one_untouched(look, ray_cast, intrinsics):
    view = DepthView(ray_cast(look(0, 0), ()), intrinsics, look(0, 0))
    first = build([view])
    before = first.log_odds.copy()
    second = build([view], first, n=2, time=1.5)
    assert (second.version, second.n, second.time) == (first.version + 1, 2, 1.5)
    assert np.array_equal(first.log_odds, before)
    assert not np.shares_memory(first.log_odds, second.log_odds)
    assert not second.log_odds.flags.writeable


def test_evidence_saturates_and_is_taken_back(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    empty = DepthView(ray_cast(X_WC, ()), intrinsics, X_WC)
    full = DepthView(ray_cast(X_WC, ((2, -0.2, 0, 2.4, 0.2, 1),)), intrinsics, X_WC)
    occupancy = build([full] * 10)
    cell = occupancy.cell(2.01, 0.01)
    assert occupancy.log_odds[cell] == LIMIT
    occupancy = build([empty] * 12, occupancy)
    assert occupancy.log_odds[cell] < 0
    assert occupancy.log_odds.min() >= -LIMIT


def test_a_low_thing_that_left_the_view_stays(look, ray_cast, intrinsics):
    low = (1.0, -0.3, 0.0, 1.3, 0.3, 0.2)
    far, near = look(-0.8, 0), look(0.7, 0)
    occupancy = build([DepthView(ray_cast(far, (low,)), intrinsics, far)] * 2)
    cell = occupancy.cell(1.01, 0.02)
    seen = occupancy.log_odds[cell]
    assert seen == 2 * HIT_STEP
    occupancy = build([DepthView(ray_cast(near, (low,)), intrinsics, near)] * 10, occupancy)
    assert occupancy.log_odds[cell] == seen


def test_nothing_behind_the_first_obstacle_is_free(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    low = (1.5, -3.0, 0.0, 1.7, 3.0, 0.4)  # the camera sees floor beyond it
    occupancy = build([DepthView(ray_cast(X_WC, (low,)), intrinsics, X_WC)])
    x, _ = centers(occupancy, occupancy.log_odds < 0)
    assert x.max() < 1.55


def test_free_ends_where_nothing_was_seen(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    depth = ray_cast(X_WC, (), hall=(-20, -20, 20, 20))
    occupancy = build([DepthView(depth, intrinsics, X_WC)])
    x, y = centers(occupancy, occupancy.log_odds < 0)
    assert 4.9 < np.hypot(x, y).max() <= 5.0
    assert not (occupancy.log_odds > 0).any()
    beyond = np.where(depth > 3.0, np.float32(np.inf), depth)
    level = build([DepthView(beyond, intrinsics, X_WC)])
    assert np.hypot(*centers(level, level.log_odds < 0)).max() > 4.9
    blind = np.where(depth > 3.0, np.float32(0), depth)
    short = build([DepthView(blind, intrinsics, X_WC)])
    assert centers(short, short.log_odds < 0)[0].max() <= 3.0


def test_a_drop_is_an_obstacle(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    upper = ray_cast(X_WC, (), hall=(-20, -20, 20, 20))
    lower = look(0, 0, z=0.88 + 2.0)  # the same view, the floor two metres deeper
    deeper = ray_cast(lower, (), hall=(-20, -20, 20, 20), ceiling=4.6)
    over = upper > 2.0  # the floor ends there
    falling = np.where(over, deeper, upper)
    occupancy = build([DepthView(falling, intrinsics, X_WC)])
    x, y = centers(occupancy, occupancy.log_odds < 0)
    assert x[np.abs(y) < 0.3].max() <= 2.1
    x, y = centers(occupancy, occupancy.log_odds > 0)
    assert x[np.abs(y) < 0.3].min() == pytest.approx(2.0, abs=0.1)
    nothing = np.where(over, np.float32(np.inf), upper)
    occupancy = build([DepthView(nothing, intrinsics, X_WC)])
    assert not (occupancy.log_odds > 0).any()


def test_the_grid_grows_in_blocks_and_keeps_what_it_knew(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    first = build([DepthView(ray_cast(X_WC, ()), intrinsics, X_WC)])
    far = look(9.0, -7.0)
    depth = ray_cast(far, (), hall=(-20, -20, 20, 20))
    second = build([DepthView(depth, intrinsics, far)], first, position=(9.0, -7.0))
    assert second.shape[0] % 64 == second.shape[1] % 64 == 0
    i = round((first.origin[1] - second.origin[1]) / first.resolution)
    j = round((first.origin[0] - second.origin[0]) / first.resolution)
    inner = second.log_odds[i : i + first.shape[0], j : j + first.shape[1]]
    known = first.log_odds != 0
    assert np.mean(inner[known] == first.log_odds[known]) > 0.95
    assert second.log_odds[second.cell(9.0, -7.0)] < 0


def shared(one, other):
    """Which tiles of a map are also those of another."""
    return {key for key, tile in one.cells.tiles.items() if other.cells.tiles.get(key) is tile}


def test_tiles_that_did_not_change_are_shared(look, ray_cast, intrinsics):
    here, there = look(0, 0), look(12.0, 0)
    views = [DepthView(ray_cast(X, (CRATE,), hall=(-20, -20, 20, 20)), intrinsics, X)
             for X in (here, there)]  # fmt: skip
    first = build(views[:1])
    second = build(views[1:], first, position=(12.0, 0.0))
    assert shared(first, second) == set(first.cells.tiles)
    third = build(views[:1], second)
    assert shared(second, third) >= set(second.cells.tiles) - set(first.cells.tiles)
    assert shared(second, third) != set(second.cells.tiles)
    for _ in range(12):
        third = build(views[:1], third)
    # Beyond doubt nothing changes any more.
    assert shared(third, build(views[:1], third)) == set(third.cells.tiles)


def test_a_robot_carried_ten_kilometres_away_leaves_nothing_in_between(look, ray_cast, intrinsics):
    def seen(occupancy, x):
        X_WC = look(x, 0)
        depth = ray_cast(look(0, 0), (CRATE,))
        return build([DepthView(depth, intrinsics, X_WC)], occupancy, position=(x, 0.0))

    home = seen(None, 0.0)
    away = seen(home, 10_000.0)
    assert len(away.cells.tiles) == 2 * len(home.cells.tiles)
    assert shared(home, away) == set(home.cells.tiles)
    assert max(away.shape) < 400
    assert away.state_at(10_002.0, 0.0) == home.state_at(2.0, 0.0) == "free"
    assert away.state_at(2.0, 0.0) == "free"
    back = seen(away, 0.0)
    assert max(back.shape) < 400
    np.testing.assert_array_equal(np.sign(back.log_odds), np.sign(home.log_odds))


def test_a_long_way_keeps_the_frame_in_bounds_and_the_map_whole(look, ray_cast, intrinsics):
    hall = (-1e4, -3.0, 1e4, 3.0)
    parameters = dc.replace(PARAMETERS, resolution=0.2)
    occupancy, lengths = OccupancyMap(), []
    for x in np.arange(0.0, 2000.0, 4.0).tolist():
        view = DepthView(ray_cast(look(x, 0), (), hall=hall), intrinsics, look(x, 0))
        occupancy = build([view], occupancy, position=(x, 0.0), parameters=parameters)
        lengths.append(occupancy.shape[1])
        i, j = occupancy.cell(x, 0.0)
        assert 0 <= i < occupancy.shape[0]
        assert 0 <= j < occupancy.shape[1]
        assert occupancy.log_odds[i, j] < 0
    # It grows to its bound, and is cut behind the robot.
    assert 0.98 * MAX_FRAME < max(lengths) <= MAX_FRAME
    assert min(lengths[lengths.index(max(lengths)) :]) >= MAX_FRAME // 2
    assert all(occupancy.state_at(x, 0.0) == "free" for x in range(2000))
    # What lies far behind comes into sight again.
    view = DepthView(ray_cast(look(9.0, 0), (), hall=hall), intrinsics, look(9.0, 0))
    occupancy = build([view], occupancy, position=(9.0, 0.0), parameters=parameters)
    assert occupancy.log_odds[occupancy.cell(100.0, 0.0)] < 0
    assert occupancy.shape[1] <= MAX_FRAME


def test_the_floor_under_the_robot_is_free():
    occupancy = build([], position=(1.0, 2.0))
    x, y = centers(occupancy, occupancy.log_odds < 0)
    assert np.hypot(x - 1.0, y - 2.0).max() <= 0.36
    assert len(x) == pytest.approx(math.pi * 0.36**2 / 0.05**2, rel=0.05)


def test_another_floor_height(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    depth = ray_cast(X_WC, (CRATE,))
    raised = X_WC.copy()
    raised[2, 3] += 3.0
    ground = build([DepthView(depth, intrinsics, X_WC)])
    upstairs = build([DepthView(depth, intrinsics, raised)], floor_height=3.0)
    assert np.array_equal(ground.log_odds, upstairs.log_odds)


def test_mirrored_columns_are_the_mirrored_pixels():
    for width in (640, 641, 7, 1):
        for stride in (1, 2, 3, 4):
            columns = symmetric_columns(width, stride)
            assert np.array_equal(np.sort(width - 1 - columns), columns)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    hnp.arrays(np.float32, st.tuples(st.integers(1, 12), st.integers(1, 16)),
               elements=st.floats(width=32)),
    st.floats(-3, 3),
    st.floats(-1.6, 1.6),
)  # fmt: skip
def test_any_depth_image_is_survived(depth, yaw, pitch):
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    X_WC = np.eye(4)
    level = np.array([[s, 0.0, c], [-c, 0.0, s], [0.0, -1.0, 0.0]])
    X_WC[:3, :3] = level @ np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    X_WC[2, 3] = 0.9
    lens = Intrinsics(depth.shape[1], depth.shape[0], 8.0, 8.0, 7.5, 5.5)
    parameters = dc.replace(PARAMETERS, stride=1)
    occupancy = build([DepthView(depth, lens, X_WC)], parameters=parameters)
    rows, columns = np.nonzero(occupancy.log_odds)
    assert np.abs(occupancy.log_odds).max() <= LIMIT
    x = occupancy.origin[0] + (columns + 0.5) * 0.05
    y = occupancy.origin[1] + (rows + 0.5) * 0.05
    assert np.hypot(x, y).max(initial=0.0) <= 5.1


def test_saturated_readings_are_none(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    depth = ray_cast(X_WC, ())
    parameters = dc.replace(PARAMETERS, saturation=65.5)
    blind = DepthView(np.where(depth > 2.0, np.float32(0.0), depth), intrinsics, X_WC)
    expected = build([blind]).log_odds
    for value in (65.535, np.inf, 70.0):
        saturated = DepthView(np.where(depth > 2.0, np.float32(value), depth), intrinsics, X_WC)
        assert np.array_equal(build([saturated], parameters=parameters).log_odds, expected)
        # Taken for a distance, it tells of free floor, or of a drop.
        assert not np.array_equal(build([saturated]).log_odds, expected)


def test_one_look_is_enough_where_it_is_asked_to_be(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    empty = DepthView(ray_cast(X_WC, ()), intrinsics, X_WC)
    full = DepthView(ray_cast(X_WC, ((2, -0.2, 0, 2.4, 0.2, 1),)), intrinsics, X_WC)

    def front_is_there(occupancy):
        return any(occupancy.state_at(2.02, y) == "occupied" for y in (-0.12, 0.02, 0.12))

    for free_step, before, after in ((4, 1, 3), (4, 10, 10), (LIMIT, 1, 1), (LIMIT, 10, 1)):
        parameters = dc.replace(PARAMETERS, free_step=free_step)
        occupancy = build([full] * before, parameters=parameters)
        for looks in range(after + 1):
            assert front_is_there(occupancy) == (looks < after)
            occupancy = build([empty], occupancy, parameters=parameters)


def test_parameters_that_make_no_sense_are_refused(look, ray_cast, intrinsics):
    for name, value in (
        ("resolution", 0.0), ("resolution", math.nan), ("max_range", -1.0),
        ("max_range", 51.0), ("footprint_radius", 1e9), ("stride", 0), ("free_step", 0),
        ("saturation", math.nan),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must be"):
            dc.replace(PARAMETERS, **{name: value})
    occupancy = build([], parameters=dc.replace(PARAMETERS, resolution=0.1))
    with pytest.raises(ValueError, match=r"cells are 0.1 m"):
        build([], occupancy)
