"""The limits of a differential base and the two profiles that follow from them."""

from __future__ import annotations

import math
from typing import NamedTuple

from unilavira_drake.kernels import kernel


class DriveLimits(NamedTuple):
    """What a differential base may do in one control period."""

    max_speed: float = 0.8
    """m/s, forwards and backwards."""
    max_yaw_rate: float = 1.5
    """rad/s."""
    max_acceleration: float = 1.0
    """m/s^2, speeding up and braking."""
    max_yaw_acceleration: float = 3.0
    """rad/s^2."""
    period: float = 0.05
    """Seconds for which a command is held."""


class Reaction(NamedTuple):
    """How a base follows its commands: a dead time, then a first-order lag.

    Whatever the lag, the base at last covers the integral of its commands; so the motion still
    to come from the past is (speed now) * lag + (previous command) * delay.
    """

    delay: float = 0.02
    """From the measurement to the first change of the base, seconds."""
    lag: float = 0.01
    """Time constant of the base's velocity servo, seconds."""


@kernel
def approach(previous: float, target: float, step: float) -> float:
    """Returns ``target``, or the value nearest to it within ``step`` of ``previous``."""
    return min(max(target, previous - step), previous + step)


@kernel
def braking_speed(distance: float, deceleration: float, period: float) -> float:
    """Returns the largest speed from which a base still stops within ``distance``.

    The base holds each command for one period and then slows down by ``deceleration * period``,
    so it comes to rest after v (v + deceleration period) / (2 deceleration).  Within the last
    step the distance is covered in one period.  Works for metres and radians alike.
    """
    if distance <= 0.0:
        return 0.0
    step = deceleration * period
    if distance < step * period:
        return distance / period
    return math.sqrt(0.25 * step * step + 2.0 * deceleration * distance) - 0.5 * step


def warm_up() -> None:
    """Compiles the kernels of this module."""
    approach(0.0, 0.0, 1.0)
    braking_speed(1.0, 1.0, 1.0)
