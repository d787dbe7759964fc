"""What a directive asks, leg by leg, and each leg in canonical words."""

from __future__ import annotations

from dataclasses import dataclass

SOFT = ("turn", "along", "heading")
"""Legs that say how to get there; they become moot once a later one is done."""
_THING = {
    "over": "Fly over the",
    "past": "Fly past the",
    "go": "Fly to the",
    "stop": "Stop at the",
}


@dataclass(frozen=True)
class Leg:
    """One part of a flight; empty fields were not said."""

    kind: str
    """``climb | descend | turn | heading | along | over | past | go | stop``."""
    landmark: str = ""
    """Class of the thing that ends it; of ``along`` what is followed."""
    color: str = ""
    beside: str = ""
    """Class of a thing that stands beside the landmark."""
    side: str = ""
    """``left | right``; of ``turn`` also ``around``."""
    height: float = 0.0
    """Of ``climb`` and ``descend``: metres above what is below."""
    distance: float = 0.0
    """Of ``heading``: metres along the ground from the start ..."""
    bearing: float = 0.0
    """... in this direction, degrees to the left of the first front."""
    roof: str = ""
    """Colour of the landmark's roof: from above it is this one that is seen."""

    @property
    def thing(self) -> str:
        """The landmark in words, e.g. ``red car``."""
        return f"{self.color} {self.landmark}".strip()

    @property
    def hard(self) -> bool:
        """Whether it says where to be."""
        return self.kind not in SOFT


def describe(leg: Leg) -> str:
    """Returns a leg in the words of a TODO item, which the parser reads back unchanged."""
    if leg.kind in ("climb", "descend"):
        return f"{leg.kind.capitalize()} to {leg.height:.0f} m"
    if leg.kind == "turn":
        return f"Turn {leg.side}"
    if leg.kind == "heading":
        side = "left" if leg.bearing >= 0 else "right"
        return (
            f"Fly {leg.distance:.0f} m at {abs(leg.bearing):.0f} degrees to the {side} of the start"
        )
    if leg.kind == "along":
        return f"Fly along the {leg.thing}"
    roof = f" with a {leg.roof} roof" if leg.roof else ""
    beside = f" near the {leg.beside}" if leg.beside else ""
    side = f" on the {leg.side}" if leg.side else ""
    return f"{_THING[leg.kind]} {leg.thing}{roof}{beside}{side}"
