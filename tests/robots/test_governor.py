"""The governor alone: limits, watchdogs and stopping before walls, in a kinematic roll-out."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw

from unilavira_drake.mapping.occupancy import NEWEST
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.robots.drive_limits import DriveLimits
from unilavira_drake.robots.governor import Governor
from unilavira_drake.robots.stopping import (
    Footprint,
    free_distance,
    stoppable_speed,
)

LIMITS = DriveLimits()
FOOTPRINT = Footprint()
RESOLUTION = 0.05
SIDE = 160
ORIGIN = (-4.0, -4.0)


def empty_map():
    return np.full((SIDE, SIDE), -5, np.int8)


def map_of(log_odds, time=0.0):
    return OccupancyMap(
        n=1, version=1, time=time, resolution=RESOLUTION, origin=ORIGIN, log_odds=log_odds
    )


def cell_centers(log_odds):
    rows, columns = np.nonzero(log_odds > 0)
    return np.stack([columns + 0.5, rows + 0.5], axis=1) * RESOLUTION + np.array(ORIGIN)


def wall(distance, angle):
    """A wall two cells thick whose near face is ``distance`` away in direction ``angle``."""
    log_odds = empty_map()
    index = (np.arange(SIDE) + 0.5) * RESOLUTION
    x, y = np.meshgrid(index + ORIGIN[0], index + ORIGIN[1])
    depth = x * math.cos(angle) + y * math.sin(angle) - distance
    log_odds[(depth >= 0.0) & (depth < 0.11)] = 5
    return log_odds


def in_body(points, x, y, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = points[:, 0] - x, points[:, 1] - y
    return c * dx + s * dy, c * dy - s * dx


def touched(points, x, y, yaw):
    px, py = in_body(points, x, y, yaw)
    return bool(np.any((abs(px) < FOOTPRINT.half_length) & (abs(py) < FOOTPRINT.half_width)))


class Bench:
    """A Governor with fixed inputs that moves a perfect unicycle."""

    def __init__(self, log_odds, **options):
        self.governor = Governor(limits=LIMITS, footprint=FOOTPRINT, **options)
        self.context = self.governor.CreateDefaultContext()
        self.points = cell_centers(log_odds)
        self.x = self.y = self.yaw = self.time = 0.0
        self.command = np.zeros(3)
        self.log_odds = log_odds
        self.fix_map(0.0)

    def fix(self, name, value):
        self.governor.GetInputPort(name).FixValue(self.context, value)

    def fix_map(self, time):
        self.fix("map", AbstractValue.Make(map_of(self.log_odds, time)))

    def tick(self, desired, *, issued=None, pose=None):
        """Governs one command and moves for one period; returns the command let through."""
        self.context.SetTime(self.time)
        here = RigidTransform(RollPitchYaw(0.0, 0.0, self.yaw), [self.x, self.y, 0.0])
        self.fix("pose_estimate", AbstractValue.Make(here if pose is None else pose))
        self.fix("twist", np.array([0.0, 0.0, self.command[2], self.command[0], 0.0, 0.0]))
        stamp = self.time if issued is None else issued
        self.fix("desired_command", np.array([*desired, stamp], float))
        self.context.SetDiscreteState(self.governor.EvalUniquePeriodicDiscreteUpdate(self.context))
        self.command = np.array(self.governor.GetOutputPort("base_command").Eval(self.context))
        middle = self.yaw + self.command[2] * LIMITS.period / 2
        self.x += self.command[0] * math.cos(middle) * LIMITS.period
        self.y += self.command[0] * math.sin(middle) * LIMITS.period
        self.yaw += self.command[2] * LIMITS.period
        self.time += LIMITS.period
        return self.command


def brute_force_distance(points, curvature, backwards, horizon):
    """Moves the base in steps of 1 mm until its leading edge has taken in a new cell."""
    length = FOOTPRINT.half_length + FOOTPRINT.standoff
    width = FOOTPRINT.half_width + RESOLUTION / 2
    way = -1.0 if backwards else 1.0

    def inside(s):
        yaw = curvature * s
        if abs(curvature) < 1e-9:
            x, y = s, 0.0
        else:
            x, y = math.sin(yaw) / curvature, (1 - math.cos(yaw)) / curvature
        px, py = in_body(points, x, y, yaw)
        return way * px, (abs(px) < length) & (abs(py) < width)

    ahead, at_start = inside(0.0)
    if np.any(at_start & (ahead >= FOOTPRINT.half_length)):
        return 0.0
    before = at_start
    for k in range(1, int(horizon / 0.001) + 1):
        ahead, now = inside(way * k * 0.001)
        # Only what comes in through the leading edge counts, not what a side swings over.
        if np.any(now & ~before & (ahead > length - 0.02)):
            return k * 0.001
        before = now
    return horizon


def kernel_distance(log_odds, curvature, backwards, horizon=1.0, pose=(0.0, 0.0, 0.0)):
    map_ = map_of(log_odds)
    return free_distance(
        map_.log_odds, ORIGIN, RESOLUTION, *pose, curvature, backwards, horizon, FOOTPRINT
    )


def test_free_distance_straight_on_is_the_gap_less_the_standoff():
    log_odds = empty_map()
    log_odds[80, 110] = 5  # centre at x = 1.525, y = 0.025
    expected = 1.525 - FOOTPRINT.half_length - FOOTPRINT.standoff
    assert kernel_distance(log_odds, 0.0, False, 3.0) == pytest.approx(expected)
    assert kernel_distance(log_odds, 0.0, True, 3.0) == 3.0
    behind = kernel_distance(log_odds, 0.0, True, 3.0, (0.0, 0.0, math.pi))
    assert behind == pytest.approx(expected)


def test_cells_beside_the_corridor_and_under_the_base_are_ignored():
    log_odds = empty_map()
    log_odds[80 + 7, 90:120] = 5  # centres at y = 0.375, beyond half the width
    log_odds[78:82, 76:84] = 5  # under the base
    assert kernel_distance(log_odds, 0.0, False, 2.0) == 2.0


def test_a_cell_within_the_standoff_stops_at_once():
    log_odds = empty_map()
    log_odds[80, 87] = 5  # centre at x = 0.375, between 0.345 and 0.395
    assert kernel_distance(log_odds, 0.0, False) == 0.0
    assert kernel_distance(log_odds, 0.0, True) == 1.0


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    curvature=st.floats(-3.0, 3.0),
    backwards=st.booleans(),
    cells=st.lists(st.tuples(st.integers(55, 105), st.integers(55, 105)), min_size=1, max_size=4),
)
def test_free_distance_on_arcs_agrees_with_brute_force(curvature, backwards, cells):
    assume(abs(curvature) > 1e-3)
    log_odds = empty_map()
    for row, column in cells:
        log_odds[row, column] = 5
    expected = brute_force_distance(cell_centers(log_odds), curvature, backwards, 0.8)
    assert kernel_distance(log_odds, curvature, backwards, 0.8) == pytest.approx(expected, abs=0.02)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    distance=st.floats(0.6, 2.5),
    angle=st.floats(-0.6, 0.6),
    speed=st.floats(0.4, 5.0),
    backwards=st.booleans(),
)
def test_it_stops_before_a_wall_straight_ahead(distance, angle, speed, backwards):
    bench = Bench(wall(distance, angle + (math.pi if backwards else 0.0)), map_timeout=math.inf)
    assume(not touched(bench.points, 0.0, 0.0, 0.0))
    for _ in range(160):
        bench.tick((-speed if backwards else speed, 0.0, 0.0))
        assert not touched(bench.points, bench.x, bench.y, bench.yaw)
    assert bench.command[0] == pytest.approx(0.0, abs=1e-2)
    # It did go: at most the standoff, a cell and the slowest creep are left.
    assert free_distance_now(bench, backwards) < 0.06


def free_distance_now(bench, backwards):
    pose = (bench.x, bench.y, bench.yaw)
    return kernel_distance(bench.log_odds, 0.0, backwards, 5.0, pose)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    distance=st.floats(1.0, 2.0),
    angle=st.floats(-0.5, 0.5),
    speed=st.floats(0.2, 2.0),
    rate=st.floats(-0.6, 0.6),
)
def test_on_arcs_it_never_drives_its_front_into_a_wall(distance, angle, speed, rate):
    bench = Bench(wall(distance, angle), map_timeout=math.inf)
    for _ in range(160):
        bench.tick((speed, 0.0, rate))
        if bench.command[0] < 1e-3 and bench.time > 0.5:
            return
        px, py = in_body(bench.points, bench.x, bench.y, bench.yaw)
        front = (abs(py) < FOOTPRINT.half_width) & (px > 0.1) & (px < FOOTPRINT.half_length)
        assert not front.any()


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    desired=st.lists(
        st.tuples(st.floats(), st.floats(), st.floats(), st.sampled_from([0.0, 0.2, 1.0])),
        min_size=1,
        max_size=30,
    )
)
def test_nothing_gets_past_the_limits(desired):
    bench = Bench(empty_map(), map_timeout=math.inf)
    before = np.zeros(3)
    for vx, vy, wz, age in desired:
        after = bench.tick((vx, vy, wz), issued=bench.time - age)
        assert np.isfinite(after).all()
        assert after[1] == 0.0
        assert abs(after[0]) <= LIMITS.max_speed + 1e-12
        assert abs(after[2]) <= LIMITS.max_yaw_rate + 1e-12
        assert abs(after[0] - before[0]) <= LIMITS.max_acceleration * LIMITS.period + 1e-12
        assert abs(after[2] - before[2]) <= LIMITS.max_yaw_acceleration * LIMITS.period + 1e-12
        before = after


def test_a_fair_command_passes_unchanged_once_reached():
    bench = Bench(empty_map(), map_timeout=math.inf)
    for _ in range(20):
        command = bench.tick((0.5, 0.0, -0.4))
    assert command == pytest.approx([0.5, 0.0, -0.4])


@pytest.mark.parametrize("stamp", [-1.0, math.nan, math.inf])
def test_a_stale_or_stampless_command_brakes_to_rest(stamp):
    bench = Bench(empty_map(), map_timeout=math.inf)
    for _ in range(30):
        bench.tick((0.8, 0.0, 1.0))
    speeds = [bench.tick((0.8, 0.0, 1.0), issued=stamp)[0] for _ in range(20)]
    assert speeds[0] == pytest.approx(0.75)
    assert speeds[-1] == 0.0
    assert bench.command[2] == 0.0


def test_a_stale_map_stops_translation_but_not_turning():
    bench = Bench(empty_map(), map_timeout=0.5)
    for _ in range(30):
        command = bench.tick((0.8, 0.0, 1.0))
    assert command == pytest.approx([0.0, 0.0, 1.0])
    bench.fix_map(bench.time)
    assert bench.tick((0.8, 0.0, 1.0))[0] == pytest.approx(0.05)


def test_a_lost_pose_stops_translation():
    bench = Bench(empty_map(), map_timeout=math.inf)
    lost = RigidTransform([math.nan, 0.0, 0.0])
    for _ in range(3):
        assert bench.tick((0.8, 0.0, 0.0), pose=lost)[0] == 0.0


def test_turning_in_place_is_never_blocked_by_things():
    log_odds = np.full((SIDE, SIDE), 5, np.int8)
    bench = Bench(log_odds, map_timeout=math.inf)
    for _ in range(20):
        command = bench.tick((0.5, 0.0, 1.2))
    assert command == pytest.approx([0.0, 0.0, 1.2])


def person(x, y):
    """A map with the cells of someone who was just seen."""
    log_odds = empty_map()
    row, column = ((value - low) / RESOLUTION for value, low in zip((y, x), ORIGIN, strict=True))
    log_odds[int(row) - 1 : int(row) + 2, int(column) - 1 : int(column) + 2] = NEWEST
    return log_odds


@pytest.mark.parametrize("y", [0.45, -0.45])
def test_a_turn_waits_for_people_within_its_sweep_till_they_are_gone(y):
    bench = Bench(person(0.0, y), map_timeout=math.inf, newest=NEWEST)
    for _ in range(20):
        assert bench.tick((0.0, 0.0, 1.2)) == pytest.approx(np.zeros(3))
    bench.log_odds = person(0.0, 2.0 * y)
    bench.fix_map(bench.time)
    for _ in range(20):
        command = bench.tick((0.0, 0.0, 1.2))
    assert command == pytest.approx([0.0, 0.0, 1.2])


def test_a_turn_that_meets_someone_ends_by_braking():
    bench = Bench(empty_map(), map_timeout=math.inf, newest=NEWEST)
    for _ in range(20):
        bench.tick((0.0, 0.0, 1.2))
    bench.log_odds = person(0.0, 0.45)
    bench.fix_map(bench.time)
    rates = [bench.tick((0.0, 0.0, 1.2))[2] for _ in range(20)]
    step = LIMITS.max_yaw_acceleration * LIMITS.period
    assert np.all(np.diff([1.2, *rates]) >= -step - 1e-9)
    assert rates[-1] == 0.0


def test_things_and_a_lost_pose_hold_no_turn_among_people():
    near = person(0.0, 0.45)
    for log_odds, pose in (
        (np.where(near > 0, 5, near).astype(np.int8), None),
        (near, RigidTransform([math.nan, 0.0, 0.0])),
    ):
        bench = Bench(log_odds, map_timeout=math.inf, newest=NEWEST)
        assert bench.tick((0.0, 0.0, 1.2), pose=pose)[2] > 0.0


def test_it_may_back_away_from_a_wall_it_faces():
    bench = Bench(wall(0.37, 0.0), map_timeout=math.inf)
    assert bench.tick((0.5, 0.0, 0.0))[0] == 0.0
    assert bench.tick((-0.5, 0.0, 0.0))[0] == pytest.approx(-0.05)


def test_stoppable_speed_solves_its_equation():
    for free in (0.01, 0.3, 2.0):
        v = stoppable_speed(free, 1.0, 0.05)
        assert v * v / 2.0 + 0.05 * v == pytest.approx(free)
    assert stoppable_speed(-0.1, 1.0, 0.05) == 0.0
