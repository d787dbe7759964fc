"""Rotor allocation against the matrix that it inverts, and what gives way."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.robots.flight_limits import Airframe
from unilavira_drake.robots.rotor_mixer import ROTOR_MOMENT, ROTOR_X, ROTOR_Y, mix

AIRFRAME = Airframe()
X, Y = (AIRFRAME.rotor_offset * np.array(signs) for signs in (ROTOR_X, ROTOR_Y))
WRENCH_OF_ROTORS = np.array([np.ones(4), Y, -X, AIRFRAME.moment_ratio * np.array(ROTOR_MOMENT)])
"""Thrust and torques by the four rotors: r x f summed by hand."""

LARGE = st.floats(-1e6, 1e6, allow_nan=False)


def mixed(thrust, torque):
    rotors = np.empty(4)
    cut = mix(float(thrust), np.array(torque, float), AIRFRAME, rotors)
    return rotors, cut


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(st.floats(2.5, 5.0), min_size=4, max_size=4))
def test_what_the_rotors_can_do_they_do_exactly(wanted):
    thrust, *torque = WRENCH_OF_ROTORS @ np.array(wanted)
    rotors, cut = mixed(thrust, torque)
    np.testing.assert_allclose(rotors, wanted, atol=1e-9)
    assert cut == (False, False)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(LARGE, st.tuples(LARGE, LARGE, LARGE))
def test_no_wish_takes_a_rotor_beyond_its_limits(thrust, torque):
    rotors, _ = mixed(thrust, torque)
    assert (rotors >= AIRFRAME.min_thrust).all()
    assert (rotors <= AIRFRAME.max_thrust).all()


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.floats(-100.0, 100.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
def test_roll_and_pitch_come_before_thrust_and_yaw(thrust, roll, pitch, yaw):
    rotors, (level_cut, _) = mixed(thrust, [roll, pitch, yaw])
    assert not level_cut
    got = WRENCH_OF_ROTORS @ rotors
    np.testing.assert_allclose(got[1:3], [roll, pitch], atol=1e-9)
    assert abs(got[3]) <= abs(yaw) + 1e-9
    assert got[3] * yaw >= -1e-12


def test_too_much_roll_keeps_its_direction():
    rotors, (level_cut, _) = mixed(15.0, [30.0, 15.0, 0.0])
    got = WRENCH_OF_ROTORS @ rotors
    assert level_cut
    assert np.isclose(got[1] / got[2], 2.0)
