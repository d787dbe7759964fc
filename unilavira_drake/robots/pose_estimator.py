"""What the robot believes of its pose: the truth with noise and drift."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.ports import pose_input, vector_input
from unilavira_drake.robots.localization_config import PoseEstimateConfig

DRIFT_TIME = 1800.0
"""Time of motion after which the drift has its configured size, seconds (paper section V-D)."""
MOTION = 0.01
"""A base that goes slower stands still, m/s and rad/s; its drift does too."""


class PoseEstimator(LeafSystem):
    """Adds noise and drift to the true pose, from a seed; all of it is in the Context.

    The drift is a random walk of x, y and yaw in the world, which runs while the base moves:
    walking wears a calibration out.  A recalibration ends it: each time ``recalibrations``, a
    count, grows, the drift is zero again.  Noise is drawn anew each period, also at rest.

    .. pydrake_system::

        name: PoseEstimator
        input_ports:
        - X_WB
        - twist
        - recalibrations (optional)
        output_ports:
        - pose_estimate

    Args:
        config: sizes of the errors.
        seed: of the errors.
    """

    def __init__(self, *, config: PoseEstimateConfig, seed: int) -> None:
        super().__init__()
        self.set_name("pose_estimator")
        self._period = config.period
        self._seed = seed
        yaw_noise = math.radians(config.yaw_noise_degrees)
        yaw_drift = math.radians(config.yaw_drift_degrees)
        self._noise = np.array([config.position_noise, config.position_noise, yaw_noise])
        share = math.sqrt(config.period / DRIFT_TIME)
        self._walk = share * np.array([config.position_drift, config.position_drift, yaw_drift])
        self._X_WB = pose_input(self, "X_WB")
        self._twist = vector_input(self, "twist", 6)
        self._recalibrations = self.DeclareVectorInputPort("recalibrations", 1)
        # Drift and noise of x, y and yaw; number of the draw; recalibrations seen.
        self._index = int(self.DeclareDiscreteState(8))
        self.DeclareAbstractOutputPort("pose_estimate", Value[RigidTransform], self._calc)
        self.DeclarePeriodicDiscreteUpdateEvent(config.period, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        old: Any = context.get_discrete_state(self._index).value()
        drift, number, seen = old[:3].copy(), int(old[6]), float(old[7])
        # A counter instead of a generator's state: a clone of the Context draws the same.
        draws = np.random.default_rng((self._seed, number)).standard_normal((2, 3))
        twist = self._twist(context)
        if max(math.hypot(twist[3], twist[4]), abs(twist[2])) > MOTION:
            drift += self._walk * draws[0]
        if self._recalibrations.HasValue(context):
            count: Any = self._recalibrations.Eval(context)
            if count[0] > seen:
                drift, seen = np.zeros(3), float(count[0])
        new = np.array([*drift, *(self._noise * draws[1]), number + 1.0, seen])
        discrete_state.set_value(self._index, new)  # type: ignore[arg-type]

    def _calc(self, context: Any, output: Any) -> None:
        state: Any = context.get_discrete_state(self._index).value()
        output.set_value(with_error(self._X_WB(context), state[:3] + state[3:6]))


def with_error(X_WB: RigidTransform, error: NDArray[np.float64]) -> RigidTransform:
    """Returns a pose moved by (x, y, yaw) in the world, metres and radians; heading turns alone."""
    p_WB: Any = X_WB.translation() + np.array([error[0], error[1], 0.0])
    turn = RotationMatrix.MakeZRotation(float(error[2]))
    return RigidTransform(turn.multiply(X_WB.rotation()), p_WB)
