"""The flight governor alone: limits, fence, watchdogs, and stopping before whatever is ahead."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw

from unilavira_drake.messages import VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.robots.flight_governor import LEASH, FlightGovernor
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.flight_stopping import free_flight, voxels_ahead

LIMITS = FlightLimits()
NO_FENCE = np.array([[-np.inf] * 3, [np.inf] * 3])
RESOLUTION, SIZE, STANDOFF = 0.1, (0.38, 0.38), 0.25
RADIUS = 0.5 * math.hypot(*SIZE)


def map_of(voxels, time=0.0):
    """A map with these voxels occupied and nothing else known."""
    tiles = {}
    for voxel in voxels:
        key = tuple(index // TILE for index in voxel)
        tile = tiles.setdefault(key, np.zeros((TILE, TILE, TILE), np.int8))
        tile[tuple(index % TILE for index in voxel)] = 20
    return VoxelMap(n=1, version=1, time=time, resolution=RESOLUTION, tiles=tiles)


def wall(x, half=12):
    """Voxels of a wall whose near face is at x."""
    i = round(x / RESOLUTION)
    return [(i, j, 10 + k) for j in range(-half, half) for k in range(-10, 15)]


class Bench:
    """A governor with fixed inputs, and an aircraft that is where the setpoint is."""

    def __init__(self, voxels=(), *, start=(0.0, 0.0, 1.0), yaw=0.0, fence=NO_FENCE, follows=True):
        self.governor = FlightGovernor(limits=LIMITS, size=SIZE, fence=fence)
        self.context = self.governor.CreateDefaultContext()
        self.voxels, self.time, self.follows = list(voxels), 0.0, follows
        self.pose, self.yaw = np.array(start), yaw
        self.setpoint = np.full(7, np.nan)
        self.fix("twist", np.zeros(6))
        self.fix_map(0.0)

    def fix(self, name, value):
        self.governor.GetInputPort(name).FixValue(self.context, value)

    def fix_map(self, time):
        self.fix("map", AbstractValue.Make(map_of(self.voxels, time)))

    def tick(self, desired, *, issued=None, late_map=False):
        """Governs one command; returns the setpoint that is let through."""
        self.context.SetTime(self.time)
        if not late_map and round(self.time / LIMITS.period) % 10 == 0:
            self.fix_map(self.time)
        command = np.array([*desired, self.time if issued is None else issued], float)
        self.fix("desired_command", command)
        X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, self.yaw), self.pose)
        self.fix("pose_estimate", Value[RigidTransform](X_WB))
        discrete = self.governor.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.SetDiscreteState(discrete)
        self.setpoint = np.array(discrete.value())
        if self.follows and np.isfinite(self.setpoint).all():
            self.pose = self.setpoint[:3]
        self.time += LIMITS.period
        return self.setpoint

    def chase(self, target, ticks=400, yaw=0.0):
        """Lets a controller without sense ask for a far point at full speed; returns the rows."""
        rows = []
        for _ in range(ticks):
            way = np.array(target) - self.pose
            v = way / max(np.linalg.norm(way), 1e-9) * min(1.0, np.linalg.norm(way))
            rows.append(self.tick([*target, yaw, *v]))
        return np.array(rows)


def gap(voxels, rows):
    """The least distance of the way to a face of the voxels, metres."""
    low = np.array(voxels)[:, None] * RESOLUTION
    off = np.maximum(np.maximum(low - rows[:, :3], rows[:, :3] - low - RESOLUTION), 0.0)
    return np.linalg.norm(off, axis=2).min()


def test_a_smooth_setpoint_passes_unchanged():
    bench = Bench()
    bench.tick([0, 0, 1, 0, 0, 0, 0])
    x, v = 0.0, 0.0
    for _ in range(60):
        v = min(v + LIMITS.max_acceleration * LIMITS.period, 1.0)
        x += v * LIMITS.period
        out = bench.tick([x, 0, 1, 0, v, 0, 0])
    np.testing.assert_allclose(out, [x, 0, 1, 0, v, 0, 0], atol=1e-9)


def test_a_jump_becomes_a_flight_within_the_limits():
    bench = Bench()
    rows = bench.chase((6.0, -4.0, 4.0), yaw=3.0)
    speed = np.hypot(rows[:, 4], rows[:, 5])
    assert speed.max() <= LIMITS.max_speed + 1e-9
    assert rows[:, 6].max() <= LIMITS.max_climb_speed + 1e-9
    change = np.linalg.norm(np.diff(rows[:, 4:], axis=0), axis=1)
    assert change.max() <= LIMITS.max_braking * LIMITS.period + 1e-9
    assert np.abs(np.diff(rows[:, 3])).max() <= LIMITS.max_yaw_rate * LIMITS.period + 1e-9
    np.testing.assert_allclose(rows[-1, :4], [6.0, -4.0, 4.0, 3.0], atol=0.05)


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.floats(1.0, 4.0), st.floats(-0.9, 0.9), st.floats(0.4, 2.0))
def test_it_stops_before_a_wall_from_any_side(distance, across, height):
    voxels = wall(distance)
    bench = Bench(voxels)
    rows = bench.chase((distance + 3.0, across, height), ticks=200)
    # The standoff is kept along the way, which may lead to the wall at an angle.
    assert gap(voxels, rows) >= RADIUS + 0.8 * STANDOFF
    assert np.linalg.norm(rows[-1, 4:]) < 0.2


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.floats(0.0, 2.5), st.floats(0.35, 1.2))
def test_what_turns_up_ahead_is_braked_for_at_once(when, ahead):
    """v^2 / 2a and one period suffice, wherever a wall appears beyond them."""
    bench = Bench()
    rows = [bench.chase((9.0, 0.0, 1.0), ticks=round(when / LIMITS.period) + 1)[-1]]
    speed = float(np.linalg.norm(rows[0][4:]))
    stopping = speed**2 / (2 * LIMITS.max_braking) + LIMITS.period * speed
    bench.voxels = wall(bench.pose[0] + RADIUS + stopping + ahead * 0.3 + STANDOFF)
    bench.fix_map(bench.time)
    rows = bench.chase((9.0, 0.0, 1.0), ticks=80)
    assert gap(bench.voxels, rows) >= RADIUS + STANDOFF - 0.1
    assert np.linalg.norm(rows[-1, 4:]) < 0.05


def test_it_flies_away_from_what_it_is_too_near_to():
    bench = Bench(wall(0.3))
    towards = bench.chase((2.0, 0, 1.0), ticks=20)
    assert towards[-1, 0] < 0.02
    away = bench.chase((-2.0, 0, 1.0), ticks=120)
    assert away[-1, 0] < -1.9


def test_the_fence_is_never_crossed_and_may_be_come_back_to():
    fence = np.array([[-2.0, -2.0, 0.5], [2.0, 2.0, 3.0]])
    bench = Bench(fence=fence)
    rows = bench.chase((9.0, 9.0, 9.0))
    assert (rows[:, :3] <= fence[1] + 1e-9).all()
    np.testing.assert_allclose(rows[-1, :3], fence[1], atol=0.02)
    below = Bench(fence=fence, start=(0.0, 0.0, 0.1))
    rows = below.chase((0.0, 0.0, 0.1), ticks=20)
    assert rows[:, 2].min() >= 0.1 - 1e-9
    rows = below.chase((0.0, 0.0, 1.0), ticks=100)
    assert rows[-1, 2] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("index", range(8))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_ends_in_hovering(index, bad):
    bench = Bench()
    bench.chase((9.0, 0, 1.0), ticks=60)
    command = np.array([bench.pose[0], 0, 1, 0, 1.0, 0, 0, bench.time])
    command[index] = bad
    rows = np.array(
        [bench.tick(command[:7], issued=command[7] if index == 7 else None) for _ in range(60)]
    )
    assert np.isfinite(rows).all()
    assert not rows[-1, 4:].any()
    assert rows[-1, 0] - rows[0, 0] < 1.0 / (2 * LIMITS.max_braking) + 0.06


@pytest.mark.parametrize("fault", ["late command", "late map"])
def test_what_is_late_ends_in_hovering(fault):
    bench = Bench()
    bench.chase((9.0, 0, 1.0), ticks=60)
    since, start = bench.time, bench.pose[0]
    for _ in range(200):
        if fault == "late command":
            out = bench.tick([9.0, 0, 1, 0, 1.0, 0, 0], issued=since)
        else:
            out = bench.tick([9.0, 0, 1, 0, 1.0, 0, 0], late_map=True)
    assert not out[4:].any()
    # A map is late after three seconds, a command after 0.3.
    assert out[0] - start < (3.6 if fault == "late map" else 1.0)
    again = bench.chase((9.0, 0, 1.0), ticks=300)
    assert again[-1, 0] == pytest.approx(9.0, abs=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_lost_pose_never_reaches_the_setpoint(bad):
    bench = Bench(follows=False)
    bench.tick([0, 0, 1, 0, 0, 0, 0])
    bench.pose = np.array([0.0, bad, 1.0])
    rows = np.array([bench.tick([0, 0, 1, 0, 0, 0, 0]) for _ in range(20)])
    assert np.isfinite(rows).all()
    fresh = Bench(start=(0.0, bad, 1.0))
    assert np.isnan(fresh.tick([0, 0, 1, 0, 0, 0, 0])).all()


def test_the_setpoint_does_not_run_away_from_an_aircraft_that_hangs():
    bench = Bench(follows=False)
    for _ in range(200):
        out = bench.tick([9.0, 0, 1, 0, 1.0, 0, 0])
    assert out[0] <= LEASH + LIMITS.max_speed * LIMITS.period + 1e-9


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10**6))
def test_the_free_way_is_that_of_a_ball_marched_in_small_steps(seed):
    rng = np.random.default_rng(seed)
    window = np.where(rng.random((9, 9, 9)) < 0.01, 5, -3).astype(np.int8)
    p = rng.uniform(0.2, 0.7, 3)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    radius = 0.12
    bounds = voxels_ahead(p, direction, 1.0, radius + 0.1, 0.1)
    found = free_flight(window, (0, 0, 0), bounds, 0.1, p, direction, 1.0, radius, radius)
    nowhere = np.array([3, 3, 3, 3, 3, 3])
    assert free_flight(window, (0, 0, 0), nowhere, 0.1, p, direction, 1.0, radius, radius) == 1.0
    centers = (np.argwhere(window > 0) + 0.5) * 0.1
    steps = np.arange(0.0, 1.0, 0.002)
    # What is only grazed may count or not.
    least, most = (1.0, 1.0)
    for center in centers:
        off = np.abs(p + np.outer(steps, direction) - center) - 0.05
        distances = np.linalg.norm(np.maximum(off, 0.0), axis=1)
        way = center - p
        outside = np.copysign(np.maximum(np.abs(way) - 0.05, 0.0), way)
        if (outside if outside.any() else way) @ direction <= 0.0:
            continue
        near, hit = (np.flatnonzero(distances < radius + slack) for slack in (0.003, -0.003))
        least = min(least, steps[near[0]] if len(near) else 1.0)
        most = min(most, steps[hit[0]] if len(hit) else 1.0)
    assert least - 0.01 <= found <= most + 0.01
