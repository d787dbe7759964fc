"""A controller of one's own in the place of ours: the rest of the robot does not notice.

It needs the ports of the level it replaces, no more.  Any System will do: a C++ one, a whole
Diagram, or these twenty lines.
"""

import math

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import LeafSystem

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import Path, Sweep


class TurnThenDrive(LeafSystem):
    """Faces the next point of the path, then drives to it: slow, and easy to read."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareAbstractInputPort("path", AbstractValue.Make(Path()))
        self.DeclareAbstractInputPort("sweep", AbstractValue.Make(Sweep()))
        self.DeclareAbstractInputPort("pose_estimate", Value[RigidTransform]())
        self.DeclareVectorInputPort("twist", 6)
        command = self.DeclareDiscreteState(4)
        self.DeclarePeriodicDiscreteUpdateEvent(0.05, 0.0, self.update)
        self.DeclareStateOutputPort("desired_command", command)

    def update(self, context, state):
        path, sweep = (self.GetInputPort(name).Eval(context) for name in ("path", "sweep"))
        X_WB = self.GetInputPort("pose_estimate").Eval(context)
        yaw = math.atan2(*X_WB.rotation().matrix()[1::-1, 0])
        heading, distance = (sweep.heading if sweep.active else yaw), 0.0
        if path.n >= sweep.n and len(path.p_WP) > 0:
            ahead = path.p_WP - X_WB.translation()[:2]
            nearest = int(np.argmin(np.linalg.norm(ahead, axis=1)))
            dx, dy = ahead[min(nearest + 1, len(ahead) - 1)]
            heading, distance = math.atan2(dy, dx), math.hypot(dx, dy)
        error = math.remainder(heading - yaw, 2 * math.pi)
        speed = min(0.4, distance) if abs(error) < 0.3 else 0.0
        command = [speed, 0.0, max(-1.0, min(1.0, 2.0 * error)), context.get_time()]
        state.get_mutable_vector().SetFromVector(command)


if __name__ == "__main__":
    scenario = load_scenario("flat", "task: {text: '@fridge'}")
    result = run_episode(scenario, replace={"controller": TurnThenDrive()})
    print(f"{result.cause}; success: {result.success}; {result.metrics}")
