"""Whatever comes in, no exception leaves a System, and a goal or a status says why."""

import itertools
import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from unilavira_drake.mapping.goal_selector import GoalSelector
from unilavira_drake.messages import (
    Frame,
    Goal,
    History,
    Intrinsics,
    LanguageAction,
    OccupancyMap,
    Panorama,
    VisionAction,
)
from unilavira_drake.planning.plan import LOST, NO_PLACE
from unilavira_drake.planning.system import FastMarchingPlanner, PlannerState

PERIOD = 0.1
LENS = Intrinsics(64, 48, 40.0, 40.0, 31.5, 23.5)
STRANGE = (
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 1e18, -1e18, 1e11, -1e9, 1e5, -1e3),
    *(0.0, -0.0, 5e-324, 2.0**31, 2.0**63),
)
CELLS = np.full((60, 80), -20, np.int8)
CELLS[[0, -1]] = CELLS[:, [0, -1]] = 20
CELLS[20:30, 30:40] = 20
CELLS[45:, 60:] = 0
ROOM = OccupancyMap(n=1, version=1, log_odds=CELLS)
CLOSED = CELLS.copy()
CLOSED[:, 50] = 20
CHANGED = OccupancyMap(n=1, version=2, log_odds=CLOSED)
UNKNOWN = OccupancyMap(n=1, version=1, log_odds=np.zeros((60, 80), np.int8))


def number(rng, low, high, strange=0.3):
    return float(rng.choice(STRANGE)) if rng.random() < strange else float(rng.uniform(low, high))


def random_depth(rng):
    shape = ((48, 64), (48, 64), (0, 0), (0, 64), (48, 0), (1, 1), (1, 64), (7, 5))[rng.integers(8)]
    depth = rng.uniform(0.0, 6.0, shape).astype(np.float32)
    broken = rng.random(shape) < rng.choice((0.0, 0.5, 1.0))
    depth[broken] = rng.choice(
        np.array((np.nan, np.inf, -np.inf, 0.0, -1.0, 3.4e38, 1e-45, 65.535))
    )
    return depth


def random_pose(rng):
    """A pose at which a strange number may stand for any of its numbers."""
    X_WC = np.array([[0.0, 0, 1, 2], [-1, 0, 0, 1.5], [0, -1, 0, 0.9], [0, 0, 0, 1]])
    if rng.random() < 0.3:
        X_WC[rng.integers(3), rng.integers(4)] = rng.choice(STRANGE)
    return X_WC


class Selector:
    """A goal selector whose vision action and panorama are set by hand."""

    def __init__(self):
        self.system = GoalSelector()
        self.context = self.system.CreateDefaultContext()

    def goal(self, n, frame, **selection):
        action = LanguageAction(n=n, call="decide", tool="turn", direction="front")
        inputs = {
            "language_action": action,
            "vision_action": VisionAction(n=n, direction="front", **selection),
            "history": History(n=n),
            "panorama": Panorama(n=n, first=n, frames=(frame,)),
        }
        for name, value in inputs.items():
            self.system.GetInputPort(name).FixValue(self.context, AbstractValue.Make(value))
        return self.system.GetOutputPort("goal").Eval(self.context)


class Bench:
    """A planner that forgets its goal before each of its polls that it is asked to."""

    def __init__(self):
        self.planner = FastMarchingPlanner()
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        self.give("goal", Goal(0))
        self.give("map", ROOM)
        self.stand(1.0, 1.0)
        self.simulator.Initialize()
        self.polls = 0

    def give(self, port, value):
        self.planner.GetInputPort(port).FixValue(self.context, AbstractValue.Make(value))

    def stand(self, x, y):
        X_WB = Value[RigidTransform](RigidTransform([x, y, 0.0]))
        self.planner.GetInputPort("pose_estimate").FixValue(self.context, X_WB)

    def forget(self):
        self.context.SetAbstractState(0, PlannerState())

    def wait(self, polls=1):
        self.polls += polls
        self.simulator.AdvanceTo((self.polls + 0.5) * PERIOD)
        status = self.planner.GetOutputPort("navigation_status").Eval(self.context)
        path = self.planner.GetOutputPort("path").Eval(self.context)
        assert status.state in ("moving", "arrived", "failed")
        assert bool(status.reason) or status.state != "failed"
        assert (len(path.p_WP) > 1) == (status.state == "moving")
        assert np.isfinite(path.p_WP).all()
        return status


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # Of numbers that are none.
def test_malformed_selections_become_goals_or_reasons_and_statuses():
    rng = np.random.default_rng(0)
    selector, bench = Selector(), Bench()
    reasons, states = set(), set()
    for _ in range(4000):
        frame = Frame("front", depth=random_depth(rng), intrinsics=LENS, X_WC=random_pose(rng))
        sides = [number(rng, -20, 80, strange=0.1) for _ in range(4)]
        if rng.random() < 0.7:
            # In order, so that it is a box.
            sides[::2], sides[1::2] = sorted(sides[::2]), sorted(sides[1::2])
        boxed = rng.random() < 0.6
        selection = {"box": tuple(sides)} if boxed else {"point": tuple(sides[:2])}
        goal = selector.goal(1, frame, **selection)
        assert goal.kind in ("go", "none")
        assert bool(goal.reason) == (goal.kind == "none") == (goal.p_WG is None)
        reasons.add(goal.reason)
        bench.forget()
        bench.give("goal", goal)
        status = bench.wait()
        assert status.n == 1
        if goal.kind == "none":
            assert status.reason == goal.reason
        elif not all(map(math.isfinite, goal.p_WG[:2])):
            assert status.state == "failed"
        states.add((status.state, status.reason))
    # Each kind of outcome did occur.
    assert {"", "no target: no valid depth", "no target: beyond range"} < reasons
    assert {"no target: outside the image", "no target: empty box"} < reasons
    assert {("moving", ""), ("failed", NO_PLACE)} < states


def test_malformed_goals_and_poses_fail_with_a_reason():
    rng = np.random.default_rng(1)
    bench = Bench()
    outcomes = set()
    for case in range(6000):
        position = [number(rng, -1.0, 5.0, strange=0.1) for _ in range(2)]
        target = tuple(number(rng, -1.0, 5.0, strange=0.1) for _ in range(3))
        occupancy = (ROOM, UNKNOWN, CHANGED)[case % 3]
        bench.forget()
        bench.give("map", occupancy)
        bench.give("goal", Goal(1, "go", p_WG=target, heading=number(rng, -3.0, 3.0)))
        bench.stand(*position)
        status = bench.wait()
        assert status.n == 1
        if not all(map(math.isfinite, (*position, *target[:2]))):
            assert (status.state, status.reason) == ("failed", NO_PLACE)
        outcomes.add(status.reason)
        if status.state == "moving":
            # Under way the pose goes astray while the map changes.
            bench.stand(*(number(rng, -1.0, 5.0, strange=0.5) for _ in range(2)))
            bench.give("map", CHANGED if occupancy is ROOM else ROOM)
            outcomes.add(bench.wait().reason)
    assert {"", NO_PLACE, LOST, "unreachable", "already there", "travel budget"} <= outcomes
    assert "no free space within 1.5 m" in outcomes


def test_a_lost_pose_under_way_ends_in_a_status():
    for strange in STRANGE[:9]:
        bench = Bench()
        bench.give("goal", Goal(1, "go", p_WG=(3.5, 2.5, 0.0)))
        assert bench.wait().state == "moving"
        bench.stand(strange, 1.0)
        # Stuck, back for a while, stuck again.
        assert bench.wait(180).state == "failed"


@pytest.mark.parametrize("sizes", list(itertools.product((0, 1, 3), repeat=2)))
def test_maps_of_any_size_are_planned_on(sizes):
    bench = Bench()
    bench.give("map", OccupancyMap(n=1, version=1, log_odds=np.zeros(sizes, np.int8)))
    for x, y in ((0.0, 0.0), (-7.0, 3.0), (5.0, -9.0), (-400.0, -400.0)):
        bench.forget()
        bench.stand(x, y)
        bench.give("goal", Goal(1, "go", p_WG=(x + 1.0, y, 0.0)))
        assert bench.wait().state == "moving"
