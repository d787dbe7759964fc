"""A body that walks: it holds commands, keeps its limits, sways in motion and rests at rest."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RollPitchYaw
from pydrake.systems.analysis import Simulator

from unilavira_drake.robots.gait import LEG_PHASES, next_amplitude, swing
from unilavira_drake.robots.unitree_g1 import UnitreeG1
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario_loading import load_scenario, robot_setting
from unilavira_drake.station import make_navigation_station

JOINTS = [f"{leg}_{joint}" for leg in LEG_PHASES for joint in ("hip", "knee")]
JOINTS += ["trunk_z", "trunk_roll", "trunk_pitch", "base_x", "left_shoulder"]


@settings(derandomize=True, deadline=None, max_examples=50)
@given(phase=st.floats(0.0, 1.0), amplitude=st.floats(0.0, 1.0), rate=st.floats(0.1, 3.0))
def test_velocities_are_the_derivatives_of_positions(phase, amplitude, rate):
    gait, step = UnitreeGo1().gait, 1e-6
    before, after = (
        np.array(swing(gait, JOINTS, phase + side * step, amplitude, rate)[0])
        for side in (-1.0, 1.0)
    )
    velocities = np.array(swing(gait, JOINTS, phase, amplitude, rate)[1])
    smooth = np.abs(before) + np.abs(after) > 2e-5  # A knee that is just stretched has a kink.
    slopes = (after - before) / (2.0 * step) * rate
    assert velocities[smooth] == pytest.approx(slopes[smooth], abs=1e-3)


def test_a_quadruped_trots_and_arms_swing_against_their_legs():
    def hip(leg, phase):
        return swing(UnitreeGo1().gait, [f"{leg}_hip"], phase, 1.0, 1.0)[0][0]

    for phase in np.linspace(0.0, 1.0, 7):
        assert hip("front_left", phase) == pytest.approx(hip("rear_right", phase))
        assert hip("front_left", phase) == pytest.approx(-hip("front_right", phase))
        positions, _ = swing(UnitreeG1().gait, ["left_hip", "left_shoulder"], phase, 1.0, 1.0)
        assert positions[0] * positions[1] <= 0.0


def test_the_amplitude_follows_the_speed_and_ends_exactly_at_rest():
    amplitude = 0.0
    for _ in range(40):
        amplitude = next_amplitude(amplitude, 0.6, 0.025)
    assert amplitude == pytest.approx(0.6, abs=0.01)
    for _ in range(60):
        amplitude = next_amplitude(amplitude, 0.0, 0.025)
    assert amplitude == 0.0


class Walker:
    """A station alone, with a command set by hand."""

    def __init__(self, name):
        scenario = load_scenario("flat", f"robot: {robot_setting(name)}")
        self.robot = scenario.robot
        self.station = make_navigation_station(scenario, start=(2.9, 5.0, 0.0))
        self.simulator = Simulator(self.station)
        self.context = self.simulator.get_mutable_context()
        self.command(0.0, 0.0, 0.0)

    def command(self, *twist):
        self.station.GetInputPort("base_command").FixValue(self.context, np.array(twist))

    def read(self, port):
        return self.station.GetOutputPort(port).Eval(self.context)

    def watch(self, seconds):
        """Returns times, twists (vx, vy, wz), and poses of the front camera in the base."""
        rows = []
        for _ in range(round(seconds / 0.05)):
            self.simulator.AdvanceTo(self.context.get_time() + 0.05)
            twist, X_BC = self.read("twist"), self.read("front.X_BC")
            roll, pitch, _ = RollPitchYaw(X_BC.rotation()).vector()
            z = X_BC.translation()[2]
            rows.append((self.context.get_time(), twist[3], twist[4], twist[2], z, roll, pitch))
        return np.array(rows).T


@pytest.mark.parametrize("name", ["unitree_go1", "unitree_g1"])
def test_the_camera_shakes_while_it_walks_and_is_still_at_rest(name):
    walker = Walker(name)
    still = walker.watch(0.5)[4:]
    walker.command(walker.robot.max_speed, 0.0, 0.0)
    walker.watch(1.5)
    fast = walker.watch(1.0)[4:]
    walker.command(0.5 * walker.robot.max_speed, 0.0, 0.0)
    walker.watch(1.5)
    slow = walker.watch(1.0)[4:]
    walker.command(0.0, 0.0, 0.0)
    walker.watch(2.5)
    rest = walker.watch(0.5)[4:]
    sizes = [np.ptp(rows, axis=1) for rows in (rest, slow, fast)]
    assert (sizes[0] < 1e-4).all()
    assert (sizes[1] > 5 * sizes[0]).all()
    assert (sizes[2] > 1.3 * sizes[1]).all()
    assert sizes[2][0] > walker.robot.gait.heave
    assert sizes[2][2] < 4 * math.radians(walker.robot.gait.pitch_degrees)
    assert rest[:, -1] == pytest.approx(still[:, -1], abs=1e-3)


@pytest.mark.parametrize("name", ["unitree_go1", "unitree_g1"])
def test_it_keeps_its_speeds_and_accelerations_and_goes_sideways(name):
    walker = Walker(name)
    robot = walker.robot
    walker.command(9.0, -9.0, 9.0)
    _, vx, vy, wz, *_ = walker.watch(robot.command_period + 0.8)
    assert vx.max() == pytest.approx(robot.max_speed, abs=0.02)
    assert vy.min() == pytest.approx(-robot.max_lateral_speed, abs=0.04)
    assert wz.max() == pytest.approx(robot.max_yaw_rate, abs=0.02)
    assert np.abs(np.diff(vx)).max() / 0.05 < 1.6 * robot.max_acceleration


def test_the_humanoid_takes_a_command_once_a_second():
    walker = Walker("unitree_g1")
    walker.watch(0.2)
    walker.command(0.4, 0.0, 0.0)
    times, vx, *_ = walker.watch(1.7)
    assert (vx[times < 1.05] < 0.01).all()
    assert (vx[times > 1.6] > 0.38).all()
    walker.command(0.0, 0.0, 0.0)
    times, vx, *_ = walker.watch(1.5)
    assert (vx[times < 2.05] > 0.38).all()
    assert (vx[times > 2.6] < 0.02).all()


def test_the_quadruped_obeys_at_once():
    walker = Walker("unitree_go1")
    walker.command(0.4, 0.0, 0.0)
    times, vx, *_ = walker.watch(0.6)
    assert vx[np.searchsorted(times, 0.5)] == pytest.approx(0.4, abs=0.03)
