"""The numbers of the flight cascade: what an aircraft is, may do, and how it is controlled."""

from __future__ import annotations

import math
from typing import NamedTuple

GRAVITY = 9.81
"""m/s^2."""


class FlightLimits(NamedTuple):
    """What an aircraft may do on the way, m/s, rad/s and m/s^2."""

    max_speed: float = 1.0
    """Horizontal."""
    max_climb_speed: float = 0.8
    max_descent_speed: float = 0.6
    max_yaw_rate: float = 1.2
    max_acceleration: float = 1.5
    """Of a setpoint on its way."""
    max_braking: float = 3.0
    """With which the governor stops it, and turns it at corners."""
    period: float = 0.05
    """Seconds for which a setpoint is held."""


class Airframe(NamedTuple):
    """The body that the autopilot moves: kg, kg m^2, m, N."""

    mass: float = 1.5
    inertia_x: float = 0.014
    inertia_y: float = 0.014
    inertia_z: float = 0.024
    rotor_offset: float = 0.16 / math.sqrt(2.0)
    """Of each rotor from the centre, along x and along y."""
    moment_ratio: float = 0.016
    """Yawing moment by thrust of a rotor."""
    max_thrust: float = 7.5
    """Of one rotor."""
    min_thrust: float = 0.15
    """Of one rotor in flight; it never stops."""


class AutopilotGains(NamedTuple):
    """Gains of the cascade and the bounds inside it.

    Each loop is some three times as fast as the one around it.
    """

    position: float = 1.6
    """Velocity by position error, 1/s."""
    velocity_p: float = 3.6
    """Acceleration by velocity error, 1/s."""
    velocity_i: float = 1.2
    """1/s^2."""
    velocity_d: float = 0.15
    lead_time: float = 0.15
    """Over which the setpoint's own acceleration is taken, seconds."""
    attitude: float = 8.0
    """Body rate by attitude error, 1/s."""
    yaw_weight: float = 0.4
    """Share of a heading error that is corrected as fast as an error of tilt."""
    rate_p: float = 22.0
    """Angular acceleration by rate error, 1/s."""
    rate_i: float = 25.0
    rate_d: float = 0.1
    filter_time: float = 0.03
    """Time constant of the measured derivatives, seconds."""
    max_tilt: float = math.radians(25.0)
    max_rate: float = 4.0
    """Of roll and pitch, rad/s."""
    max_yaw_rate: float = 1.8
    """rad/s; above the limit of the setpoints, so that they can be followed."""
    max_speed: float = 8.0
    """Bound on the velocity that a position error asks for, m/s, and ..."""
    max_vertical_speed: float = 3.0
    """... on its vertical part."""
