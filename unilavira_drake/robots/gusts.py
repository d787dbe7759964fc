"""Random gusts as a function of a seed and a count: no generator whose state could get lost."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.kernels import kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_SHIFT_30, _SHIFT_27, _SHIFT_31 = np.uint64(30), np.uint64(27), np.uint64(31)
_SHIFT_11 = np.uint64(11)


@kernel
def _uniform(seed: int, count: int) -> float:
    """Returns a number in (0, 1): splitmix64 (Steele, Lea and Flood 2014) of seed and count."""
    x = (np.uint64(seed) * _FIRST) ^ (np.uint64(count) * _GOLDEN)
    for _ in range(2):
        x = x + _GOLDEN
        x = (x ^ (x >> _SHIFT_30)) * _FIRST
        x = (x ^ (x >> _SHIFT_27)) * _SECOND
        x = x ^ (x >> _SHIFT_31)
    return (float(x >> _SHIFT_11) + 0.5) / 9007199254740992.0


@kernel
def normal(seed: int, count: int) -> float:
    """Returns a standard normal number of a seed and a count, both not negative."""
    radius = math.sqrt(-2.0 * math.log(_uniform(seed, 2 * count)))
    return radius * math.cos(2.0 * math.pi * _uniform(seed, 2 * count + 1))


@kernel
def next_gust(
    gust: NDArray[np.float64],
    seed: int,
    count: int,
    period: float,
    intensity: float,
    correlation_time: float,
) -> NDArray[np.float64]:
    """Returns the gust one period later, m/s; (3,).

    A first-order Gauss-Markov process on each axis, sampled exactly; the vertical gusts are half
    as strong.  It is the longitudinal spectrum of Dryden's model (MIL-F-8785C).

    Args:
        gust: (3,) gust now, m/s.
        seed: of the process.
        count: how many periods there were before.
        period: seconds.
        intensity: standard deviation of the horizontal gusts, m/s.
        correlation_time: seconds.
    """
    keep = math.exp(-period / correlation_time)
    spread = intensity * math.sqrt(1.0 - keep * keep)
    out = np.empty(3)
    for axis in range(3):
        scale = 0.5 * spread if axis == 2 else spread
        out[axis] = keep * gust[axis] + scale * normal(seed, 3 * count + axis)
    return out


@kernel
def drag(
    air: NDArray[np.float64], body_state: NDArray[np.float64], linear: float, quadratic: float
) -> NDArray[np.float64]:
    """Returns the force of the air on a floating body, no torque and newtons in the world; (6,).

    Args:
        air: (3,) its velocity, m/s.
        body_state: (13,) quaternion, position, [w; v] in the world.
        linear: newtons by m/s.
        quadratic: newtons by (m/s)^2.
    """
    against = air - body_state[10:13]
    force = np.zeros(6)
    force[3:] = (linear + quadratic * math.sqrt(np.sum(against * against))) * against
    return force


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    drag(np.zeros(3), np.zeros(13), 0.0, 0.0)
    next_gust(np.zeros(3), 0, 0, 0.01, 1.0, 1.0)
