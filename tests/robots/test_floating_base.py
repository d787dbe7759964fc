import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from unilavira_drake.robots.floating_base import FloatingBase


def test_pose_and_twist_are_those_of_the_state_though_its_quaternion_is_not_quite_of_length_1():
    base = FloatingBase()
    context = base.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for _ in range(50):
        state = rng.normal(size=13)
        state[:4] *= (1.0 + 1e-6 * rng.normal()) / np.linalg.norm(state[:4])
        base.GetInputPort("body_state").FixValue(context, state)
        unit = state[:4] / np.linalg.norm(state[:4])
        X_WB = RigidTransform(RotationMatrix(Quaternion(unit)), state[4:7])
        pose = base.GetOutputPort("pose").Eval(context)
        np.testing.assert_allclose(pose.GetAsMatrix34(), X_WB.GetAsMatrix34(), atol=1e-15)
        R_BW = X_WB.rotation().matrix().T
        twist = base.GetOutputPort("twist").Eval(context)
        np.testing.assert_allclose(twist[:3], R_BW @ state[7:10], atol=1e-14)
        np.testing.assert_allclose(twist[3:], R_BW @ state[10:], atol=1e-14)
