"""Buildings as few quads and one small picture each, and the boxes that a robot collides with."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.outdoors.facades import cell_uv, facade_picture
from unilavira_drake.worlds.outdoors.materials import FACADES
from unilavira_drake.worlds.outdoors.solids import REVERSED, Quads, box, gable, moved, pyramid
from unilavira_drake.worlds.outdoors.things import Building, Place
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.signs import sign_picture
from unilavira_drake.worlds.world import Box

STOREY = 3.1
"""Height of a storey, metres."""
BAY = 3.0
"""Width of a bay, metres."""
ROOF_FORMS = ("flat", "gable", "nave", "pyramid")
WINDOWS = ("plain", "arched", "none")
_EAVES = 0.45
"""By which a roof stands over the walls, metres."""
_PARAPET = 0.5
_ROOF_STEPS = 3
"""Boxes under a sloping roof."""
_TILE = 4.0
"""Side of a cell on a roof, metres."""


@dataclass
class _Skin:
    """Quads with their picture coordinates."""

    corners: list[Quads] = field(default_factory=list)
    uv: list[NDArray[np.float64]] = field(default_factory=list)

    def add(self, quads: Quads, cell: str) -> None:
        """Adds quads that show a whole cell each."""
        self.corners.append(quads)
        self.uv.append(np.broadcast_to(cell_uv(cell), (len(quads), 4, 2)))

    def spread(self, quad: NDArray[np.float64], cell: str, side: float = _TILE) -> None:
        """Adds a quad in pieces of about one size, a cell each."""
        across = max(1, round(float(np.linalg.norm(quad[1] - quad[0])) / side))
        up = max(1, round(float(np.linalg.norm(quad[3] - quad[0])) / side))
        for i in range(across):
            for k in range(up):
                self.add(_piece(quad, (i / across, k / up), (1 / across, 1 / up))[None], cell)


def building_quads(building: Building) -> list[TexturedQuads]:
    """Returns the mesh of a building, in the world."""
    skin = _Skin()
    generator = np.random.default_rng(building.seed)
    depth, width = building.size
    _walls(skin, building, (depth, width, building.height), (0.0, 0.0), generator)
    _roof(skin, building, generator)
    if building.tower is not None:
        _tower(skin, building, building.tower, generator)
    place = building.place
    corners = moved(np.concatenate(skin.corners), place, mirrored=building.mirrored)
    uv = np.concatenate(skin.uv)
    if building.mirrored:
        uv = uv[:, REVERSED]
    picture = facade_picture(building.facade, building.roof_color, building.seed)
    parts = [TexturedQuads(corners, uv, picture)]
    if building.sign:
        parts.append(_sign(building))
    return parts


def building_boxes(building: Building) -> tuple[Box, ...]:
    """Returns the collision boxes of a building: its walls, and steps under its roof."""
    depth, width = building.size
    solids = [((0.0, 0.0), (depth, width), 0.0, building.height)]
    if building.roof == "flat":
        solids[0] = ((0.0, 0.0), (depth, width), 0.0, building.height + _PARAPET)
    else:
        for step in range(_ROOF_STEPS):
            low = step / _ROOF_STEPS
            solids.append(
                (
                    (0.0, 0.0),
                    _under_roof(building, low),
                    building.height + low * building.roof_height,
                    building.height + (low + 1 / _ROOF_STEPS) * building.roof_height,
                )
            )
    if building.tower is not None:
        side, height = building.tower
        middle = (_tower_x(building), 0.0)
        solids.append((middle, (side, side), 0.0, height))
        solids.append((middle, (0.6 * side, 0.6 * side), height, height + 1.6 * side))
    return tuple(_solid(building.place, *solid) for solid in solids)


def _solid(
    place: Place, middle: tuple[float, float], size: tuple[float, float], low: float, high: float
) -> Box:
    x, y, z, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    a, b = middle
    center = (x + c * a - s * b, y + s * a + c * b, z + (low + high) / 2)
    return Box(center, (*size, high - low), yaw)


def _under_roof(building: Building, share: float) -> tuple[float, float]:
    """Footprint of the roof at a share of its height, at least half a metre."""
    depth, width = building.size
    x = max(0.5, depth * (1.0 - share)) if building.roof in ("gable", "pyramid") else depth
    y = max(0.5, width * (1.0 - share)) if building.roof in ("nave", "pyramid") else width
    return x, y


def _walls(
    skin: _Skin,
    building: Building,
    size: tuple[float, float, float],
    middle: tuple[float, float],
    generator: np.random.Generator,
    *,
    bare: bool = False,
) -> None:
    """Adds four walls of bays and storeys; the front has the door."""
    depth, width, height = size
    x, y = middle
    a, b = depth / 2, width / 2
    front_left = (x + a, y - b)
    ring = (front_left, (x + a, y + b), (x - a, y + b), (x - a, y - b))
    high = building.windows == "arched" and not bare
    storeys = 1 if high else max(1, round(height / STOREY))
    usual = "wall" if bare else _usual(building)
    for side in range(4):
        start, end = ring[side], ring[(side + 1) % 4]
        bays = max(1, round(math.dist(start, end) / BAY))
        wall = np.array([(*start, 0.0), (*end, 0.0), (*end, height), (*start, height)])
        for i in range(bays):
            blind = bays > 2 and side % 2 == 1 and generator.random() < 0.2
            for k in range(storeys):
                cell = "wall" if blind else usual
                if k == 0 and side == 0 and building.windows == "none" and not bare:
                    cell = "gate" if i % 3 == bays // 2 % 3 else "wall"
                elif k == 0 and side == 0 and i == bays // 2:
                    cell = "door"
                elif k == 0 and building.shop:
                    cell = "shop"
                piece = _piece(wall, (i / bays, k / storeys), (1 / bays, 1 / storeys))
                skin.add(piece[None], cell)


def _usual(building: Building) -> str:
    """The cell that most of a building's walls show."""
    if FACADES[building.facade].pattern == "glass":
        return "glass"
    if building.windows == "plain":
        return "shutters" if building.seed % 4 == 1 else "window"
    return {"arched": "arch", "none": "wall"}[building.windows]


def _roof(skin: _Skin, building: Building, generator: np.random.Generator) -> None:
    depth, width = building.size
    height, rise = building.height, building.roof_height
    if building.roof == "flat":
        _flat_roof(skin, building, generator)
        return
    over = (depth + 2 * _EAVES, width + 2 * _EAVES)
    if building.roof == "pyramid":
        drop = rise * _EAVES / (min(depth, width) / 2)
        slopes = pyramid((0.0, 0.0, height - drop), (*over, rise + drop))
        skin.add(slopes, "roof")
        return
    across = building.roof == "nave"
    half = (width if across else depth) / 2
    drop = rise * _EAVES / half
    size = (over[1], over[0]) if across else over
    slopes, _ = gable((0.0, 0.0, height - drop), (*size, rise + drop))
    _, ends = gable((0.0, 0.0, height), ((width, depth) if across else (depth, width)) + (rise,))
    if across:
        slopes, ends = _turned(slopes), _turned(ends)
    for slope in slopes:
        skin.spread(slope, "roof")
    skin.add(ends, "wall")
    for _ in range(building.chimneys):
        # Beside the ridge, wherever that is.
        shift = float(generator.uniform(-0.35, 0.35)) * (depth if across else width)
        x, y = (shift, 0.22 * width) if across else (0.22 * depth, shift)
        top = height + rise + 0.5
        skin.add(box((x, y, (height + top) / 2), (0.7, 0.7, top - height)), "trim")


def _flat_roof(skin: _Skin, building: Building, generator: np.random.Generator) -> None:
    depth, width = building.size
    height = building.height
    a, b, top = depth / 2, width / 2, height + _PARAPET
    deck = np.array([(-a, -b, height), (a, -b, height), (a, b, height), (-a, b, height)])
    skin.spread(deck, "deck", 8.0)
    thick = 0.3
    for x, y, size in (
        (a - thick / 2, 0.0, (thick, width)),
        (-a + thick / 2, 0.0, (thick, width)),
        (0.0, b - thick / 2, (depth, thick)),
        (0.0, -b + thick / 2, (depth, thick)),
    ):
        skin.add(box((x, y, (height + top) / 2), (*size, _PARAPET)), "trim")
    for _ in range(min(4, int(depth * width / 120.0))):
        x, y = generator.uniform((-0.35 * depth, -0.35 * width), (0.35 * depth, 0.35 * width))
        skin.add(box((float(x), float(y), height + 0.5), (1.8, 1.8, 1.0)), "trim")


def _tower(
    skin: _Skin, building: Building, tower: tuple[float, float], generator: np.random.Generator
) -> None:
    side, height = tower
    x = _tower_x(building)
    # The tower of a church has a door, and no windows.
    _walls(
        skin, building, (side, side, height), (x, 0.0), generator, bare=building.windows != "plain"
    )
    skin.add(pyramid((x, 0.0, height), (side + 0.6, side + 0.6, 1.6 * side)), "roof")
    reach, middle = side / 2 + 0.03, height - 0.45 * side
    face = np.array([(reach, -1, -1), (reach, 1, -1), (reach, 1, 1), (reach, -1, 1)], float)
    face *= np.array([1.0, 0.32 * side, 0.32 * side])
    for turn in range(4):
        c, s = (1, 0, -1, 0)[turn], (0, 1, 0, -1)[turn]
        quad = face @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + np.array([x, 0.0, middle])
        skin.add(quad[None], "clock")


def _tower_x(building: Building) -> float:
    side = 0.0 if building.tower is None else building.tower[0]
    return building.size[0] / 2 + side / 2 - 0.6


def _sign(building: Building) -> TexturedQuads:
    """The name over the front, on a board that stands on the eaves."""
    depth, width = building.size
    half = min(0.42 * width, 0.45 * len(building.sign) + 0.6)
    high = min(1.6, 3.2 * half / max(4, len(building.sign)))
    x, z = depth / 2 + 0.12, building.height - (high - 0.5 if building.roof == "flat" else high)
    board = np.array([(x, -half, z), (x, half, z), (x, half, z + high), (x, -half, z + high)])
    image = sign_picture(building.sign, 64, 512, np.array(PALETTE["blue"], np.float32))
    pixels = np.clip(255.0 * image + 0.5, 0, 255).astype(np.uint8)
    # The board is the same in a mirrored world, so that its words can be read.
    quads = moved(board[None], building.place, mirrored=False)
    return TexturedQuads(quads, np.array([[(0, 1), (1, 1), (1, 0), (0, 0)]], float), pixels)


def _turned(quads: Quads) -> Quads:
    """A quarter turn to the left."""
    return np.stack((-quads[:, :, 1], quads[:, :, 0], quads[:, :, 2]), axis=2)


def _piece(
    quad: NDArray[np.float64], start: tuple[float, float], size: tuple[float, float]
) -> NDArray[np.float64]:
    """Returns a part of a quad by shares along its first and its last edge."""
    corners = []
    for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
        u, v = start[0] + s * size[0], start[1] + t * size[1]
        low = quad[0] + u * (quad[1] - quad[0])
        high = quad[3] + u * (quad[2] - quad[3])
        corners.append(low + v * (high - low))
    return np.array(corners)
