"""Light that depends only on where a surface looks: suns, softened by the sky around them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from unilavira_drake.messages import Message

Triple = tuple[float, float, float]

SUNS = 3
"""At most so many."""

_NO_SUN = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Light(Message):
    """Brightness of a matte surface by its normal: half sun, half sky.

    A face square to a world axis shows what the suns alone would give it.  Between the axes the
    sky's half is an ambient cube (McTaggart, "Half-Life 2 / Valve Source shading", 2004), the mean
    of the three sides weighted by the squares of the normal, so no slanted face is black.

    Raises:
        ValueError: if there are more than three suns.
    """

    suns: tuple[Triple, ...] = ((0.94, 0.90, 0.50), (-0.86, -0.78, 0.50), (0.0, 0.0, -0.80))
    """Where each sun stands, as a vector of its brightness."""

    def __post_init__(self) -> None:
        if len(self.suns) > SUNS:
            raise ValueError(f"at most {SUNS} suns, not {len(self.suns)}")

    def sides(self, sign: float) -> Triple:
        """Returns the brightness of faces that look along sign x, sign y, sign z."""
        x, y, z = (sum(max(0.0, sign * sun[axis]) for sun in self.suns) for axis in range(3))
        return (x, y, z)

    def padded(self) -> tuple[Triple, ...]:
        """Returns the suns, filled up with dark ones."""
        return (*self.suns, *((_NO_SUN,) * SUNS))[:SUNS]


def suns_of(lights: Iterable[Any]) -> Light:
    """Returns the suns that Drake's directional lights in the world are.

    Args:
        lights: ``LightParameter``; other kinds of light are left out.
    """
    suns = []
    for light in lights:
        if light.type == "directional" and light.frame == "world":
            x, y, z = (float(part) for part in light.direction)
            gain = light.intensity / (x * x + y * y + z * z) ** 0.5
            suns.append((-gain * x, -gain * y, -gain * z))
    return Light(tuple(suns[:SUNS]))
