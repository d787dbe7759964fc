"""The autopilot on Drake's rigid body: steps, limits, steady states, and bad numbers."""

import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from simulated_quadrotor import Flight, hovering

from unilavira_drake.robots.flight_autopilot import FlightAutopilot
from unilavira_drake.robots.flight_cascade import specific_thrust, velocity_setpoint
from unilavira_drake.robots.flight_limits import GRAVITY, Airframe, AutopilotGains
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.wind import WindModel


def test_rotors_stand_until_the_first_setpoint():
    flight = Flight()
    rows = flight.fly(1.0)
    assert abs(rows[-1, 2] - Quadrotor().standing_height) < 0.01
    assert np.linalg.norm(rows[-1, 3:6]) < 1e-3


def test_it_takes_off_and_hovers_at_rest():
    flight = hovering(1.5)
    rows = flight.fly(2.0)
    np.testing.assert_allclose(rows[:, :3], np.tile([0.0, 0.0, 1.5], (len(rows), 1)), atol=0.02)
    assert abs(rows[:, 3:6]).max() < 0.03


@pytest.mark.parametrize("step", [(1.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_step_is_reached_quickly_and_with_little_overshoot(step):
    flight = hovering()
    flight.command([*np.add([0, 0, 2.0], step), 0, 0, 0, 0])
    rows = flight.fly(5.0)
    size = np.linalg.norm(step)
    along = (rows[:, :3] - [0, 0, 2.0]) @ np.array(step) / size
    assert along.max() < 1.12 * size
    assert 0.02 * np.argmax(along > 0.9 * size) < 2.0
    assert abs(along[-1] - size) < 0.05
    off = rows[:, :3] - [0, 0, 2.0] - np.outer(along, step) / size
    assert np.linalg.norm(off, axis=1).max() < 0.08


def test_it_turns_to_a_heading_without_leaving_its_place():
    flight = hovering()
    flight.command([0, 0, 2.0, 3.0, 0, 0, 0])
    rows = flight.fly(4.0)
    assert abs(flight.yaw - 3.0) < 0.02
    assert np.linalg.norm(rows[:, :2], axis=1).max() < 0.05


def test_a_moving_setpoint_is_followed_without_lag():
    flight = hovering()
    for k in range(1, 301):
        flight.command([0.02 * k, 0, 2.0, 0, 1.0, 0, 0])
        flight.fly(0.02)
    x, _, z, vx, *_ = flight.state()
    assert abs(vx - 1.0) < 0.02
    assert abs(x - 6.0) < 0.05
    assert abs(z - 2.0) < 0.03


def test_the_tilt_stays_within_its_limit_however_far_the_setpoint():
    flight = hovering()
    flight.command([100.0, 60.0, 40.0, 0, 0, 0, 0])
    rows = flight.fly(6.0)
    assert rows[:, 6].max() < math.radians(Quadrotor().max_tilt_degrees) + 0.09
    speeds = np.hypot(rows[:, 3], rows[:, 4])
    assert speeds.max() < 1.1 * AutopilotGains().max_speed
    assert rows[:, 2].min() > 1.8


def test_no_integral_winds_up_while_the_setpoint_is_out_of_reach():
    """After long saturation the aircraft stops as it does after a short way."""
    flight = hovering()
    flight.command([0, 0, 60.0, 0, 0, 0, 0])
    flight.fly(6.0)
    height = flight.state()[2]
    flight.command([0, 0, height + 2.0, 0, 0, 0, 0])
    rows = flight.fly(6.0)
    assert rows[:, 2].max() < height + 2.9
    assert abs(rows[-1, 2] - height - 2.0) < 0.06


def test_a_steady_wind_is_leant_against():
    flight = hovering(wind=WindModel(speed=3.0, direction=0.5))
    rows = flight.fly(2.0)
    assert np.linalg.norm(rows[-1, :3] - [0, 0, 2.0]) < 0.03
    drag = (0.25 + 0.03 * 3.0) * 3.0
    assert abs(rows[-1, 6] - math.atan(drag / (1.5 * GRAVITY))) < 0.01


def test_gusts_move_it_little():
    flight = hovering(wind=WindModel(speed=1.0, gusts=1.0, seed=3))
    rows = flight.fly(20.0)
    off = np.linalg.norm(rows[:, :3] - [0, 0, 2.0], axis=1)
    assert np.percentile(off, 95) < 0.2


def test_a_setpoint_that_is_none_leaves_it_hovering():
    flight = hovering()
    for bad in (np.nan, np.inf):
        flight.command([0, 0, bad, 0, 0, 0, 0])
        rows = flight.fly(2.0)
        np.testing.assert_allclose(rows[:, :3], np.tile([0, 0, 2.0], (len(rows), 1)), atol=0.03)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("port", ["pose_estimate", "twist"])
def test_a_lost_state_never_reaches_the_rotors(port, bad):
    airframe = Airframe()
    autopilot = FlightAutopilot(airframe=airframe, gains=AutopilotGains(), period=0.01)
    context = autopilot.CreateDefaultContext()
    autopilot.GetInputPort("base_command").FixValue(context, np.array([0, 0, 1.0, 0, 0, 0, 0]))
    pose, twist = RigidTransform(), np.zeros(6)
    if port == "twist":
        twist[4] = bad
    else:
        pose = RigidTransform(np.array([0.0, bad, 0.0]))
    autopilot.GetInputPort("pose_estimate").FixValue(context, Value[RigidTransform](pose))
    autopilot.GetInputPort("twist").FixValue(context, twist)
    discrete = autopilot.EvalUniquePeriodicDiscreteUpdate(context)
    rotors = discrete.value(0)
    np.testing.assert_allclose(rotors, 0.25 * airframe.mass * GRAVITY)
    assert np.isfinite(discrete.value(1)).all()


def test_vertical_thrust_comes_first():
    gains = AutopilotGains()
    f = specific_thrust(np.array([50.0, 0.0, 50.0]), Airframe(), gains)
    most = 0.8 * 4 * 7.5 / 1.5
    assert f[2] == pytest.approx(most * math.cos(gains.max_tilt))
    assert np.linalg.norm(f) <= most + 1e-9
    assert math.atan2(f[0], f[2]) <= gains.max_tilt + 1e-9


def test_a_far_setpoint_asks_for_no_more_than_the_greatest_speed():
    gains = AutopilotGains()
    setpoint = np.array([300.0, 400.0, -90.0, 0.0, 0.0, 0.0, 0.0])
    v = velocity_setpoint(np.zeros(3), setpoint, gains)
    np.testing.assert_allclose(v, [0.6 * gains.max_speed, 0.8 * gains.max_speed, -3.0])
