"""The tracking laws in closed loop with a delayed, lagging base, and the controller System."""

import itertools
import math
from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from unilavira_drake.messages import Path, Sweep, read_only
from unilavira_drake.robots.drive_limits import DriveLimits, Reaction, approach, braking_speed
from unilavira_drake.robots.ground_controller import GroundTrackingController
from unilavira_drake.robots.ground_tracking import (
    project,
    remaining_length,
    track_path,
    turn_rate,
)

LIMITS = DriveLimits()
REACTION = Reaction(delay=0.02, lag=0.01)
STEP = 0.01
BASES = [(0.01, 0.0), (0.02, 0.01), (0.02, 0.05), (0.06, 0.03)]
"""(dead time, time constant) of bases that are not all as the controller believes."""


class Base:
    """A unicycle that obeys commands after a dead time and with a first-order lag."""

    def __init__(self, x, y, yaw, delay, lag):
        self.x, self.y, self.yaw, self.speed, self.rate = x, y, yaw, 0.0, 0.0
        self.pipe = deque([(0.0, 0.0)] * max(1, round(delay / STEP)))
        self.gain = min(1.0, STEP / lag) if lag else 1.0

    def move(self, command):
        self.pipe.append(command)
        speed, rate = self.pipe.popleft()
        self.speed += (speed - self.speed) * self.gain
        self.rate += (rate - self.rate) * self.gain
        middle = self.yaw + self.rate * STEP / 2
        self.x += self.speed * math.cos(middle) * STEP
        self.y += self.speed * math.sin(middle) * STEP
        self.yaw += self.rate * STEP


def drive(points, yaw, base, *, start=None, duration=60.0):
    """Follows a polyline; returns rows (t, x, y, cross-track error, speed and rate command)."""
    p_WP = read_only(np.array(points, float))
    x, y = points[0] if start is None else start
    robot = Base(x, y, yaw, *base)
    command, rows = (0.0, 0.0), []
    for k in range(int(duration / STEP)):
        if k % 5 == 0:
            command = track_path(
                p_WP, robot.x, robot.y, robot.yaw, robot.rate, *command, REACTION, LIMITS
            )
        robot.move(command)
        rows.append((k * STEP, robot.x, robot.y, project(p_WP, robot.x, robot.y)[2], *command))
        if k > 100 and command == (0.0, 0.0) and abs(robot.speed) < 1e-4:
            break
    return np.array(rows)


def turn(angle, base, duration=5.0):
    """Turns by an angle; returns (time to rest within 0.01 rad, overshoot)."""
    robot = Base(0.0, 0.0, 0.0, *base)
    rate, settled, overshoot = 0.0, 0.0, 0.0
    for k in range(int(duration / STEP)):
        if k % 5 == 0:
            rate = turn_rate(angle - robot.yaw, robot.rate, rate, REACTION, LIMITS)
        robot.move((0.0, rate))
        overshoot = max(overshoot, math.copysign(1.0, angle) * (robot.yaw - angle))
        if abs(robot.yaw - angle) > 0.01 or abs(robot.rate) > 0.01:
            settled = (k + 1) * STEP
    return settled, overshoot


def test_braking_speed_stops_exactly_on_the_spot():
    for distance in (0.004, 0.02, 0.3, 1.7):
        left, speed = distance, math.inf
        for _ in range(200):
            now = braking_speed(left, 1.0, 0.05)
            assert now <= speed + 1e-12
            speed, left = now, left - now * 0.05
        assert left == pytest.approx(0.0, abs=1e-3)


def test_braking_speed_asks_for_no_more_than_the_deceleration():
    left, speed = 0.8, braking_speed(0.8, 1.0, 0.05)
    while left > 0.0025:
        left -= speed * 0.05
        slower = braking_speed(left, 1.0, 0.05)
        assert speed - slower <= 0.05 * 1.1  # the last step also takes up the remainder
        speed = slower


def test_approach_is_a_clamp_about_the_previous_value():
    assert [approach(1.0, t, 0.25) for t in (5.0, 1.1, -5.0)] == [1.25, 1.1, 0.75]


@pytest.mark.parametrize("base", BASES[:3])
def test_a_quarter_turn_settles_at_rest_in_nearly_the_least_time(base):
    settled, overshoot = turn(math.pi / 2, base)
    least = 1.5 / 3.0 + (math.pi / 2) / 1.5
    assert settled < least + 0.45
    assert overshoot < 0.02


@pytest.mark.parametrize("base", BASES[:3])
@pytest.mark.parametrize("angle", [0.02, -0.3, 1.0, -2.5, math.pi])
def test_every_turn_settles(base, angle):
    settled, overshoot = turn(angle, base)
    assert settled < abs(angle) / 1.5 + 1.1
    assert overshoot < 0.02


def test_a_turning_base_does_not_change_its_mind_beside_the_opposite_heading():
    for error in (math.pi - 0.05, -math.pi + 0.05):
        assert turn_rate(error, 0.4, 0.4, REACTION, LIMITS) > 0.4
        assert turn_rate(error, -0.4, -0.4, REACTION, LIMITS) < -0.4


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(
    "points",
    [
        [(0, 0), (2, 0), (2.4, 0.6), (2.4, 1.6), (3.2, 2.2), (5, 2.2)],
        [(0, 0), (1.0, 0), (1.6, 1.0), (1.6, 2.2), (2.2, 3.2), (3.4, 3.2)],
        [(0, 0), (2, 0), (2, 2)],
        [(0, 0), (2, 0), (2, 0.8), (0, 0.8)],
    ],
)
def test_paths_through_doors_are_followed_within_a_decimetre(points, base):
    rows = drive(points, 0.0, base)
    assert rows[:, 3].max() <= 0.1
    assert math.dist(points[-1], rows[-1, 1:3]) <= 0.06
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(points))
    assert length / rows[-1, 0] > 0.4


@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    yaw=st.floats(-math.pi, math.pi),
    aside=st.floats(-0.3, 0.3),
    bends=st.lists(st.floats(-1.8, 1.8), min_size=0, max_size=3),
)
def test_it_arrives_from_any_heading_within_the_limits_of_the_base(yaw, aside, bends):
    points, heading = [(0.0, 0.0), (1.2, 0.0)], 0.0
    for bend in bends:
        heading += bend
        x, y = points[-1]
        points.append((x + 1.2 * math.cos(heading), y + 1.2 * math.sin(heading)))
    rows = drive(points, yaw, (0.02, 0.01), start=(0.0, aside))
    assert math.dist(points[-1], rows[-1, 1:3]) <= 0.1
    assert rows[:, 4].min() >= -1e-12
    assert rows[:, 4].max() <= LIMITS.max_speed + 1e-12
    assert abs(rows[:, 5]).max() <= LIMITS.max_yaw_rate + 1e-12
    assert abs(np.diff(rows[:, 4])).max() <= 0.05 + 1e-9
    assert abs(np.diff(rows[:, 5])).max() <= 0.15 + 1e-9


def test_a_mirrored_path_gives_the_mirrored_commands_bit_by_bit():
    points = [(0, 0), (1.3, 0.2), (1.5, 1.4), (0.4, 2.0)]
    ours = drive(points, 0.7, (0.02, 0.01))
    mirrored = drive([(x, -y) for x, y in points], -0.7, (0.02, 0.01))
    assert (mirrored * [1, 1, -1, 1, 1, -1] == ours).all()


def test_a_base_that_faces_away_turns_before_it_drives():
    rows = drive([(0, 0), (3, 0)], math.pi, (0.02, 0.01))
    assert rows[:, 1].min() > -0.02
    first = np.flatnonzero(rows[:, 4] > 0)[0]
    assert rows[:first, 5].any()


def test_project_and_remaining_length():
    p_WP = read_only(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 3.0]]))
    assert project(p_WP, 0.5, 0.4) == (0, 0.5, pytest.approx(0.4))
    assert project(p_WP, 2.5, 1.0) == (2, 1.0, pytest.approx(0.5))
    assert project(p_WP, -3.0, 0.0) == (0, 0.0, pytest.approx(3.0))
    assert remaining_length(p_WP, 0, 0.5) == pytest.approx(4.5)
    assert project(p_WP[:1].copy(), 3.0, 4.0) == (0, 0.0, 5.0)


def controller_command(path, sweep, *, yaw=0.0, until=0.0, twist=(0, 0, 0, 0, 0, 0)):
    controller = GroundTrackingController(limits=LIMITS, reaction=REACTION)
    simulator = Simulator(controller)
    context = simulator.get_mutable_context()
    pose = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), np.zeros(3))
    for name, value in (("path", path), ("sweep", sweep), ("pose_estimate", pose)):
        controller.GetInputPort(name).FixValue(context, AbstractValue.Make(value))
    controller.GetInputPort("twist").FixValue(context, np.array(twist, float))
    simulator.AdvanceTo(until)
    simulator.AdvancePendingEvents()
    return controller.GetOutputPort("desired_command").Eval(context)


AHEAD = np.array([[0.0, 0.0], [3.0, 0.0]])


def test_the_controller_follows_the_path_of_its_own_turn_of_the_ring():
    command = controller_command(Path(n=3, p_WP=AHEAD), Sweep(n=3), until=0.5)
    assert command[0] > 0.4
    assert command[1] == 0.0
    assert command[3] == pytest.approx(0.5)


def test_a_newer_sweep_takes_over_from_an_old_path():
    command = controller_command(Path(n=3, p_WP=AHEAD), Sweep(4, True, 1.0), until=0.5)
    assert command[0] == 0.0
    assert command[2] > 0.5


@pytest.mark.parametrize("path", [Path(), Path(n=3), Path(n=3, p_WP=AHEAD)])
def test_the_controller_rests_without_path_and_sweep(path):
    sweep = Sweep(n=4)
    assert controller_command(path, sweep, until=0.5).tolist() == [0.0, 0.0, 0.0, 0.5]


def test_it_brakes_instead_of_jumping_when_the_path_ends():
    controller = GroundTrackingController(limits=LIMITS, reaction=REACTION)
    context = controller.CreateDefaultContext()
    for name, value in (
        ("path", Path(n=1)),
        ("sweep", Sweep()),
        ("pose_estimate", RigidTransform()),
    ):
        controller.GetInputPort(name).FixValue(context, AbstractValue.Make(value))
    controller.GetInputPort("twist").FixValue(context, np.zeros(6))
    context.SetDiscreteState(np.array([0.8, 0.0, -1.0, 0.0]))
    simulator = Simulator(controller, context)
    simulator.AdvanceTo(0.04)
    command = controller.GetOutputPort("desired_command").Eval(context)
    assert command[:3] == pytest.approx([0.75, 0.0, -0.85])
