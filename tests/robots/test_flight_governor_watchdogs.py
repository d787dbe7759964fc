"""The flight governor's watchdogs: a pose that froze, a twist that is no number, late replies."""

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from test_flight_governor import LIMITS, Bench

from unilavira_drake import load_scenario
from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.messages import Awaited

AHEAD = [9.0, 0, 1, 0, 1.0, 0, 0]


def flying():
    bench = Bench()
    bench.chase((9.0, 0, 1.0), ticks=40)
    return bench


def speed(bench, v):
    bench.fix("twist", np.array([0.0, 0.0, 0.0, v, 0.0, 0.0]))


def ticks(bench, seconds, desired=AHEAD):
    return np.array([bench.tick(desired) for _ in range(round(seconds / LIMITS.period))])


@pytest.mark.parametrize("desired", [AHEAD, None])
def test_a_pose_that_froze_on_the_way_ends_at_that_pose(desired):
    bench = flying()
    speed(bench, 1.0)
    bench.follows = False
    stays = bench.setpoint.tolist() if desired is None else desired
    rows = ticks(bench, 5.0, stays)
    assert not rows[-1, 4:].any()
    np.testing.assert_allclose(rows[-1, :3], bench.pose, atol=1e-6)
    assert np.abs(np.diff(rows[:, 4])).max() <= LIMITS.max_braking * LIMITS.period + 1e-9
    bench.follows = True
    speed(bench, 0.0)
    assert bench.chase((9.0, 0, 1.0), ticks=300)[-1, 0] == pytest.approx(9.0, abs=0.05)


@pytest.mark.parametrize("index", range(6))
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_twist_that_is_no_number_ends_in_hovering(index, bad):
    bench = flying()
    twist = np.zeros(6)
    twist[index] = bad
    bench.fix("twist", twist)
    rows = ticks(bench, 3.0)
    assert np.isfinite(rows).all()
    assert not rows[-1, 4:].any()


def test_a_pose_that_stays_the_same_is_no_fault_of_an_aircraft_that_rests():
    bench = flying()
    speed(bench, 0.04)
    bench.follows = False
    assert ticks(bench, 5.0)[-1, 0] > bench.pose[0] + 1.0


@pytest.mark.parametrize("role", ["language", "vision"])
def test_a_reply_that_is_overdue_ends_in_hovering(role):
    bench = flying()
    bench.fix(f"{role}_awaited", AbstractValue.Make(Awaited(since=bench.time - 149.0)))
    assert ticks(bench, 0.9)[-1, 4] == pytest.approx(1.0)
    assert not ticks(bench, 1.0)[-1, 4:].any()


def test_an_aircrafts_governor_is_told_of_awaited_replies():
    diagram = make_navigation_diagram(load_scenario("apartment", "robot: !Quadrotor {}"))
    navigation = diagram.GetSubsystemByName("navigation")
    for role in ("language", "vision"):
        port = navigation.GetInputPort(f"{role}_awaited")
        assert diagram.connection_map().get((navigation, port.get_index())) is not None
