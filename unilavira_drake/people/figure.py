"""What a person looks like: a few smooth shapes, each one a small mesh of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from unilavira_drake.messages import Message
from unilavira_drake.people.crowd import Person
from unilavira_drake.worlds.palette import PALETTE

Color = tuple[float, float, float]
Ring = tuple[float, float, float, float]
"""Height, half depth (x), half width (y) and shift forward of a level section, metres."""

SIDES = 12
HIP = 0.88
"""Height at which the legs swing, of a person of 1.75 m."""
SHOULDER = 1.40
USUAL_HEIGHT = 1.75

_SKIN: tuple[Color, ...] = ((0.93, 0.76, 0.65), (0.78, 0.57, 0.42), (0.45, 0.30, 0.22))
_HAIR: tuple[Color, ...] = ((0.12, 0.09, 0.08), (0.35, 0.22, 0.12), (0.72, 0.58, 0.34))
_TROUSERS: tuple[Color, ...] = ((0.16, 0.18, 0.26), (0.30, 0.30, 0.31), (0.35, 0.28, 0.20))
_SHOES: Color = (0.10, 0.09, 0.09)

_TORSO: tuple[Ring, ...] = (
    (0.84, 0.00, 0.00, 0.0),
    (0.85, 0.13, 0.18, 0.0),
    (0.95, 0.125, 0.17, 0.0),
    (1.08, 0.105, 0.145, 0.0),
    (1.28, 0.125, 0.18, 0.0),
    (1.40, 0.11, 0.20, -0.005),
    (1.46, 0.08, 0.15, -0.01),
    (1.50, 0.055, 0.06, -0.01),
)
_HIPS: tuple[Ring, ...] = (
    (0.78, 0.0, 0.0, 0.0),
    (0.80, 0.095, 0.13, 0.0),
    (0.93, 0.11, 0.15, 0.0),
)
_NECK: tuple[Ring, ...] = ((1.46, 0.05, 0.05, -0.01), (1.56, 0.048, 0.048, 0.0))
_LEG: tuple[Ring, ...] = (
    (0.02, 0.08, 0.072, 0.0),
    (-0.15, 0.08, 0.072, 0.0),
    (-0.42, 0.058, 0.055, 0.01),
    (-0.55, 0.058, 0.052, 0.0),
    (-0.80, 0.045, 0.042, 0.0),
)
_SHOE: tuple[Ring, ...] = (
    (-0.88, 0.0, 0.0, 0.05),
    (-0.88, 0.14, 0.05, 0.05),
    (-0.84, 0.13, 0.048, 0.045),
    (-0.78, 0.05, 0.045, 0.0),
)
_SLEEVE: tuple[Ring, ...] = (
    (0.05, 0.0, 0.0, 0.0),
    (0.03, 0.05, 0.045, 0.0),
    (-0.10, 0.052, 0.048, 0.0),
    (-0.30, 0.042, 0.040, 0.0),
)
_FOREARM: tuple[Ring, ...] = (
    (-0.29, 0.038, 0.036, 0.0),
    (-0.52, 0.028, 0.024, 0.04),
    (-0.58, 0.042, 0.022, 0.05),
    (-0.67, 0.025, 0.018, 0.06),
    (-0.68, 0.0, 0.0, 0.06),
)


@dataclass(frozen=True, eq=False)
class Part(Message):
    """A mesh of one colour, in the frame of the limb that carries it."""

    name: str
    limb: str
    """``body``, ``left_leg``, ``right_leg``, ``left_arm`` or ``right_arm``."""
    color: Color
    rings: tuple[Ring, ...]

    def mesh(self, scale: float) -> Mesh:
        """Returns its triangles for a person so many times as tall as usual."""
        file = MemoryFile(_lathe(self.rings, scale), ".obj", self.name)
        return Mesh(mesh_data=InMemoryMesh(mesh_file=file), scale=1.0)


def figure(person: Person) -> tuple[Part, ...]:
    """Returns the parts of a person who faces +x; z is up, and 0 on the floor or at the joint."""
    skin, hair = _SKIN[person.look % 3], _HAIR[person.look // 3 % 3]
    trousers, shirt = _TROUSERS[person.look // 9 % 3], PALETTE[person.color]
    parts = [
        Part("torso", "body", shirt, _TORSO),
        Part("hips", "body", trousers, _HIPS),
        Part("neck", "body", skin, _NECK),
        Part("head", "body", skin, _ball(1.645, (0.092, 0.076, 0.118))),
        Part("nose", "body", skin, _ball(1.635, (0.02, 0.014, 0.025), 0.09)),
        Part("hair", "body", hair, _ball(1.675, (0.098, 0.084, 0.105), -0.018, bottom=-0.3)),
    ]
    for side in ("left", "right"):
        parts += [
            Part("leg", f"{side}_leg", trousers, _LEG),
            Part("shoe", f"{side}_leg", _SHOES, _SHOE),
            Part("sleeve", f"{side}_arm", shirt, _SLEEVE),
            Part("forearm", f"{side}_arm", skin, _FOREARM),
        ]
    return tuple(parts)


def _ball(
    z: float, size: tuple[float, float, float], x: float = 0.0, bottom: float = -1.0
) -> tuple[Ring, ...]:
    """Returns the rings of an ellipsoid, from ``bottom`` (of its half height) upwards."""
    angles = np.linspace(math.asin(bottom), math.pi / 2, 7)
    rings = [
        (z + size[2] * math.sin(a), size[0] * math.cos(a), size[1] * math.cos(a), x)
        for a in angles.tolist()
    ]
    return tuple(rings)


def _lathe(rings: Sequence[Ring], scale: float) -> str:
    """Returns a stack of ellipses as the text of an .obj file with smooth normals."""
    around = np.arange(SIDES) * 2.0 * math.pi / SIDES
    levels = np.array(sorted(rings, key=lambda ring: ring[0])) * scale
    z, a, b, shift = levels.T
    x = shift[:, None] + a[:, None] * np.cos(around)
    y = b[:, None] * np.sin(around)
    p = np.stack((x, y, np.broadcast_to(z[:, None], x.shape)), axis=-1)
    along = np.gradient(p, axis=0)
    # Around an ellipse that has shrunk to a point its neighbour's direction stands in.
    wide = np.maximum(np.stack((a, b)), 1e-3)
    turn = np.stack(
        (-wide[0][:, None] * np.sin(around), wide[1][:, None] * np.cos(around), np.zeros(x.shape)),
        axis=-1,
    )
    normals = np.cross(turn, along)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*point) for point in p.reshape(-1, 3)]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*normal) for normal in normals.reshape(-1, 3)]
    for level in range(len(levels) - 1):
        for k in range(SIDES):
            corners = (
                level * SIDES + k,
                level * SIDES + (k + 1) % SIDES,
                (level + 1) * SIDES + (k + 1) % SIDES,
                (level + 1) * SIDES + k,
            )
            i, j, m, n = (f"{corner + 1}//{corner + 1}" for corner in corners)
            lines += [f"f {i} {j} {m}", f"f {i} {m} {n}"]
    return "\n".join(lines) + "\n"
