"""The flight cascade: position, velocity, attitude, rate, rotors, in the manner of PX4.

Each loop asks the next one for something bounded, and learns when it did not get it, so that no
integral winds up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel
from unilavira_drake.robots.flight_attitude import attitude_error, attitude_of, quaternion_of
from unilavira_drake.robots.flight_limits import GRAVITY, Airframe, AutopilotGains
from unilavira_drake.robots.rotor_mixer import mix

MEMORY = 19
"""Numbers that the cascade remembers: integrals of velocity and rate error (3 each), the filtered
derivatives of velocity and rate (3 each), velocity and rate before (3 each), and whether those two
are known."""

WINDUP = 3.0
"""Bound on the integral of the velocity loop, m/s^2."""


@kernel
def velocity_setpoint(
    p_WB: NDArray[np.float64], setpoint: NDArray[np.float64], gains: AutopilotGains
) -> NDArray[np.float64]:
    """Returns the velocity that leads back to a moving setpoint, m/s in the world; (3,).

    Args:
        p_WB: (3,) position, metres.
        setpoint: (7,) x, y, z, yaw, vx, vy, vz.
        gains: gains and bounds.
    """
    v = gains.position * (setpoint[:3] - p_WB) + setpoint[4:7]
    speed = math.hypot(v[0], v[1])
    if speed > gains.max_speed:
        v[0] *= gains.max_speed / speed
        v[1] *= gains.max_speed / speed
    v[2] = min(max(v[2], -gains.max_vertical_speed), gains.max_vertical_speed)
    return v


@kernel
def specific_thrust(
    acceleration: NDArray[np.float64], airframe: Airframe, gains: AutopilotGains
) -> NDArray[np.float64]:
    """Returns the thrust by mass nearest to an acceleration that the aircraft can have; (3,) m/s^2.

    The vertical part comes first; the horizontal part is bounded by the tilt and by what the
    rotors have left.
    """
    # A fifth of the rotors' thrust is left to the torques.
    most = 0.8 * 4.0 * airframe.max_thrust / airframe.mass
    least = 0.25 * GRAVITY
    f = acceleration.copy()
    f[2] = min(max(f[2] + GRAVITY, least), most * math.cos(gains.max_tilt))
    level = math.hypot(f[0], f[1])
    bound = min(f[2] * math.tan(gains.max_tilt), math.sqrt(most**2 - f[2] ** 2))
    if level > bound:
        f[0] *= bound / level
        f[1] *= bound / level
    return f


@kernel
def fly(
    memory: NDArray[np.float64],
    R_WB: NDArray[np.float64],
    p_WB: NDArray[np.float64],
    v_WB: NDArray[np.float64],
    w_WB_B: NDArray[np.float64],
    setpoint: NDArray[np.float64],
    period: float,
    airframe: Airframe,
    gains: AutopilotGains,
    rotors: NDArray[np.float64],
) -> None:
    """Makes one step of the cascade: changes ``memory``, fills ``rotors`` with newtons.

    Args:
        memory: (19,) float64; zeros at first.
        R_WB: (3, 3) attitude.
        p_WB: (3,) position, metres.
        v_WB: (3,) velocity in the world, m/s.
        w_WB_B: (3,) body rate in the body frame, rad/s.
        setpoint: (7,) x, y, z, yaw, vx, vy, vz in the world.
        period: of the steps, seconds.
        airframe: of the aircraft.
        gains: of the cascade.
        rotors: (4,) thrust of each rotor.
    """
    velocity_integral, rate_integral = memory[0:3], memory[3:6]
    _derive(memory, v_WB, w_WB_B, period, gains)
    # Velocity PID.
    error = velocity_setpoint(p_WB, setpoint, gains) - v_WB
    wish = gains.velocity_p * error + velocity_integral - gains.velocity_d * memory[6:9]
    f = specific_thrust(wish, airframe, gains)
    for i in range(3):
        # What could not be had is taken back from the error, as PX4 does.
        got = f[i] - (GRAVITY if i == 2 else 0.0)
        left = error[i] - (wish[i] - got) / gains.velocity_p
        if left * error[i] < 0.0:
            left = 0.0
        value = velocity_integral[i] + gains.velocity_i * left * period
        velocity_integral[i] = min(max(value, -WINDUP), WINDUP)
    # Attitude P.
    magnitude = math.sqrt(np.sum(f * f))
    q = quaternion_of(R_WB)
    turn = attitude_error(q, attitude_of(f / magnitude, setpoint[3]), gains.yaw_weight)
    rate = gains.attitude * turn
    for i in range(3):
        bound = gains.max_yaw_rate if i == 2 else gains.max_rate
        rate[i] = min(max(rate[i], -bound), bound)
    # Rate PID.
    rate_error = rate - w_WB_B
    angular = gains.rate_p * rate_error + rate_integral - gains.rate_d * memory[9:12]
    inertia = np.array([airframe.inertia_x, airframe.inertia_y, airframe.inertia_z])
    spin = inertia * w_WB_B
    torque = inertia * angular
    torque[0] += w_WB_B[1] * spin[2] - w_WB_B[2] * spin[1]
    torque[1] += w_WB_B[2] * spin[0] - w_WB_B[0] * spin[2]
    torque[2] += w_WB_B[0] * spin[1] - w_WB_B[1] * spin[0]
    # Thrust along the body's z axis as it is, not as it should be.
    thrust = airframe.mass * max(np.sum(f * R_WB[:, 2]), 0.3 * magnitude)
    level_cut, yaw_cut = mix(thrust, torque, airframe, rotors)
    for i in range(3):
        if not (yaw_cut if i == 2 else level_cut):
            value = rate_integral[i] + gains.rate_i * rate_error[i] * period
            bound = 0.5 * gains.rate_p
            rate_integral[i] = min(max(value, -bound), bound)


@kernel
def _derive(
    memory: NDArray[np.float64],
    v_WB: NDArray[np.float64],
    w_WB_B: NDArray[np.float64],
    period: float,
    gains: AutopilotGains,
) -> None:
    """Filters the derivatives of velocity and rate: measured, not those of the errors."""
    if memory[18] > 0.0:
        share = period / (period + gains.filter_time)
        memory[6:9] += share * ((v_WB - memory[12:15]) / period - memory[6:9])
        memory[9:12] += share * ((w_WB_B - memory[15:18]) / period - memory[9:12])
    memory[12:15] = v_WB
    memory[15:18] = w_WB_B
    memory[18] = 1.0


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    rotors, zero = np.empty(4), np.zeros(3)
    fly(
        np.zeros(MEMORY), np.eye(3), zero, zero, zero, np.zeros(7), 0.01,
        Airframe(), AutopilotGains(), rotors,
    )  # fmt: skip
