"""Attitude errors against Drake's rotations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RollPitchYaw, RotationMatrix

from unilavira_drake.robots.flight_attitude import (
    attitude_error,
    attitude_of,
    product,
    quaternion_of,
)

ANGLE = st.floats(-3.1, 3.1)
TILT = st.floats(-1.2, 1.2)


def rotation(roll, pitch, yaw):
    return RollPitchYaw(roll, pitch, yaw).ToRotationMatrix()


def quaternion(R):
    return quaternion_of(np.ascontiguousarray(R.matrix()))


@settings(derandomize=True, deadline=None, max_examples=100)
@given(ANGLE, ANGLE, ANGLE)
def test_a_quaternion_is_that_of_its_matrix(roll, pitch, yaw):
    R = rotation(roll, pitch, yaw)
    ours, drakes = quaternion(R), R.ToQuaternion().wxyz()
    assert min(abs(ours - drakes).max(), abs(ours + drakes).max()) < 1e-9


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.tuples(TILT, TILT, ANGLE), st.tuples(TILT, TILT, ANGLE))
def test_the_whole_error_is_the_rotation_vector_between_two_attitudes(now, then):
    R, desired = rotation(*now), rotation(*then)
    between = (R.inverse() @ desired).ToAngleAxis()
    error = attitude_error(quaternion(R), quaternion(desired), 1.0)
    if between.angle() < 3.0:
        np.testing.assert_allclose(error, between.angle() * between.axis(), atol=1e-6)


@pytest.mark.parametrize("weight", [0.0, 0.4, 1.0])
def test_a_heading_error_is_corrected_by_its_weight(weight):
    error = attitude_error(quaternion(rotation(0, 0, 0.3)), quaternion(rotation(0, 0, 0.8)), weight)
    np.testing.assert_allclose(error, [0.0, 0.0, 0.5 * weight], atol=1e-9)


def test_a_tilt_is_corrected_in_full_whatever_the_heading():
    """Without weight on the heading the z axes agree after the turn."""
    R, desired = rotation(0.3, -0.2, 0.5), rotation(-0.4, 0.1, 2.8)
    turn = attitude_error(quaternion(R), quaternion(desired), 0.0)
    angle = float(np.linalg.norm(turn))
    step = np.array([math.cos(angle / 2), *(math.sin(angle / 2) / angle * turn)])
    reached = product(quaternion(R), step)
    expected = desired.matrix()[:, 2]
    got = RotationMatrix(Quaternion(reached / np.linalg.norm(reached))).matrix()[:, 2]
    np.testing.assert_allclose(got, expected, atol=1e-9)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(TILT, TILT, ANGLE)
def test_an_attitude_has_the_thrust_direction_and_the_heading_asked_for(roll, pitch, yaw):
    up = rotation(roll, pitch, 0.7).matrix()[:, 2]
    q = attitude_of(np.ascontiguousarray(up), yaw)
    R = RotationMatrix(Quaternion(q / np.linalg.norm(q))).matrix()
    np.testing.assert_allclose(R[:, 2], up, atol=1e-9)
    # Nose in the vertical plane of the heading, and forwards.
    along = R[0, 0] * math.cos(yaw) + R[1, 0] * math.sin(yaw)
    across = R[1, 0] * math.cos(yaw) - R[0, 0] * math.sin(yaw)
    assert abs(across) < 1e-9
    assert along > 0.0


def test_upside_down_is_no_division_by_zero():
    error = attitude_error(quaternion(rotation(math.pi, 0, 0)), np.array([1.0, 0, 0, 0]), 0.4)
    assert np.isfinite(error).all()
    assert np.linalg.norm(error) > 3.0
