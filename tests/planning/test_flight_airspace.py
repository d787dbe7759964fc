"""What the flight planner adds around a path: the climb at the start, and where the air ends."""

import dataclasses
import math

import numpy as np
import pytest
from test_visibility_planner import Bench, go

from unilavira_drake.messages import ON_THE_WAY, NavigationStatus, Outcome
from unilavira_drake.planning.visibility_system import AIRSPACE_ENDS

STEEP = {"climb_angle": math.pi / 2, "descend_angle": math.pi / 2}


def test_the_way_up_comes_before_everything_else():
    bench = Bench(takeoff_altitude=5.0, **STEEP)
    bench.stand(3.0, -2.0, 0.2)
    assert bench.planner.GetOutputPort("navigation_status").Eval(bench.context).state == "moving"
    bench.wait()
    np.testing.assert_allclose(bench.path.p_WP[[0, -1], :2], [[3.0, -2.0], [3.0, -2.0]], atol=0.51)
    assert bench.path.n == 0
    flown = bench.fly(2.0, 60)
    assert bench.status == NavigationStatus(0, "arrived")
    assert flown[-1][2] == pytest.approx(5.0, abs=0.6)
    bench.give("goal", go(1))
    assert bench.wait(2).n == 1


def test_who_starts_in_the_air_is_there_at_once():
    bench = Bench(takeoff_altitude=5.0, **STEEP)
    bench.stand(0.0, 0.0, 12.0)
    assert bench.wait(2) == NavigationStatus(0, "arrived")


def test_nothing_is_flown_before_the_pose_is_known():
    bench = Bench(takeoff_altitude=5.0)
    bench.stand(math.nan, 0.0, 0.2)
    assert bench.wait(5) == NavigationStatus(0, "moving")
    assert not len(bench.path.p_WP)
    bench.stand(0.0, 0.0, 0.2)
    bench.wait()
    assert len(bench.path.p_WP)


@pytest.mark.parametrize(
    ("goal", "end"),
    [
        ((30.0, 3.0, 5.0), (12.0, 3.0, 5.0)),
        ((-5.0, -30.0, 5.0), (-5.0, -8.0, 5.0)),
        ((4.0, 4.0, 90.0), (4.0, 4.0, 9.0)),
    ],
)
def test_a_goal_beyond_the_airspace_is_flown_as_far_as_it_goes(goal, end):
    bench = Bench(geofence=(-12.0, -8.0, 12.0, 8.0), max_altitude=9.0, **STEEP)
    bench.give("goal", go(p_WG=goal))
    bench.wait()
    bench.fly(3.0, 200)
    assert bench.status.state == "arrived"
    assert bench.status.reason == AIRSPACE_ENDS
    assert np.linalg.norm(bench.position - end) < 1.2


def test_a_goal_within_it_has_no_such_reason():
    bench = Bench(geofence=(-12.0, -8.0, 12.0, 8.0), max_altitude=9.0)
    bench.give("goal", go(p_WG=(8.0, 0.0, 5.0)))
    bench.wait()
    bench.fly(3.0, 200)
    assert (bench.status.state, bench.status.reason) == ("arrived", "")


def test_an_arrival_tells_how_far_and_how_much_lower_the_mark_is():
    bench = Bench(**STEEP)
    goal = dataclasses.replace(go(p_WG=(8.0, 0.0, 5.0)), p_WT=(38.0, 0.0, 1.0), partial=True)
    bench.give("goal", goal)
    bench.wait()
    bench.fly(3.0, 200)
    status, (x, y, z) = bench.status, bench.position
    assert (status.state, status.reason) == ("arrived", ON_THE_WAY)
    assert status.remaining == pytest.approx(math.dist((x, y, z), (38.0, 0.0, 1.0)))
    assert status.height == pytest.approx(1.0 - z)
    assert Outcome(status.state, status.reason).words == "on the way"
