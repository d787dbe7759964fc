"""Walking as a pure function, in closed form."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from unilavira_drake.people.crowd import RADIUS, Person
from unilavira_drake.people.walking import (
    ACCELERATION,
    AHEAD,
    Manners,
    RobotSeen,
    Walker,
    _covered,
    next_step,
    swing,
)

PERSON = Person(
    "person_1", 7, "red", walk=((0.0, 0.0), (4.0, 0.0), (4.0, 2.0)), speed=1.0, pauses=(2.0, 3.0)
)
PERIOD = 0.05


class Walk:
    """A person without a body: the wish is what happens, unless ``stuck``."""

    def __init__(self, person=PERSON, manners=None):
        self.person, self.manners = person, manners or Manners()
        self.walker, self.time, self.pose = Walker(), 0.0, (0.0, 0.0, 0.0)
        self.moving = 0.0
        self.trace = []

    def go(self, seconds, robot=None, stuck=False):
        for _ in range(round(seconds / PERIOD)):
            self.walker, wish = next_step(
                self.person,
                self.walker,
                self.manners,
                time=self.time,
                period=PERIOD,
                pose=self.pose,
                moving=self.moving,
                robot=None if robot is None else RobotSeen(*robot),
            )
            x, y, yaw = self.pose
            if stuck:
                self.moving = 0.0
            else:
                self.moving = math.hypot(wish.vx, wish.vy)
                x, y = x + wish.vx * PERIOD, y + wish.vy * PERIOD
            self.pose = (x, y, yaw + wish.yaw_rate * PERIOD)
            self.time += PERIOD
            self.trace.append(self.pose)
        return self.pose


def test_it_walks_at_its_speed_and_faces_where_it_goes():
    walk = Walk()
    x, y, yaw = walk.go(3.0)
    # Two thirds of a second to speed up.
    assert x == pytest.approx(3.0 - 1.0 / 3.0, abs=0.06)
    assert (y, yaw) == pytest.approx((0.0, 0.0), abs=1e-9)
    x, y, yaw = walk.go(2.8)
    assert (x, yaw) == pytest.approx((4.0, math.pi / 2), abs=0.12)


def test_it_rests_at_each_end_as_long_as_its_pauses_say():
    walk = Walk()
    walk.go(30.0)
    still = [
        k
        for k in range(1, len(walk.trace))
        if math.dist(walk.trace[k][:2], walk.trace[k - 1][:2]) < 1e-9
    ]
    runs = []
    for k in still:
        if runs and runs[-1][1] == k - 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    seconds = [(b - a + 1) * PERIOD for a, b in runs if b - a > 10]
    # It slows down and turns round within the rest.
    assert seconds[0] == pytest.approx(2.0, abs=0.45)
    assert seconds[1] == pytest.approx(3.0, abs=0.45)
    assert walk.trace[runs[1][0]][:2] == pytest.approx((0.0, 0.0), abs=0.35)


def test_a_delay_is_waited_for():
    walk = Walk(dataclasses.replace(PERSON, delay=2.0))
    assert walk.go(2.0) == (0.0, 0.0, 0.0)
    assert walk.go(1.0)[0] > 0.3


def test_polite_people_stop_before_the_robot_and_go_on_after():
    walk = Walk()
    walk.go(1.0)
    x, _, _ = walk.go(2.0, robot=(2.2, 0.0))
    assert 1.0 < x < 2.0
    assert walk.go(0.5, robot=(2.2, 0.0))[0] == pytest.approx(x, abs=1e-9)
    assert walk.go(1.5)[0] > x + 0.5


def test_a_robot_beside_or_behind_holds_nobody():
    for bearing in (AHEAD + 0.05, -AHEAD - 0.05, math.pi):
        walk = Walk(dataclasses.replace(PERSON, walk=((0.0, 0.0), (100.0, 0.0))))
        for _ in range(20):
            x, y, _ = walk.pose
            walk.go(0.1, robot=(x + 0.5 * math.cos(bearing), y + 0.5 * math.sin(bearing)))
        assert walk.pose[0] > 1.5


def meet(robot, seconds, *, person=PERSON, manners=None):
    """Lets a person and a robot that drives straight on go their ways; returns the least gap."""
    walk = Walk(person, manners)
    gaps = []
    for _ in range(round(seconds / PERIOD)):
        walk.walker, wish = next_step(
            walk.person, walk.walker, walk.manners, time=walk.time, period=PERIOD, pose=walk.pose,
            moving=walk.moving, robot=robot,
        )  # fmt: skip
        x, y, yaw = walk.pose
        walk.moving = math.hypot(wish.vx, wish.vy)
        walk.pose = (x + wish.vx * PERIOD, y + wish.vy * PERIOD, yaw + wish.yaw_rate * PERIOD)
        walk.time += PERIOD
        x, y = robot.x + robot.vx * PERIOD, robot.y + robot.vy * PERIOD
        robot = dataclasses.replace(robot, x=x, y=y)
        gaps.append(math.hypot(*robot.nearest(*walk.pose[:2])) - RADIUS)
    return min(gaps), walk


def test_polite_people_let_a_robot_pass_that_would_cross_their_way():
    walk = Walk()
    # It comes from the right and will be on the way when the person is.
    robot = RobotSeen(2.0, -3.0, math.pi / 2, 0.35, 0.28, 0.0, 0.8)
    gap, walk = meet(robot, 8.0)
    assert gap > 0.1
    assert walk.pose[0] > 3.0


@pytest.mark.parametrize(("polite", "touched"), [(True, False), (False, True)])
def test_polite_people_give_way_along_their_walk_to_a_robot_that_does_not_see_them(polite, touched):
    # They rest where the walk begins, and it would brush against them.
    resting = dataclasses.replace(PERSON, delay=99.0)
    robot = RobotSeen(-0.45, -3.0, math.pi / 2, 0.35, 0.28, 0.0, 0.8)
    gap, walk = meet(robot, 8.0, person=resting, manners=Manners(polite=polite))
    assert (gap < 0.0) == touched
    # No farther than it takes, and there they rest on.
    assert walk.pose[0] < 0.5
    assert walk.moving == 0.0


def test_who_gives_way_backwards_comes_to_a_stand_first():
    walk = Walk(dataclasses.replace(PERSON, walk=((0.0, 0.0), (100.0, 0.0)), speed=1.2))
    walk.go(2.0)
    x = walk.pose[0]
    # It crosses their way just ahead.
    robot = RobotSeen(x + 0.62, 0.55, -math.pi / 2, 0.35, 0.28, 0.0, -0.8)
    walk.go(0.6, robot=dataclasses.astuple(robot))
    assert walk.walker.way == -1
    xs = [x, *(pose[0] for pose in walk.trace[-12:])]
    speeds = [(b - a) / PERIOD for a, b in itertools.pairwise(xs)]
    # No faster than they brake, through a stand and then back at half their speed.
    changes = [b - a for a, b in itertools.pairwise([1.2, *speeds])]
    assert min(changes) > -2.0 * ACCELERATION * PERIOD - 1e-9
    assert min(map(abs, speeds)) < ACCELERATION * PERIOD
    assert speeds[-1] < 0.0
    assert min(speeds) >= -0.5 * 1.2 - 1e-9


def test_nobody_changes_velocity_faster_than_they_brake_at_the_ends_of_the_walk():
    walk = Walk(dataclasses.replace(PERSON, walk=((0.0, 0.0), (3.0, 0.0)), pauses=(0.5,)))
    walk.go(20.0)
    xs = [pose[0] for pose in walk.trace]
    speeds = [(b - a) / PERIOD for a, b in itertools.pairwise(xs)]
    assert min(speeds) < -0.9
    changes = [abs(b - a) for a, b in itertools.pairwise(speeds)]
    assert max(changes) < 2.0 * ACCELERATION * PERIOD + 1e-9


@pytest.mark.parametrize(("yaw", "pace"), [(0.0, 1.0), (1.2, 0.5), (math.pi, 0.5)])
def test_the_speed_of_who_gives_way_follows_how_they_face(yaw, pace):
    # It comes from behind, and they rest.
    person = dataclasses.replace(PERSON, walk=((0.0, 0.0), (100.0, 0.0)), delay=99.0)
    walk = Walk(person)
    walk.pose = (0.0, 0.0, yaw)
    robot, x = RobotSeen(-0.65, 0.0, 0.0, 0.35, 0.28, 0.3, 0.0), []
    for _ in range(24):
        walk.go(PERIOD, robot=dataclasses.astuple(robot))
        robot = dataclasses.replace(robot, x=walk.pose[0] - 0.65)
        x.append(walk.pose[0])
    assert (x[-1] - x[-2]) / PERIOD == pytest.approx(pace)


@pytest.mark.parametrize("speed", [-1.2, -0.4, 0.0, 0.3, 0.5, 1.2])
def test_the_way_that_is_foreseen_is_the_one_that_is_walked(speed):
    # Backwards: half of 1 m/s; a step of a millisecond is the oracle.
    x, v, step = 0.0, speed, 0.001
    for k in range(1, 1001):
        rate = ACCELERATION if 0.0 <= v < 0.5 else 2.0 * ACCELERATION
        v = v + min(max(0.5 - v, -rate * step), rate * step)
        x += v * step
        if k % 250 == 0:
            assert _covered(speed, 0.5, k * step) == pytest.approx(x, abs=0.003)


def test_nobody_walks_along_close_beside_a_robot_that_drives():
    ways = []
    for speed in (0.5, 0.0):
        robot = RobotSeen(1.0, 0.75, 0.0, 0.35, 0.28, speed, 0.0)
        person = dataclasses.replace(PERSON, walk=((1.0, 0.0), (100.0, 0.0)))
        walk = Walk(person)
        walk.pose = (1.0, 0.0, 0.0)
        ways.append(walk.go(PERIOD, robot=dataclasses.astuple(robot))[0])
    assert ways[0] == 1.0
    assert ways[1] > 1.0


def test_nobody_walks_into_what_a_standing_robot_sweeps_when_it_turns():
    # It stands beside the way, and its long side leaves room to pass; its corners would not.
    walk = Walk(dataclasses.replace(PERSON, walk=((0.0, 0.0), (100.0, 0.0))), Manners(patience=99))
    robot = (2.0, 0.6, 0.0, 0.345, 0.285)
    walk.go(5.0, robot=robot)
    assert math.dist(walk.pose[:2], robot[:2]) > math.hypot(0.345, 0.285) + RADIUS
    assert walk.moving == 0.0


def test_who_is_within_that_may_leave_but_not_go_farther_in():
    robot = RobotSeen(0.0, 0.55, 0.0, 0.345, 0.285)
    wishes = []
    for way in (1.0, -1.0):
        person = dataclasses.replace(PERSON, walk=((0.45, 0.0), (0.45 + 2.0 * way, 0.0)))
        _, wish = next_step(
            person, Walker(), Manners(), time=0.0, period=PERIOD, pose=(0.45, 0.0, math.acos(way)),
            moving=0.0, robot=robot,
        )  # fmt: skip
        wishes.append(wish.vx)
    assert wishes[0] > 0.0
    assert wishes[1] == pytest.approx(0.0)


@pytest.mark.parametrize(("z", "waits"), [(0.0, True), (1.5, True), (2.8, False), (-2.8, False)])
def test_a_robot_on_another_storey_holds_nobody(z, waits):
    walk = Walk()
    robot = (1.0, 0.0, 0.0, 0.3, 0.3, 0.0, 0.0, z)
    x, _, _ = walk.go(2.0, robot=robot)
    assert (x < 1.0) == waits


def test_impolite_people_keep_walking():
    walk = Walk(manners=Manners(polite=False))
    assert walk.go(3.0, robot=(1.0, 0.0))[0] > 2.5


@pytest.mark.parametrize("polite", [True, False])
def test_who_is_held_too_long_turns_back(polite):
    walk = Walk(manners=Manners(polite=polite, patience=3.0))
    walk.go(2.0)
    x = walk.pose[0]
    robot = (x + 0.5, 0.0)
    walk.go(2.0, robot=robot, stuck=True)
    assert walk.walker.way == 1
    walk.go(1.5, robot=robot, stuck=True)
    assert walk.walker.way == -1
    assert walk.go(3.0, robot=robot)[0] < 0.5


def test_legs_swing_while_walking_alone():
    walk = Walk()
    assert swing(walk.walker) == 0.0
    walk.go(1.0)
    seen = []
    for _ in range(40):
        walk.go(PERIOD)
        seen.append(swing(walk.walker))
    assert max(seen) > 0.35
    assert min(seen) < -0.35
    walk.go(2.0, robot=(walk.pose[0] + 0.5, walk.pose[1]))
    assert swing(walk.walker) == 0.0
