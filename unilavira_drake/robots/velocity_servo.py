"""Servos of a base's joints outside of the plant: the same law, without its solver."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer, Saturation

SAMPLES = (0.7, -1.9)
"""Places of the joints in which their inertia is compared, m or rad: at zero, coupled ones may look
free, and in one place alone an inertia that changes looks constant."""

SMALL = 1e-9
"""What is less by this share is rounding."""


class ServoGains(NamedTuple):
    """What a servo does at a joint in one step of the plant; each is (n,) float64."""

    gain: NDArray[np.float64]
    """Force by what is missing in the speed, N s/m or N m s/rad."""
    effort: NDArray[np.float64]
    """Largest force, N or N m."""


def take_servos(plant: MultibodyPlant, model_instance: ModelInstanceIndex) -> ServoGains | None:
    """Takes the velocity servos of a model out of its plant, if a closed form can stand for them.

    In a discrete plant a servo d (v_d - v) acts on the speed v+ at the end of the step; Drake finds
    it as a constraint, by the solver that it has for contacts.  For a joint of constant inertia m
    that nothing couples with others, v+ = v + dt u / m gives the same force directly:

        u = d (v_d - v+) = d / (1 + dt d / m) (v_d - v), within the effort.

    So it is only with what touches the body that the two differ: there this one pushes as if it
    were free.  A step costs less than half.

    Args:
        plant: finalized, discrete.
        model_instance: of the robot.

    Returns:
        The gains, in the order of the actuators, which are servos no more.  None, and nothing is
        changed, for a model with joints that are not actuated, held in place, damped, or in another
        order than their actuators; with an inertia that is not constant, or coupled among its
        joints or with another model's; with weight on a joint; and in a plant with constraints.
    """
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices(model_instance)]
    joints = [actuator.joint() for actuator in actuators]
    if len(joints) != plant.num_velocities(model_instance) or any(
        joint.num_velocities() != 1 or np.any(joint.default_damping_vector()) for joint in joints
    ):
        return None
    # Asked in this order: Drake aborts when it is asked for gains that are not there.
    if not all(actuator.has_controller() for actuator in actuators):
        return None
    gains = [actuator.get_controller_gains() for actuator in actuators]
    index = [joint.velocity_start() for joint in joints]
    if any(gain.p != 0.0 for gain in gains) or index != sorted(index) or plant.num_constraints():
        return None
    m = _constant_inertia(plant, model_instance, index)
    if m is None:
        return None
    for actuator in actuators:
        plant.get_mutable_joint_actuator(actuator.index()).set_controller_gains(
            PdControllerGains(p=0.0, d=0.0)
        )
    d = np.array([gain.d for gain in gains])
    effort = np.array([actuator.effort_limit() for actuator in actuators])
    return ServoGains(d / (1.0 + plant.time_step() * d / m), effort)


def _constant_inertia(
    plant: MultibodyPlant, model_instance: ModelInstanceIndex, index: list[int]
) -> NDArray[np.float64] | None:
    """The inertia of each joint, kg or kg m^2; None if that is not all that resists it."""
    context = plant.CreateDefaultContext()
    found: list[NDArray[np.float64]] = []
    for sample in SAMPLES:
        place: Any = np.full(len(index), sample)
        plant.SetPositions(context, model_instance, place)
        rows: NDArray[np.float64] = plant.CalcMassMatrix(context)[index]
        m = rows[range(len(index)), index].copy()
        rows[range(len(index)), index] = 0.0
        weight: NDArray[np.float64] = plant.CalcGravityGeneralizedForces(context)[index]
        if np.abs(rows).max() > SMALL * m.max() or np.abs(weight).max() > SMALL * m.max():
            return None
        found.append(m)
    same = np.allclose(found[0], found[1], rtol=SMALL, atol=0.0)
    return found[0] if same else None


class VelocityServo(Diagram):
    """The force of each joint that brings it to its desired speed, within its effort.

    It is evaluated in each step of the plant, so it is made of Drake's own Systems: no call of
    Python's.

    .. pydrake_system::

        name: VelocityServo
        input_ports:
        - joint_state
        - desired_joint_state
        output_ports:
        - actuation

    The states are [q; v] of the joints; of the desired one only v counts.  ``actuation`` is in N or
    N m.

    Args:
        gains: of n joints, see ``take_servos``.
    """

    def __init__(self, gains: ServoGains) -> None:
        super().__init__()
        count = len(gains.gain)
        builder = DiagramBuilder()
        states = builder.AddNamedSystem("states", Multiplexer([2 * count, 2 * count]))
        gain = np.diag(gains.gain)
        zero = np.zeros_like(gain)
        force_by_states: Any = np.hstack([zero, -gain, zero, gain])
        demand = builder.AddNamedSystem("demand", MatrixGain(D=force_by_states))
        effort: Any = gains.effort
        bounded = builder.AddNamedSystem("bounds", Saturation(min_value=-effort, max_value=effort))
        builder.Connect(states.get_output_port(), demand.get_input_port())
        builder.Connect(demand.get_output_port(), bounded.get_input_port())
        builder.ExportInput(states.get_input_port(0), "joint_state")
        builder.ExportInput(states.get_input_port(1), "desired_joint_state")
        builder.ExportOutput(bounded.get_output_port(), "actuation")
        builder.BuildInto(self)
        self.set_name("velocity_servo")
