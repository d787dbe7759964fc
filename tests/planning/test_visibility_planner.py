import dataclasses as dc
import math

import flight_worlds as worlds
import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from unilavira_drake.messages import Goal, NavigationStatus, Path, VoxelMap
from unilavira_drake.planning.visibility_path import remaining_way
from unilavira_drake.planning.visibility_system import VisibilityPlanner

GROUND = (-40.0, -40.0, -1.0, 40.0, 40.0, 0.0)
WALL = (10.0, -8.0, 0.0, 11.0, 8.0, 12.0)
PERIOD = 0.1


class Bench:
    """The planner alone; its inputs are set by hand."""

    def __init__(self, boxes=(GROUND,), **named):
        self.planner = VisibilityPlanner(**named)
        self.simulator = Simulator(self.planner)
        self.context = self.simulator.get_mutable_context()
        self.stand(0.0, 0.0, 4.0)
        self.give("voxel_map", worlds.voxels_of(boxes))
        self.give("goal", Goal())

    def give(self, name, value):
        self.planner.GetInputPort(name).FixValue(self.context, AbstractValue.Make(value))

    def stand(self, *p_WB):
        self.position = np.array(p_WB)
        port = self.planner.GetInputPort("pose_estimate")
        port.FixValue(self.context, Value[RigidTransform](RigidTransform(self.position)))

    def wait(self, polls=1):
        self.simulator.AdvanceTo(self.context.get_time() + polls * PERIOD)
        return self.status

    def fly(self, speed, polls):
        """Follows the path exactly."""
        flown = [self.position]
        for _ in range(polls):
            path = self.path.p_WP
            if not len(path):
                break
            left = speed * PERIOD
            _, ahead = remaining_way(path, tuple(self.position))
            for point in path[ahead:]:
                step = point - self.position
                length = np.linalg.norm(step)
                if length > left:
                    self.position = self.position + step * left / length
                    break
                self.position, left = point, left - length
            self.stand(*self.position)
            flown.append(self.position)
            self.wait()
        return np.array(flown)

    @property
    def status(self):
        return self.planner.GetOutputPort("navigation_status").Eval(self.context)

    @property
    def path(self):
        return self.planner.GetOutputPort("path").Eval(self.context)


def go(n=1, p_WG=(20.0, 0.0, 5.0), heading=None):
    return Goal(n, "go", p_WG=p_WG, heading=heading)


def test_the_ring_starts_with_arrived_zero():
    bench = Bench()
    assert bench.wait(3) == NavigationStatus(0, "arrived")
    assert bench.path.p_WP.shape == (0, 3)


@pytest.mark.parametrize(
    ("goal", "status"),
    [
        (Goal(1, "stay", heading=0.5), NavigationStatus(1, "arrived", "", 0.5)),
        (Goal(1, "none", reason="no target: x"), NavigationStatus(1, "failed", "no target: x")),
        (
            Goal(1, "go", p_WG=(1.0, 2.0)),
            NavigationStatus(1, "failed", "the goal is not a point in space"),
        ),
    ],
)
def test_goals_without_a_way_end_at_once(goal, status):
    bench = Bench()
    bench.give("goal", goal)
    assert bench.wait() == status
    assert (bench.path.n, bench.path.p_WP.shape) == (1, (0, 3))


def test_a_goal_waits_for_the_map_of_its_panorama():
    bench = Bench()
    bench.give("goal", go(n=2))
    assert bench.wait(3).n == 0
    bench.give("voxel_map", worlds.voxels_of([GROUND, WALL], n=2))
    assert bench.wait() == NavigationStatus(2, "moving")
    path = bench.path
    assert path.n == 2
    np.testing.assert_array_equal(path.p_WP[[0, -1]], [(0, 0, 4), (20, 0, 5)])
    assert worlds.distance_to([GROUND, WALL], worlds.along(path.p_WP)).min() >= 0.5


def test_flying_there_arrives_with_the_heading_flown_or_asked():
    for heading in (None, 1.25):
        bench = Bench([GROUND, WALL])
        bench.give("goal", go(heading=heading))
        bench.wait()
        last = bench.path.p_WP[-1] - bench.path.p_WP[-2]
        bench.fly(4.0, 200)
        status = bench.status
        assert (status.n, status.state, status.reason) == (1, "arrived", "")
        flown = math.atan2(last[1], last[0])
        assert status.heading == pytest.approx(flown if heading is None else heading)
        assert np.linalg.norm(bench.position - (20, 0, 5)) <= 0.5
        assert bench.path.p_WP.shape == (0, 3)
        bench.wait(5)
        assert bench.status.n == 1


def test_a_straight_rise_arrives_without_a_heading():
    bench = Bench(climb_angle=0.5 * math.pi)
    bench.give("goal", go(p_WG=(0.0, 0.0, 9.0)))
    bench.wait()
    bench.fly(2.0, 50)
    assert bench.status == NavigationStatus(1, "arrived", "", None)


def test_a_wall_that_comes_into_view_is_flown_around():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    assert len(bench.path.p_WP) == 2
    bench.fly(4.0, 5)
    bench.give("voxel_map", worlds.voxels_of([GROUND, WALL], version=2))
    bench.wait()
    assert (bench.path.n, bench.path.version) == (1, 1)
    flown = bench.fly(4.0, 200)
    assert bench.status.state == "arrived"
    assert worlds.distance_to([GROUND, WALL], worlds.along(flown, 0.05)).min() >= 0.5 - 0.25


def test_a_map_that_blocks_nothing_is_taken_up_when_the_plan_is_old():
    bench = Bench()
    bench.give("goal", go())
    bench.wait()
    bench.give("voxel_map", worlds.voxels_of([GROUND], version=2))
    bench.wait(5)
    assert bench.path.version == 0
    bench.wait(8)
    assert bench.path.version == 1


def test_a_goal_that_gets_closed_in_becomes_unreachable():
    bench = Bench(stuck_time=1e9)
    bench.give("goal", go(p_WG=(20.0, 0.0, 4.0)))
    bench.wait()
    block = (12.0, -8.0, 0.0, 28.0, 8.0, 12.0)
    bench.give("voxel_map", worlds.voxels_of([GROUND, block], version=2))
    bench.wait()
    assert bench.status == NavigationStatus(1, "failed", "no free space within 3 m")


def test_hovering_is_stuck_even_while_the_map_changes():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait()
    for k in range(29):
        bench.give("voxel_map", worlds.voxels_of([GROUND], version=2 + k))
        assert bench.wait().state == "moving"
        assert not bench.path.backwards
    assert bench.path.version >= 2
    # It came from nowhere: there is no way back, only another plan.
    assert bench.wait(3).state == "moving"
    assert bench.wait(32) == NavigationStatus(1, "failed", "stuck")


def test_a_stuck_aircraft_backs_off_as_it_came_plans_anew_and_only_then_fails():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait()
    way = worlds.along(bench.path.p_WP)
    bench.fly(2.0, 20)
    stuck = tuple(bench.position)
    for k in range(33):
        # It wavers by what would be many steps, and does not forget the way it came.
        bench.stand(stuck[0], 0.2 * (k % 2), stuck[2])
        assert bench.wait().state == "moving"
    back = bench.path
    assert back.backwards
    np.testing.assert_allclose(back.p_WP[0], bench.position)
    came = back.p_WP[1:]
    assert np.linalg.norm(came[:, None] - way[None], axis=2).min(axis=1).max() < 0.05
    assert 1.5 <= stuck[0] - came[-1, 0] <= 3.5
    bench.stand(*came[-1])
    assert bench.wait().state == "moving"
    assert not bench.path.backwards
    assert bench.path.version > back.version
    np.testing.assert_allclose(bench.path.p_WP[[0, -1]], [came[-1], (20.0, 0.0, 5.0)])
    assert bench.wait(29).state == "moving"
    assert bench.wait(3) == NavigationStatus(1, "failed", "stuck")
    assert not len(bench.path.p_WP)


def test_an_aircraft_that_cannot_go_back_either_plans_anew_after_a_while():
    bench = Bench(stuck_time=3.0)
    bench.stand(-9.0, 0.0, 4.0)
    bench.give("goal", go(p_WG=(0.0, 0.0, 4.0)))
    bench.wait()
    bench.fly(4.0, 60)
    assert bench.status.state == "arrived"
    bench.give("goal", go(n=2))
    bench.give("voxel_map", worlds.voxels_of([GROUND], n=2))
    bench.wait(34)
    # The way to the goal before counts, too.
    assert bench.path.backwards
    assert bench.path.p_WP[-1, 0] < -1.0
    assert bench.wait(74).state == "moving"
    assert bench.path.backwards
    bench.wait(6)
    assert not bench.path.backwards
    assert bench.wait(34).reason == "stuck"
    # The next goal has its own recovery.
    bench.give("voxel_map", worlds.voxels_of([GROUND], n=3))
    bench.give("goal", go(n=3))
    assert bench.wait(34).state == "moving"
    assert bench.path.backwards


def test_a_pose_that_is_lost_on_the_way_back_fails_at_last():
    bench = Bench(stuck_time=3.0)
    bench.give("goal", go())
    bench.wait()
    bench.fly(2.0, 20)
    bench.wait(33)
    assert bench.path.backwards
    bench.stand(math.nan, 0.0, 4.0)
    assert bench.wait(60).state == "moving"
    assert bench.wait(25) == NavigationStatus(1, "failed", "the pose is lost")


def test_wandering_without_end_uses_up_the_travel_budget():
    bench = Bench(travel_factor=0.1, stuck_time=1e9)
    bench.give("goal", go())
    bench.wait()
    travelled = 0.0
    for k in range(200):
        bench.stand(0.3 * (k % 2), 0.0, 4.0)
        travelled += 0.3
        if bench.wait().state == "failed":
            break
    assert bench.status.reason == "travel budget"
    assert travelled == pytest.approx(0.1 * 20.0 + 10.0, abs=0.7)


def test_a_pose_that_is_lost_fails_at_last():
    bench = Bench(stuck_time=1.0)
    bench.give("goal", go())
    bench.wait()
    bench.stand(math.nan, 0.0, 4.0)
    assert bench.wait(5).state == "moving"
    assert bench.wait(8) == NavigationStatus(1, "failed", "the pose is lost")


def test_a_size_of_too_many_voxels_fails_with_the_reason():
    bench = Bench(radius=0.5)
    bench.give("voxel_map", VoxelMap(n=1, version=1, resolution=0.01))
    bench.give("goal", go())
    assert bench.wait().reason == "radius and margins must be less than 32 voxels"


def test_a_cloned_context_has_the_same_future():
    bench = Bench([GROUND, WALL])
    bench.give("goal", go())
    bench.wait()
    branch = Simulator(bench.planner, bench.context.Clone())
    branch.AdvanceTo(15.0)
    bench.simulator.AdvanceTo(15.0)
    other = bench.planner.GetOutputPort("navigation_status").Eval(branch.get_context())
    assert other == bench.status == NavigationStatus(1, "failed", "stuck")


def test_goals_poses_and_maps_of_garbage_never_raise():
    planner = VisibilityPlanner(period=PERIOD)
    context = planner.CreateDefaultContext()
    rng = np.random.default_rng(2)
    numbers = np.array([0.0, 4.0, 30.0, -7.5, math.nan, math.inf, -math.inf, 1e9, 1e300])
    often = [0.3, 0.3, 0.16, 0.16, 0.02, 0.02, 0.02, 0.01, 0.01]
    maps = [VoxelMap(n=10**6, version=1, resolution=r) for r in (0.5, 0.02, 1e-6, 1e6)]
    noise = (rng.random((32, 32, 32)) < 0.02).astype(np.int8)
    tiles = dict.fromkeys(np.ndindex(2, 2, 2), noise)
    maps += [VoxelMap(n=10**6, version=k, resolution=0.5, tiles=tiles) for k in (2, 3)]
    states = set()
    for n in range(1, 10_001):
        p_WG = tuple(float(x) for x in rng.choice(numbers, rng.choice([2, 3, 3, 3, 3]), p=often))
        goal = Goal(n, str(rng.choice(["go", "go", "go", "none", "?"])), p_WG=p_WG)
        voxels = maps[rng.choice(6, p=[0.4, 0.01, 0.01, 0.02, 0.28, 0.28])]
        X_WB = RigidTransform(rng.choice(numbers, 3, p=often))
        for name, value in (
            ("goal", AbstractValue.Make(goal)),
            ("voxel_map", AbstractValue.Make(voxels)),
            ("pose_estimate", Value[RigidTransform](X_WB)),
        ):
            planner.GetInputPort(name).FixValue(context, value)
        state = planner.state(context)
        for _ in range(2):
            state = planner.step(context, state)
            context.SetTime(context.get_time() + 3.1)
        status = state.status
        states.add(status.state)
        assert isinstance(state.path, Path)
        if status.state == "failed" and goal.kind == "go":
            assert status.reason
        if status.state == "moving":
            assert np.isfinite(state.path.p_WP).all()
            state = dc.replace(state, status=NavigationStatus(n, "failed", "next"))
        context.SetAbstractState(0, state)
    assert states == {"moving", "arrived", "failed"}
