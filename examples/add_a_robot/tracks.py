"""File 3 of 4, the adapter: from the twist that all ground robots get to what the tracks take.

Only a platform with an interface of its own needs one; without it the base follows the twist.
"""

import math

from pydrake.systems.framework import LeafSystem

STEP = 0.02
"""The motor drivers take speeds in steps of 2 cm/s."""


class Tracks(LeafSystem):
    """Turns [vx, vy, wz] into the speeds of two tracks, as coarse as the drivers take them.

    The ports are those of every locomotion: ``base_command`` and ``joint_state`` in,
    ``desired_joint_state`` out, all of x, y, yaw and their rates.
    """

    def __init__(self, *, gauge: float, top_speed: float) -> None:
        super().__init__()
        self._gauge, self._top = gauge, top_speed
        self._command = self.DeclareVectorInputPort("base_command", 3)
        self._joints = self.DeclareVectorInputPort("joint_state", 6)
        self.DeclareVectorOutputPort("desired_joint_state", 6, self._calc)

    def _calc(self, context, output):
        speed, _, rate = self._command.Eval(context)
        half = 0.5 * self._gauge * rate
        left, right = (self._driven(speed + side * half) for side in (-1.0, 1.0))
        forward, turn = 0.5 * (left + right), (right - left) / self._gauge
        yaw = self._joints.Eval(context)[2]
        motion = (forward * math.cos(yaw), forward * math.sin(yaw), turn)
        output.SetFromVector([0.0, 0.0, 0.0, *motion])

    def _driven(self, speed):
        return max(-self._top, min(self._top, STEP * round(speed / STEP)))
