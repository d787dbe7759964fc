"""How trunk and legs swing when a body walks: angles as a function of phase and amplitude."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from unilavira_drake.robots.gait_config import Gait

LEG_PHASES = {
    "front_left": 0.0,
    "front_right": 0.5,
    "rear_left": 0.5,
    "rear_right": 0.0,
    "left": 0.0,
    "right": 0.5,
}
"""Share of a cycle by which a leg is ahead: a quadruped trots, a biped steps left and right."""

KNEE_BEND = 1.6
"""A knee bends this many times as far as its hip swings."""
ARM_SWING = 0.7
"""An arm swings this many times as far as a leg, against the leg of its side."""
SETTLING = 0.15
"""Time constant with which the amplitude follows the speed, seconds."""
STILL = 0.01
"""A smaller amplitude is none."""
SLOWEST = 0.5
"""The phase of a slow walk runs at this share of the full frequency."""


def next_amplitude(amplitude: float, effort: float, step: float) -> float:
    """Returns the amplitude after ``step`` seconds; it follows the effort, both in [0, 1]."""
    amplitude = effort + (amplitude - effort) * math.exp(-step / SETTLING)
    return 0.0 if effort == 0.0 and amplitude < STILL else amplitude


def phase_rate(gait: Gait, effort: float) -> float:
    """Returns how fast the phase runs, cycles per second."""
    return gait.frequency * max(effort, SLOWEST)


def swing(
    gait: Gait, joints: Sequence[str], phase: float, amplitude: float, rate: float
) -> tuple[list[float], list[float]]:
    """Returns positions and velocities of named joints in mid gait.

    Known are ``trunk_z``, ``trunk_roll``, ``trunk_pitch``, and of each leg LEG in ``LEG_PHASES``
    ``LEG_hip``, ``LEG_knee`` and ``LEG_shoulder``; every other joint stays at 0.

    Args:
        gait: amplitudes at full effort.
        joints: names.
        phase: in cycles.
        amplitude: in [0, 1].
        rate: of the phase, cycles per second.
    """
    waves = _waves(gait)
    positions, velocities = [], []
    for joint in joints:
        size, cycles, ahead = waves.get(joint, (0.0, 1.0, 0.0))
        angle = math.tau * (cycles * phase + ahead)
        position, velocity = math.sin(angle), math.tau * cycles * rate * math.cos(angle)
        if joint.endswith("_knee"):
            # Bent while the hip swings forward, stretched while it carries.
            position, velocity = (position, velocity) if position > 0.0 else (0.0, 0.0)
        positions.append(amplitude * size * position)
        velocities.append(amplitude * size * velocity)
    return positions, velocities


def joints_without(gait: Gait, joints: Collection[str]) -> dict[str, str]:
    """Returns what of a gait nothing would show: of each such amplitude, the joint it swings.

    Args:
        gait: amplitudes; one of 0 needs no joint.
        joints: names of the joints that are there to be swung.
    """
    needed = {
        "heave": ("trunk_z",),
        "roll_degrees": ("trunk_roll",),
        "pitch_degrees": ("trunk_pitch",),
        "swing_degrees": tuple(f"{leg}_hip" for leg in LEG_PHASES),
    }
    return {
        name: names[0] if len(names) == 1 else "LEG_hip"
        for name, names in needed.items()
        if getattr(gait, name) and not any(joint in joints for joint in names)
    }


def _waves(gait: Gait) -> Mapping[str, tuple[float, float, float]]:
    """Size, waves per cycle and share of a wave by which it is ahead, of each joint."""
    leg = math.radians(gait.swing_degrees)
    waves = {
        "trunk_z": (gait.heave, 2.0, 0.0),
        "trunk_roll": (math.radians(gait.roll_degrees), 1.0, 0.0),
        "trunk_pitch": (math.radians(gait.pitch_degrees), 2.0, 0.25),
    }
    for name, ahead in LEG_PHASES.items():
        waves[f"{name}_hip"] = (-leg, 1.0, ahead)
        waves[f"{name}_knee"] = (KNEE_BEND * leg, 1.0, ahead + 0.25)
        waves[f"{name}_shoulder"] = (ARM_SWING * leg, 1.0, ahead)
    return waves
