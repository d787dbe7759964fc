"""The colour words of a world and how they are painted.

Each colour stays inside its word's region of hue, saturation and value under the scene's lights,
which shade a face between 0.74 and 1.0 of its colour (``scenery.lights``).
"""

from __future__ import annotations

PALETTE: dict[str, tuple[float, float, float]] = {
    "red": (0.80, 0.10, 0.10),
    "orange": (0.96, 0.50, 0.06),
    "yellow": (0.95, 0.84, 0.12),
    "green": (0.14, 0.56, 0.20),
    "cyan": (0.16, 0.66, 0.68),
    "blue": (0.16, 0.32, 0.80),
    "purple": (0.50, 0.20, 0.66),
    "pink": (0.97, 0.56, 0.72),
    "brown": (0.44, 0.27, 0.13),
    "white": (0.97, 0.97, 0.97),
    "gray": (0.46, 0.46, 0.47),
    "black": (0.09, 0.09, 0.10),
}
"""Colour word -> red, green, blue in [0, 1]."""
