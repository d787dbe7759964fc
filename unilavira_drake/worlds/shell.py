"""The inside of a room: textured floor, walls and ceiling with soft shadows."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.materials import FLOORS, WALLS, Image, Material, texture
from unilavira_drake.worlds.shadows import edge_shade, floor_shade, wall_shade
from unilavira_drake.worlds.stairs import Rectangle
from unilavira_drake.worlds.stairwell import pieces
from unilavira_drake.worlds.structure import DOOR_HEIGHT
from unilavira_drake.worlds.world import JAMB_WIDTH, Box, Doorway, Room

LARGEST_SIDE = 1024
"""Pixels of a texture's longer side at most."""
FLOOR_DETAIL = 100.0
WALL_DETAIL = 64.0
"""Pixels a metre."""
SKIRTING = 0.09
"""Height of the skirting board, metres."""
SKIRTING_COLOR = (0.95, 0.94, 0.91)
CEILING_COLOR = (0.97, 0.97, 0.95)


@dataclass(frozen=True)
class _Side:
    """One wall of a room seen from inside: from ``start`` to ``end``, left to right."""

    start: tuple[float, float]
    end: tuple[float, float]
    openings: tuple[tuple[float, float, bool], ...]
    """Stretch from the start that each doorway takes, metres, and whether it has no lintel."""

    @property
    def length(self) -> float:
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))


def floor(room: Room, boxes: Sequence[Box], holes: Sequence[Rectangle] = ()) -> TexturedQuads:
    """Returns the floor of a room whose material is named, shaded around things, but for holes."""
    x_min, y_min, x_max, y_max = room.rectangle
    detail = _detail(FLOOR_DETAIL, x_max - x_min, y_max - y_min)
    image = texture(
        FLOORS[room.floor],
        x_max - x_min,
        y_max - y_min,
        pixels_per_metre=detail,
        seed=_seed(room.name, "floor"),
    )
    rows, columns = image.shape[:2]
    shade = edge_shade(rows, columns, detail, depth=0.30)
    shade = shade * floor_shade(boxes, room.rectangle, rows, columns, detail)
    corners, uv = _level(room.rectangle, holes, 0.0)
    return TexturedQuads(corners, uv, _bytes(image, shade))


def ceiling(room: Room, height: float, holes: Sequence[Rectangle] = ()) -> TexturedQuads:
    """Returns the ceiling of a room, brighter in the middle, but for holes."""
    x_min, y_min, x_max, y_max = room.rectangle
    detail = _detail(16.0, x_max - x_min, y_max - y_min)
    material = Material("paint", CEILING_COLOR)
    image = texture(
        material,
        x_max - x_min,
        y_max - y_min,
        pixels_per_metre=detail,
        seed=_seed(room.name, "ceiling"),
    )
    rows, columns = image.shape[:2]
    shade = edge_shade(rows, columns, detail, depth=0.18)
    corners, uv = _level(room.rectangle, holes, height)
    turned = [3, 2, 1, 0]  # seen from below
    return TexturedQuads(corners[:, turned], uv[:, turned], _bytes(image, shade))


def _level(
    rectangle: Rectangle, holes: Sequence[Rectangle], z: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns corners, counter-clockwise from above, and uv of a rectangle but for holes."""
    x_min, y_min, x_max, y_max = rectangle
    corners, uv = [], []
    for a, b, c, d in pieces(rectangle, holes):
        points = ((a, b), (c, b), (c, d), (a, d))
        corners.append([(x, y, z) for x, y in points])
        uv.append(
            [((x - x_min) / (x_max - x_min), (y_max - y) / (y_max - y_min)) for x, y in points]
        )
    return np.array(corners, float), np.array(uv, float)


def walls(
    room: Room, doorways: Sequence[Doorway], boxes: Sequence[Box], height: float, thickness: float
) -> list[TexturedQuads]:
    """Returns the four walls of a room seen from inside, with the doorways left out."""
    quads = []
    for index, side in enumerate(_sides(room, doorways, thickness)):
        detail = _detail(WALL_DETAIL, side.length, height)
        image = texture(
            WALLS[room.walls],
            side.length,
            height,
            pixels_per_metre=detail,
            seed=_seed(room.name, f"wall {index}"),
        )
        rows, columns = image.shape[:2]
        shade = edge_shade(rows, columns, detail, depth=0.16)
        shade = shade * wall_shade(boxes, side.start, side.end, rows, columns, detail)
        board = max(1, round(SKIRTING * detail))
        image[-board:] = SKIRTING_COLOR
        image[-board - 1] *= 0.8
        corners, uv = _strips(side, height)
        quads.append(TexturedQuads(corners, uv, _bytes(image, shade)))
    return quads


def _sides(room: Room, doorways: Sequence[Doorway], thickness: float) -> list[_Side]:
    inset = thickness / 2
    x_min, y_min, x_max, y_max = room.rectangle
    left, bottom, right, top = x_min + inset, y_min + inset, x_max - inset, y_max - inset
    # Left to right as seen from inside: the south wall is seen looking south.
    corners = ((right, bottom), (left, bottom), (left, top), (right, top))
    along_x = (True, False, True, False)
    offsets = (y_min, x_min, y_max, x_max)
    sides = []
    for i in range(4):
        start, end = corners[i], corners[(i + 1) % 4]
        axis = 0 if along_x[i] else 1
        openings = []
        for opening in doorways:
            place = (opening.x, opening.y)
            if opening.along_x != along_x[i] or abs(place[1 - axis] - offsets[i]) > 1e-6:
                continue
            middle = abs(place[axis] - start[axis])
            inside = min(start[axis], end[axis]) < place[axis] < max(start[axis], end[axis])
            if inside:
                openings.append((middle - opening.gap, middle + opening.gap, opening.open))
        sides.append(_Side(start, end, tuple(sorted(openings))))
    return sides


def _strips(side: _Side, height: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns corners and uv of a wall cut at its doorways, with the lintels above them."""
    head = DOOR_HEIGHT + JAMB_WIDTH
    parts = []
    cursor = 0.0
    for low, high, is_open in side.openings:
        parts.append((cursor, low, 0.0))
        if not is_open:
            parts.append((low, high, head))
        cursor = high
    parts.append((cursor, side.length, 0.0))
    start, end = np.array(side.start), np.array(side.end)
    corners, uv = [], []
    for s0, s1, z0 in parts:
        if s1 - s0 < 1e-6:
            continue
        a, b = (start + (end - start) * s / side.length for s in (s0, s1))
        corners.append([(*a, z0), (*b, z0), (*b, height), (*a, height)])
        u0, u1, v0 = s0 / side.length, s1 / side.length, 1.0 - z0 / height
        uv.append([(u0, v0), (u1, v0), (u1, 0.0), (u0, 0.0)])
    return np.array(corners, float), np.array(uv, float)


def _detail(wanted: float, length: float, width: float) -> float:
    return min(wanted, LARGEST_SIDE / max(length, width))


def _seed(*names: str) -> int:
    return zlib.crc32("/".join(names).encode())


def _bytes(image: Image, shade: NDArray[np.float32]) -> NDArray[np.uint8]:
    shaded: NDArray[np.uint8] = np.clip(255.0 * image * shade[:, :, None] + 0.5, 0, 255).astype(
        np.uint8
    )
    return shaded
