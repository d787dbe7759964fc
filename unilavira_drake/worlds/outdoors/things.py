"""What things outdoors are, once a world file is read: plain values that meshes are made of."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Message

Place = tuple[float, float, float, float]
"""x, y, z (metres) and yaw (radians)."""


@dataclass(frozen=True)
class GroundPatch(Message):
    """A rectangle or an ellipse of the ground."""

    name: str = ""
    category: str = ""
    material: str = "grass"
    rectangle: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    """(x_min, y_min, x_max, y_max), metres."""
    marking: str = ""
    round: bool = False


@dataclass(frozen=True)
class Building(Message):
    """How a building looks; see ``outdoors.entries.BuildingEntry``."""

    place: Place = (0.0, 0.0, 0.0, 0.0)
    size: tuple[float, float] = (8.0, 10.0)
    height: float = 6.2
    facade: str = "white_plaster"
    roof: str = "gable"
    roof_color: str = "red"
    roof_height: float = 2.5
    windows: str = "plain"
    shop: bool = False
    chimneys: int = 0
    sign: str = ""
    tower: tuple[float, float] | None = None
    seed: int = 0
    mirrored: bool = False


@dataclass(frozen=True)
class Exterior(Message):
    """One or several of the shapes of ``outdoors.shapes``."""

    shape: str = "tree"
    color: str = ""
    """Colour word of what can be painted; empty for the shape's own."""
    places: tuple[Place, ...] = ()
    seed: int = 0
    mirrored: bool = False
