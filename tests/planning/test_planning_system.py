import dataclasses as dc
import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from unilavira_drake.messages import ALREADY_THERE, Goal, NavigationStatus, OccupancyMap
from unilavira_drake.planning.system import FastMarchingPlanner

PERIOD = 0.1


def room(version=1, n=1, wall=None):
    """8 m x 4 m of free floor with walls; optionally a wall (x0, y0, x1, y1)."""
    log_odds = np.full((80, 160), -20, np.int8)
    log_odds[[0, -1]] = 20
    log_odds[:, [0, -1]] = 20
    if wall is not None:
        x0, y0, x1, y1 = (round(value / 0.05) for value in wall)
        log_odds[y0:y1, x0:x1] = 20
    return OccupancyMap(n=n, version=version, log_odds=log_odds)


class Bench:
    """A planner whose inputs are set by hand."""

    def __init__(self, position=(1.0, 2.0), **named):
        self.planner = FastMarchingPlanner(**named)
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        self.stand(*position)
        self.give("map", room())
        self.give("goal", Goal(0))
        self.simulator.Initialize()

    def give(self, port, value):
        self.planner.GetInputPort(port).FixValue(self.context, AbstractValue.Make(value))

    def stand(self, x, y):
        self.position = (x, y)
        self.planner.GetInputPort("pose_estimate").FixValue(
            self.context, Value[RigidTransform](RigidTransform([x, y, 0.0]))
        )

    def wait(self, ticks=1):
        # Half a tick beyond, so that each call runs exactly so many polls.
        time = (math.floor(self.context.get_time() / PERIOD + 1e-6) + ticks + 0.5) * PERIOD
        self.simulator.AdvanceTo(time)
        return self.status

    def drive(self, speed, ticks=1):
        for _ in range(ticks):
            p_WP = self.path.p_WP
            if not len(p_WP):
                break
            ahead = p_WP[1] - self.position
            step = speed * PERIOD * ahead / np.hypot(*ahead)
            if np.hypot(*ahead) < speed * PERIOD:
                step = ahead
            self.stand(*(self.position + step))
            self.wait()
        return self.status

    @property
    def status(self):
        return self.planner.GetOutputPort("navigation_status").Eval(self.context)

    @property
    def path(self):
        return self.planner.GetOutputPort("path").Eval(self.context)


def go(n=1, x=6.0, y=2.0, heading=None):
    return Goal(n, "go", p_WG=(x, y, 0.5), heading=heading)


def test_the_ring_starts_with_arrived_zero():
    bench = Bench()
    assert bench.status == NavigationStatus(0, "arrived")
    assert bench.wait(3) == NavigationStatus(0, "arrived")


@pytest.mark.parametrize(
    ("goal", "status"),
    [
        (Goal(1, "stay"), NavigationStatus(1, "arrived")),
        (Goal(1, "none", reason="no target: x"), NavigationStatus(1, "failed", "no target: x")),
    ],
)
def test_goals_without_a_way_end_at_once(goal, status):
    bench = Bench()
    bench.give("goal", goal)
    assert bench.wait() == status
    assert (bench.path.n, len(bench.path.p_WP)) == (1, 0)


def test_a_goal_waits_for_the_map_of_its_panorama():
    bench = Bench()
    bench.give("goal", go(n=2))
    assert bench.wait(3).n == 0
    bench.give("map", room(n=2))
    assert bench.wait() == NavigationStatus(2, "moving")
    assert bench.path.n == 2
    np.testing.assert_array_equal(bench.path.p_WP[0], (1.0, 2.0))
    assert math.dist(bench.path.p_WP[-1], (6.0, 2.0)) < 0.04


def test_arrival_hands_on_the_heading_and_empties_the_path():
    bench = Bench()
    bench.give("goal", go(heading=1.25))
    bench.wait()
    status = bench.drive(1.0, 60)
    assert dc.replace(status, remaining=None) == NavigationStatus(1, "arrived", "", 1.25)
    assert status.remaining is not None
    assert status.remaining < 0.15
    assert math.dist(bench.position, (6.0, 2.0)) <= 0.15 + 0.04
    assert (bench.path.n, len(bench.path.p_WP)) == (1, 0)
    bench.wait(5)
    assert bench.status.n == 1  # the same goal is not taken up again


def test_a_robot_that_need_not_move_says_so():
    bench = Bench()
    x, y = bench.position
    bench.give("goal", go(x=x + 0.1, y=y))
    status = bench.wait()
    assert (status.state, status.reason) == ("arrived", ALREADY_THERE)
    assert status.remaining == pytest.approx(0.1)


def test_a_goal_in_a_wall_without_space_fails():
    bench = Bench()
    bench.give("goal", go(x=20.0))
    assert bench.wait().state == "failed"
    assert "1.5 m" in bench.status.reason


def test_a_goal_behind_a_closed_wall_is_unreachable():
    bench = Bench()
    bench.give("map", room(wall=(4.0, 0.0, 4.1, 4.0)))
    bench.give("goal", go())
    assert bench.wait() == NavigationStatus(1, "failed", "unreachable")


def test_standing_still_is_stuck_even_while_the_map_changes():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait()
    for k in range(29):
        bench.give("map", room(version=2 + k))
        assert bench.wait().state == "moving"
        assert not bench.path.backwards
    assert bench.path.version >= 2
    assert bench.wait(3).state == "moving"
    assert bench.path.backwards


def test_a_stuck_robot_backs_off_plans_anew_and_only_then_fails():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait(32)
    back = bench.path
    assert back.backwards
    assert back.p_WP == pytest.approx(np.array([(1.0, 2.0), (0.6, 2.0)]))
    bench.stand(0.65, 2.0)
    assert bench.wait(2).state == "moving"
    assert not bench.path.backwards
    assert bench.path.version > back.version
    assert bench.path.p_WP[0] == pytest.approx((0.65, 2.0), abs=0.05)
    assert bench.wait(28).state == "moving"
    assert bench.wait(4) == NavigationStatus(1, "failed", "stuck", remaining=5.35)
    assert not len(bench.path.p_WP)


def test_a_robot_that_cannot_go_back_either_plans_anew_after_a_while():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait(32)
    assert bench.path.backwards
    assert bench.wait(52).state == "moving"
    assert not bench.path.backwards
    assert bench.wait(32).reason == "stuck"
    # The next goal has its own recovery.
    bench.give("map", room(n=2))
    bench.give("goal", go(n=2))
    bench.wait(33)
    assert bench.path.backwards


def test_wandering_without_end_uses_up_the_travel_budget():
    bench = Bench(travel_factor=0.1, stuck_time=1e9)
    bench.give("goal", go())
    bench.wait()
    travelled = 0.0
    for k in range(100):
        bench.stand(1.0 + 0.2 * (k % 2), 2.0)
        travelled += 0.2
        if bench.wait().state == "failed":
            break
    assert bench.status.reason == "travel budget"
    assert travelled == pytest.approx(0.1 * 5.0 + 3.0, abs=0.4)


def test_a_new_obstacle_on_the_way_is_driven_around_at_once():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    assert len(bench.path.p_WP) == 2
    bench.give("map", room(version=2, wall=(3.5, 1.5, 3.6, 2.5)))
    bench.wait()
    assert bench.path.version == 1
    assert len(bench.path.p_WP) > 2
    assert bench.status.state == "moving"


def test_a_map_that_changes_nothing_is_planned_on_after_a_second():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    first = bench.path
    bench.give("map", room(version=2))
    bench.wait(5)
    assert bench.path is first
    bench.wait(8)
    assert bench.path.version == 1
    second = bench.path
    bench.wait(30)
    assert bench.path is second  # the same map again is no news


def test_a_goal_that_gets_occupied_is_snapped_again():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    bench.give("map", room(version=2, wall=(5.8, 1.8, 6.2, 2.2)))
    assert bench.wait().state == "moving"
    goal = bench.path.p_WP[-1]
    assert 0.36 <= math.dist(goal, (6.0, 2.0)) <= 1.5
    assert goal[0] < 6.0


def test_a_way_that_gets_closed_fails():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    bench.give("map", room(version=2, wall=(4.0, 0.0, 4.1, 4.0)))
    assert bench.wait() == NavigationStatus(1, "failed", "unreachable")


def test_each_of_two_blockages_in_the_final_stretch_is_waited_for():
    bench = Bench(patience=2.0, stuck_time=60.0, radius=0.2, turning_radius=0.25, snap_distance=0.3)
    bench.give("goal", go())
    bench.wait()
    while math.dist(bench.position, (6.0, 2.0)) > 0.7:
        bench.drive(0.5)
    person = {"wall": (5.6, 0.0, 5.65, 4.0)}
    for version in (2, 4):
        bench.give("map", room(version=version, **person))
        assert bench.wait(15).state == "moving"
        bench.give("map", room(version=version + 1))
        assert bench.wait(15).state == "moving"
    # Who stays longer than the patience is not waited for.
    bench.give("map", room(version=6, **person))
    bench.wait(21)
    bench.give("map", room(version=7, **person))
    assert bench.wait().state != "moving"


def test_an_idle_poll_changes_nothing():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    state = bench.planner.state(bench.context)
    bench.wait(10)
    assert bench.planner.state(bench.context) is state


def test_a_cloned_context_has_the_same_future():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    bench.drive(0.8, 5)
    branch = Simulator(bench.planner, bench.context.Clone())
    branch.AdvanceTo(20.0)
    bench.simulator.AdvanceTo(20.0)
    other = bench.planner.GetOutputPort("navigation_status").Eval(branch.get_context())
    assert bench.status == other
    assert (other.state, other.reason) == ("failed", "stuck")
    assert other.remaining == pytest.approx(4.6, abs=0.1)


def test_the_next_goal_starts_afresh():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    bench.drive(1.0, 60)
    bench.give("map", room(n=2))
    bench.give("goal", dc.replace(go(n=2), p_WG=(1.0, 2.0, 0.0)))
    bench.wait()
    assert bench.status == NavigationStatus(2, "moving")
    assert (bench.path.n, bench.path.version) == (2, 0)
