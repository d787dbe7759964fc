"""Stairs as a way: when a climb has begun, ended or failed, against profiles in closed form."""

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from unilavira_drake.messages import Goal, OccupancyMap
from unilavira_drake.planning.stairs import CLEAR, CLIMB_SPEED, PATIENCE, Climb
from unilavira_drake.planning.system import CANNOT_CLIMB, FastMarchingPlanner

PERIOD = 0.1
UP = Goal(1, "climb", p_WG=(4.0, 2.0, 0.0), heading=0.0)
STRAIGHT = ((0.0, 0.0), (3.9, 2.8))
WITH_LANDING = ((0.0, 0.0), (2.0, 1.4), (3.4, 1.4), (5.4, 2.8))


def climbed(goal, profile, *, until, speed=CLIMB_SPEED):
    """Walks along the axis of the stairs; returns verdict, reason and s at the end."""
    climb, time, sign = Climb.of(goal), 0.0, 1.0 if goal.kind == "climb" else -1.0
    c, q = math.cos(goal.heading), math.sin(goal.heading)
    s, start = -0.8, goal.p_WG[2]

    def place():
        z = start + sign * float(np.interp(s, *zip(*profile, strict=True)))
        return (goal.p_WG[0] + c * s, goal.p_WG[1] + q * s), z

    climb = climb.set_off(*place(), time)
    while time < 120.0:
        time += PERIOD
        s = min(s + speed * PERIOD, until)
        climb = climb.at(*place(), time)
        verdict, reason = climb.verdict(6.0, time)
        if verdict != "moving":
            return verdict, reason, s
    raise AssertionError("neither arrived nor failed")


@pytest.mark.parametrize("profile", [STRAIGHT, WITH_LANDING])
@pytest.mark.parametrize(("kind", "way"), [("climb", "up"), ("descend", "down")])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_it_arrives_a_metre_behind_the_last_step(profile, kind, way, heading) -> None:
    goal = Goal(1, kind, p_WG=(4.0, 2.0, 2.8), heading=heading)
    verdict, reason, s = climbed(goal, profile, until=20.0)
    assert (verdict, reason) == ("arrived", f"one floor {way}")
    # The last 5 cm of height count as level.
    assert profile[-1][0] + CLEAR - 0.2 < s < profile[-1][0] + CLEAR + 0.1


def test_a_short_landing_is_enough_where_the_way_ends() -> None:
    verdict, _, s = climbed(UP, STRAIGHT, until=4.4)
    assert verdict == "arrived"
    assert s == 4.4
    assert PATIENCE < 6.0


@pytest.mark.parametrize(
    ("profile", "until", "reason"),
    [
        (((0.0, 0.0), (9.0, 0.0)), 20.0, "no stairs up there: the floor is +0.0 m"),
        (((0.0, 0.0), (1.0, 0.6), (9.0, 0.6)), 20.0, "no stairs up there: the floor is +0.6 m"),
        (STRAIGHT, 2.0, "stuck 1.4 m up the stairs"),
        (STRAIGHT, -0.3, "stuck at the foot of the stairs"),
    ],
)
def test_what_goes_wrong_is_told(profile, until, reason) -> None:
    verdict, told, _ = climbed(UP, profile, until=until)
    assert verdict == "failed"
    assert told.startswith(reason)


class Bench:
    """A planner in a free room of 8 m x 4 m."""

    def __init__(self, *, can_climb):
        self.planner = FastMarchingPlanner(can_climb=can_climb, radius=0.3, turning_radius=0.3)
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        log_odds = np.full((80, 160), -20, np.int8)
        # The first steps, to a map an obstacle.
        log_odds[30:50, 80:110] = 20
        self.give("map", OccupancyMap(n=1, version=1, log_odds=log_odds))
        self.give("goal", Goal(0))
        self.stand(1.0, 2.0)
        self.simulator.Initialize()

    def give(self, port, value):
        self.planner.GetInputPort(port).FixValue(self.context, AbstractValue.Make(value))

    def stand(self, x, y, z=0.0):
        self.planner.GetInputPort("pose_estimate").FixValue(
            self.context, Value[RigidTransform](RigidTransform([x, y, z]))
        )

    def wait(self):
        self.simulator.AdvanceTo(self.context.get_time() + 1.5 * PERIOD)
        return self.planner.GetOutputPort("navigation_status").Eval(self.context)

    @property
    def path(self):
        return self.planner.GetOutputPort("path").Eval(self.context)


def test_to_the_foot_then_slowly_and_straight_over_the_stairs() -> None:
    bench = Bench(can_climb=True)
    bench.give("goal", UP)
    assert bench.wait().state == "moving"
    foot = bench.path.p_WP[-1]
    assert math.isinf(bench.path.max_speed)
    assert math.dist(foot, (4.0, 2.0)) == pytest.approx(0.65, abs=0.15)
    bench.stand(*foot)
    assert bench.wait().state == "moving"
    over = bench.path
    assert over.max_speed == CLIMB_SPEED
    assert over.p_WP[-1] == pytest.approx((19.0, 2.0))
    assert over.version == 1
    for s in np.arange(-0.6, 5.2, 0.1):
        bench.stand(4.0 + s, 2.0, float(np.interp(s, *zip(*STRAIGHT, strict=True))))
        status = bench.wait()
    assert (status.state, status.reason) == ("arrived", "one floor up")
    assert status.heading == 0.0
    assert not len(bench.path.p_WP)


def test_a_robot_that_cannot_climb_says_so() -> None:
    bench = Bench(can_climb=False)
    bench.give("goal", UP)
    status = bench.wait()
    assert (status.n, status.state, status.reason) == (1, "failed", CANNOT_CLIMB)
