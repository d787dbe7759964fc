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

MEMORY = 22
"""Numbers that the cascade remembers: integrals of velocity and rate error (3 each), the filtered
derivatives of velocity and rate (3 each), velocity and rate before (3 each), whether those two are
known, and the filtered velocity of the setpoint (3)."""

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
def _thrust_wanted(
    memory: NDArray[np.float64],
    p_WB: NDArray[np.float64],
    v_WB: NDArray[np.float64],
    setpoint: NDArray[np.float64],
    period: float,
    airframe: Airframe,
    gains: AutopilotGains,
) -> NDArray[np.float64]:
    """The loops of position (P) and velocity (PID): thrust by mass in the world, m/s^2; (3,)."""
    integral = memory[0:3]
    error = velocity_setpoint(p_WB, setpoint, gains) - v_WB
    # What the moving setpoint gains in speed is not left to the error.
    ahead = (setpoint[4:7] - memory[19:22]) / gains.lead_time
    memory[19:22] += min(period, gains.lead_time) * ahead
    wish = gains.velocity_p * error + integral - gains.velocity_d * memory[6:9] + ahead
    f = specific_thrust(wish, airframe, gains)
    for i in range(3):
        # What could not be had is taken back from the error, as PX4 does.
        got = f[i] - (GRAVITY if i == 2 else 0.0)
        left = error[i] - (wish[i] - got) / gains.velocity_p
        if left * error[i] < 0.0:
            left = 0.0
        value = integral[i] + gains.velocity_i * left * period
        integral[i] = min(max(value, -WINDUP), WINDUP)
    return f


@kernel
def _rate_wanted(
    R_WB: NDArray[np.float64], f: NDArray[np.float64], yaw: float, gains: AutopilotGains
) -> NDArray[np.float64]:
    """The loop of attitude (P): body rate towards a thrust and a yaw, rad/s; (3,)."""
    wanted = attitude_of(f / math.sqrt(np.sum(f * f)), yaw)
    rate = gains.attitude * attitude_error(quaternion_of(R_WB), wanted, gains.yaw_weight)
    for i in range(3):
        bound = gains.max_yaw_rate if i == 2 else gains.max_rate
        rate[i] = min(max(rate[i], -bound), bound)
    return rate


@kernel
def _torque_wanted(
    memory: NDArray[np.float64],
    rate_error: NDArray[np.float64],
    w_WB_B: NDArray[np.float64],
    airframe: Airframe,
    gains: AutopilotGains,
) -> NDArray[np.float64]:
    """The loop of rate (PID), without its integral's step: torque in the body frame, N m; (3,)."""
    angular = gains.rate_p * rate_error + memory[3:6] - gains.rate_d * memory[9:12]
    inertia = np.array([airframe.inertia_x, airframe.inertia_y, airframe.inertia_z])
    spin = inertia * w_WB_B
    torque = inertia * angular
    torque[0] += w_WB_B[1] * spin[2] - w_WB_B[2] * spin[1]
    torque[1] += w_WB_B[2] * spin[0] - w_WB_B[0] * spin[2]
    torque[2] += w_WB_B[0] * spin[1] - w_WB_B[1] * spin[0]
    return torque


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
        memory: (22,) float64; zeros at first.
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
    _derive(memory, v_WB, w_WB_B, period, gains)
    f = _thrust_wanted(memory, p_WB, v_WB, setpoint, period, airframe, gains)
    rate_error = _rate_wanted(R_WB, f, setpoint[3], gains) - w_WB_B
    torque = _torque_wanted(memory, rate_error, w_WB_B, airframe, gains)
    # Thrust along the body's z axis as it is, not as it should be.
    thrust = airframe.mass * max(np.sum(f * R_WB[:, 2]), 0.3 * math.sqrt(np.sum(f * f)))
    level_cut, yaw_cut = mix(thrust, torque, airframe, rotors)
    for i in range(3):
        if not (yaw_cut if i == 2 else level_cut):
            value = memory[3 + i] + gains.rate_i * rate_error[i] * period
            bound = 0.5 * gains.rate_p
            memory[3 + i] = min(max(value, -bound), bound)


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


@kernel
def pilot(
    memory: NDArray[np.float64],
    command: NDArray[np.float64],
    X_WB: NDArray[np.float64],
    twist: NDArray[np.float64],
    period: float,
    airframe: Airframe,
    gains: AutopilotGains,
) -> NDArray[np.float64]:
    """Returns the thrust of each rotor, newtons, whatever the numbers are; (4,) float64.

    Args:
        memory: (27,) float64, changed: the cascade's, then x, y, z and yaw of the latest finite
            command, and whether there was one.
        command: (7,) x, y, z, yaw, vx, vy, vz; what is not finite leaves it hovering where it was
            last told to be.
        X_WB: (3, 4) pose.  While pose or twist are not finite, the rotors carry the weight.
        twist: (6,) [w; v] of B in W, expressed in B.
        period: of the steps, seconds.
        airframe: of the aircraft.
        gains: of the cascade.
    """
    setpoint = np.zeros(7)
    if np.isfinite(command).all():
        setpoint[:] = command
        memory[MEMORY : MEMORY + 4] = command[:4]
        memory[MEMORY + 4] = 1.0
    else:
        setpoint[:4] = memory[MEMORY : MEMORY + 4]
    if memory[MEMORY + 4] == 0.0:
        return np.zeros(4)
    rotors = np.full(4, 0.25 * airframe.mass * GRAVITY)
    if np.isfinite(X_WB).all() and np.isfinite(twist).all():
        R_WB = X_WB[:, :3].copy()
        v_WB = np.zeros(3)
        for i in range(3):
            for j in range(3):
                v_WB[i] += R_WB[i, j] * twist[3 + j]
        fly(memory[:MEMORY], R_WB, X_WB[:, 3].copy(), v_WB, twist[:3].copy(), setpoint, period,
            airframe, gains, rotors)  # fmt: skip
    return rotors


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    X_WB = np.ascontiguousarray(np.eye(3, 4))
    command, twist = np.zeros(7), np.zeros(6)
    pilot(np.zeros(MEMORY + 5), command, X_WB, twist, 0.01, Airframe(), AutopilotGains())
