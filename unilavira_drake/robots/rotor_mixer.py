"""From thrust and torques to four rotors, and what gives way when they do not suffice."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.robots.flight_limits import Airframe

# Front left, front right, back left, back right: x and y of the rotor, and the sign of its yawing
# moment.  Opposite rotors turn alike.
ROTOR_X = (1.0, 1.0, -1.0, -1.0)
ROTOR_Y = (1.0, -1.0, 1.0, -1.0)
ROTOR_MOMENT = (1.0, -1.0, -1.0, 1.0)


@kernel
def mix(
    thrust: float,
    torque: NDArray[np.float64],
    airframe: Airframe,
    rotors: NDArray[np.float64],
) -> tuple[bool, bool]:
    """Fills ``rotors`` with the thrust of each, newtons, and says what could not be had.

    Roll and pitch come first: they keep the aircraft upright.  Then thrust, which is raised or
    lowered until they fit; then yaw, which takes what is left.

    Args:
        thrust: of all rotors, newtons.
        torque: (3,) float64, newton metres in the body frame.
        airframe: rotors and their limits.
        rotors: (4,) float64, filled.

    Returns:
        Whether roll and pitch, and whether yaw, were cut.
    """
    low, high = airframe.min_thrust, airframe.max_thrust
    lever = 4.0 * airframe.rotor_offset
    largest = smallest = 0.0
    for i in range(4):
        rotors[i] = (ROTOR_Y[i] * torque[0] - ROTOR_X[i] * torque[1]) / lever
        largest, smallest = max(largest, rotors[i]), min(smallest, rotors[i])
    cut = largest - smallest > high - low
    scale = (high - low) / (largest - smallest) if cut else 1.0
    base = min(max(0.25 * thrust, low - scale * smallest), high - scale * largest)
    share = abs(torque[2]) / (4.0 * airframe.moment_ratio)
    room = share
    for i in range(4):
        rotors[i] = base + scale * rotors[i]
        up = ROTOR_MOMENT[i] * torque[2] > 0.0
        room = min(room, high - rotors[i] if up else rotors[i] - low)
    room = max(room, 0.0)
    for i in range(4):
        value = rotors[i] + math.copysign(room, ROTOR_MOMENT[i] * torque[2])
        rotors[i] = min(max(value, low), high)
    return cut, room < share
