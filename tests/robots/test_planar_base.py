import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from unilavira_drake.errors import PortTypeError
from unilavira_drake.robots.planar_base import PlanarBase, planar_pose
from unilavira_drake.robots.planar_pose import PlanarPose

SPEED = st.floats(-2, 2)
ANGLE = st.floats(-7, 7)


def evaluate(system, port, command=(0.0, 0.0, 0.0), state=(0.0,) * 6):
    context = system.CreateDefaultContext()
    if system.HasInputPort("base_command"):
        system.GetInputPort("base_command").FixValue(context, np.array(command))
    system.GetInputPort("joint_state").FixValue(context, np.array(state))
    return system.GetOutputPort(port).Eval(context)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(vx=SPEED, vy=SPEED, wz=SPEED, yaw=ANGLE)
def test_twist_of_the_desired_motion_is_the_command(vx, vy, wz, yaw):
    for holonomic in (True, False):
        base, state = PlanarBase(holonomic=holonomic), (1.0, 2.0, yaw, 0.0, 0.0, 0.0)
        velocity = evaluate(base, "desired_joint_state", (vx, vy, wz), state)[3:]
        twist = evaluate(PlanarPose(), "twist", state=(1.0, 2.0, yaw, *velocity))
        expected = [0, 0, wz, vx, vy if holonomic else 0.0, 0]
        assert twist == pytest.approx(expected, abs=1e-12)


def test_a_differential_base_ignores_sideways_commands():
    state = (0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0)
    desired = evaluate(PlanarBase(), "desired_joint_state", (0.4, 0.3, 0.2), state)
    assert desired == pytest.approx([0, 0, 0, 0, 0.4, 0.2])
    desired = evaluate(PlanarBase(holonomic=True), "desired_joint_state", (0.4, 0.3, 0.2), state)
    assert desired == pytest.approx([0, 0, 0, -0.3, 0.4, 0.2])


@settings(derandomize=True, deadline=None, max_examples=20)
@given(x=SPEED, y=SPEED, yaw=ANGLE)
def test_pose_is_drakes(x, y, yaw):
    pose = evaluate(PlanarPose(), "X_WB", state=(x, y, yaw, 0.0, 0.0, 0.0))
    assert isinstance(pose, RigidTransform)
    expected = RigidTransform(RollPitchYaw(0, 0, yaw), [x, y, 0])
    assert pose.IsNearlyEqualTo(expected, 1e-12)
    assert planar_pose(x, y, yaw).IsNearlyEqualTo(expected, 1e-12)


def test_the_base_is_found_among_other_joints():
    joints = ["trunk_z", "base_yaw", "base_x", "base_y"]
    pose = PlanarPose(joints=joints)
    state = (9.0, 0.5, 1.0, 2.0, 7.0, 0.3, *(0.4 * math.cos(0.5), 0.4 * math.sin(0.5)))
    expected = RigidTransform(RollPitchYaw(0, 0, 0.5), [1.0, 2.0, 0])
    assert evaluate(pose, "X_WB", state=state).IsNearlyEqualTo(expected, 1e-12)
    assert evaluate(pose, "twist", state=state) == pytest.approx([0, 0, 0.3, 0.4, 0, 0])


def test_an_unconnected_command_is_named():
    system = PlanarBase()
    context = system.CreateDefaultContext()
    system.GetInputPort("joint_state").FixValue(context, np.zeros(6))
    with pytest.raises(PortTypeError, match="base_command"):
        system.GetOutputPort("desired_joint_state").Eval(context)
