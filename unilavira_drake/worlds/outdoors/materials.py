"""What the outdoors is made of: colours and patterns of ground, facades and roofs."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Message

Color = tuple[float, float, float]


@dataclass(frozen=True)
class GroundMaterial(Message):
    """What a part of the ground is made of."""

    color: Color
    """Red, green, blue in [0, 1]."""
    grain: float
    """Deviation of the brightness from pixel to pixel."""
    patches: float
    """Deviation of the brightness over metres."""
    joint: float = 0.0
    """Side of its slabs, metres; 0 without."""


@dataclass(frozen=True)
class FacadeMaterial(Message):
    """What the walls of a building are made of."""

    color: Color
    word: str
    """The colour word that its pixels show."""
    pattern: str = "plaster"
    """``plaster``, ``brick``, ``panel``, ``wood`` or ``glass``."""


GROUND = {
    "asphalt": GroundMaterial((0.30, 0.30, 0.32), 0.04, 0.03),
    "paving": GroundMaterial((0.62, 0.61, 0.59), 0.03, 0.02, 0.9),
    "cobbles": GroundMaterial((0.55, 0.51, 0.47), 0.06, 0.03, 0.6),
    "gravel": GroundMaterial((0.72, 0.66, 0.54), 0.06, 0.03),
    "sand": GroundMaterial((0.84, 0.76, 0.56), 0.04, 0.03),
    "grass": GroundMaterial((0.36, 0.52, 0.24), 0.07, 0.07),
    "meadow": GroundMaterial((0.46, 0.57, 0.28), 0.08, 0.10),
    "pitch": GroundMaterial((0.30, 0.56, 0.25), 0.03, 0.03),
    "water": GroundMaterial((0.22, 0.44, 0.62), 0.015, 0.05),
    "tartan": GroundMaterial((0.66, 0.30, 0.22), 0.04, 0.02),
}
"""Name -> what the ground is made of."""

FACADES = {
    "red_brick": FacadeMaterial((0.68, 0.29, 0.22), "red", "brick"),
    "gray_stone": FacadeMaterial((0.58, 0.57, 0.55), "gray", "brick"),
    "concrete": FacadeMaterial((0.61, 0.61, 0.60), "gray", "panel"),
    "white_plaster": FacadeMaterial((0.93, 0.92, 0.89), "white"),
    "yellow_plaster": FacadeMaterial((0.94, 0.82, 0.42), "yellow"),
    "blue_plaster": FacadeMaterial((0.50, 0.64, 0.86), "blue"),
    "green_plaster": FacadeMaterial((0.54, 0.74, 0.52), "green"),
    "pink_plaster": FacadeMaterial((0.93, 0.68, 0.71), "pink"),
    "orange_plaster": FacadeMaterial((0.93, 0.58, 0.26), "orange"),
    "brown_wood": FacadeMaterial((0.46, 0.31, 0.19), "brown", "wood"),
    "glass": FacadeMaterial((0.34, 0.52, 0.74), "blue", "glass"),
}
"""Name -> what walls of buildings are made of."""

ROOFS = {
    "red": (0.68, 0.25, 0.18),
    "brown": (0.43, 0.28, 0.18),
    "gray": (0.46, 0.46, 0.48),
    "black": (0.16, 0.16, 0.18),
    "green": (0.34, 0.58, 0.44),
    "blue": (0.25, 0.38, 0.68),
    "orange": (0.86, 0.47, 0.22),
    "white": (0.84, 0.84, 0.83),
}
"""Colour word -> colour of a roof."""
