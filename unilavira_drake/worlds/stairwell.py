"""What is built around stairs: steps, railings, the slab above and the opening in it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.materials import FLOORS, texture
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.stairs import Rectangle, Stairs
from unilavira_drake.worlds.world import Box, Room

RAIL_HEIGHT = 0.9
"""Of a handrail above the floor or the treads, metres."""
RAIL_WIDTH = 0.05
POST = 0.03
"""Side of a baluster, metres."""
SPACING = 0.28
"""Between balusters, metres; nobody falls through."""
TREAD_DETAIL = 100.0
"""Pixels a metre."""


def pieces(rectangle: Rectangle, holes: Iterable[Rectangle]) -> tuple[Rectangle, ...]:
    """Returns rectangles that cover a rectangle but for the holes, in a fixed order."""
    parts = [rectangle]
    for hole in holes:
        parts = [piece for part in parts for piece in _without(part, hole)]
    return tuple(parts)


def _without(part: Rectangle, hole: Rectangle) -> list[Rectangle]:
    x_min, y_min, x_max, y_max = part
    a, b = max(hole[0], x_min), max(hole[1], y_min)
    c, d = min(hole[2], x_max), min(hole[3], y_max)
    if a >= c or b >= d:
        return [part]
    cut = [
        (x_min, y_min, x_max, b),
        (x_min, d, x_max, y_max),
        (x_min, b, a, d),
        (c, b, x_max, d),
    ]
    return [piece for piece in cut if piece[0] < piece[2] and piece[1] < piece[3]]


def step_boxes(stairs: Stairs) -> tuple[Box, ...]:
    """Returns one box for each step, from the floor to its tread."""
    boxes = []
    for begin, end, height in stairs.treads():
        x, y = stairs.point((begin + end) / 2)
        rise = height - stairs.bottom
        boxes.append(
            _box(stairs, (x, y, stairs.bottom + rise / 2), end - begin, stairs.width, rise)
        )
    return tuple(boxes)


def railing_boxes(stairs: Stairs, below: Room, above: Room, gap: float) -> tuple[Box, ...]:
    """Returns balusters and handrails along the flight and around the opening above.

    A side along a wall of the room has none.

    Args:
        stairs: the flight.
        below: room where it begins.
        above: room to which it leads.
        gap: a wall nearer than this is beside the flight, metres.
    """
    boxes: list[Box] = []
    for sign in (1.0, -1.0):
        across = sign * (stairs.width - RAIL_WIDTH) / 2
        if not _at_wall(stairs.point(stairs.length / 2, across), below, gap + RAIL_WIDTH):
            for begin, end, height in stairs.treads()[:-1]:
                middle = stairs.point((begin + end) / 2, across)
                boxes += _balusters(stairs, middle, end - begin, height, along=True)
        if not _at_wall(stairs.point(stairs.length / 2, across), above, gap + RAIL_WIDTH):
            outside = stairs.point(stairs.length / 2, sign * (stairs.width + RAIL_WIDTH) / 2)
            boxes += _balusters(stairs, outside, stairs.length, stairs.top, along=True)
    if not _at_wall(stairs.foot, above, gap + RAIL_WIDTH):
        outside = stairs.point(-RAIL_WIDTH / 2)
        length = stairs.width + 2 * RAIL_WIDTH
        boxes += _balusters(stairs, outside, length, stairs.top, along=False)
    return tuple(boxes)


def opening_boxes(stairs: Stairs) -> tuple[Box, ...]:
    """Returns what nobody may enter from the floor above but over the last tread: the opening."""
    first, last = 0.0, stairs.length - stairs.tread
    x, y = stairs.point((first + last) / 2)
    return (_box(stairs, (x, y, stairs.top + 0.5), last - first, stairs.width, 1.0),)


def slabs(rooms: Sequence[Room], stairs: Sequence[Stairs], wall_height: float) -> tuple[Box, ...]:
    """Returns the floors of the rooms that are not on the lowest storey, as boxes."""
    elevations = sorted({room.elevation for room in rooms})
    boxes = []
    for room in rooms:
        lower = [height for height in elevations if height < room.elevation]
        if not lower:
            continue
        low, high = lower[-1] + wall_height, room.elevation
        for a, b, c, d in pieces(room.rectangle, floor_holes(room, stairs)):
            center = ((a + c) / 2, (b + d) / 2, (low + high) / 2)
            boxes.append(Box(center, (c - a, d - b, high - low)))
    return tuple(boxes)


def floor_holes(room: Room, stairs: Iterable[Stairs]) -> tuple[Rectangle, ...]:
    """Returns the openings in the floor of a room."""
    return tuple(one.rectangle for one in stairs if one.top == room.elevation)


def ceiling_holes(room: Room, stairs: Iterable[Stairs]) -> tuple[Rectangle, ...]:
    """Returns the openings in the ceiling of a room."""
    return tuple(one.rectangle for one in stairs if one.bottom == room.elevation)


def edge_boxes(stairs: Stairs, wall_height: float) -> tuple[Box, ...]:
    """Returns the edges of the slab around an opening, thin boxes just outside of it."""
    low, high, thin = stairs.bottom + wall_height, stairs.top, 0.02
    z, tall = (low + high) / 2, high - low - 2e-3
    ends = (stairs.point(-thin / 2), stairs.point(stairs.length + thin / 2))
    sides = (stairs.point(stairs.length / 2, s * (stairs.width + thin) / 2) for s in (1, -1))
    return (
        *(_box(stairs, (x, y, z), thin, stairs.width, tall) for x, y in ends),
        *(_box(stairs, (x, y, z), stairs.length, thin, tall) for x, y in sides),
    )


def stair_quads(stairs: Stairs) -> list[TexturedQuads]:
    """Returns the treads in their material, and risers and sides in the plain colour."""
    unit_uv = [(0, 1), (1, 1), (1, 0), (0, 0)]
    tops, risers, plain = [], [], []
    low, half = stairs.bottom, stairs.width / 2
    before = low
    for begin, end, height in stairs.treads():
        corners = [stairs.point(s, a) for s, a in ((begin, half), (begin, -half))]
        far = [stairs.point(s, a) for s, a in ((end, -half), (end, half))]
        tops.append([(*p, height) for p in (*corners, *far)])
        (left, right), (far_right, far_left) = corners, far
        risers.append([(*left, before), (*right, before), (*right, height), (*left, height)])
        plain.append([(*right, low), (*far_right, low), (*far_right, height), (*right, height)])
        plain.append([(*far_left, low), (*left, low), (*left, height), (*far_left, height)])
        before = height
    right, left = stairs.point(stairs.length, -half), stairs.point(stairs.length, half)
    plain.append([(*right, low), (*left, low), (*left, stairs.top), (*right, stairs.top)])
    wood = texture(
        FLOORS[stairs.material],
        stairs.width,
        stairs.tread,
        pixels_per_metre=TREAD_DETAIL,
        seed=len(stairs.name),
    )
    image = np.clip(255.0 * wood + 0.5, 0, 255).astype(np.uint8)
    color = np.full((4, 4, 3), np.round(255 * np.array(PALETTE[stairs.color])), np.uint8)
    # A dark nosing tells a step from the next one, also from below the eye.
    front = np.repeat(color[:1, :1], 16, axis=0)
    front[:4] = image.mean(axis=(0, 1)) * 0.7
    return [
        TexturedQuads(np.array(tops, float), np.array([unit_uv] * len(tops), float), image),
        TexturedQuads(np.array(risers, float), np.array([unit_uv] * len(risers), float), front),
        TexturedQuads(np.array(plain, float), np.full((len(plain), 4, 2), 0.5), color),
    ]


def _balusters(
    stairs: Stairs, middle: tuple[float, float], length: float, floor: float, *, along: bool
) -> list[Box]:
    """Returns a handrail and the balusters under it; ``along`` the way up or across it."""
    yaw = stairs.heading + (0.0 if along else math.pi / 2)
    c, q = round(math.cos(yaw)), round(math.sin(yaw))
    rail = _box(stairs, (*middle, floor + RAIL_HEIGHT), length, RAIL_WIDTH, 0.05, along=along)
    count = max(1, math.ceil(length / SPACING - 1e-9))
    step = length / count
    boxes = [rail]
    tall = RAIL_HEIGHT - 0.025
    for index in range(count):
        s = (index + 0.5) * step - length / 2
        x, y = middle[0] + c * s, middle[1] + q * s
        boxes.append(_box(stairs, (x, y, floor + tall / 2), POST, POST, tall))
    return boxes


def _box(
    stairs: Stairs,
    center: tuple[float, float, float],
    length: float,
    width: float,
    height: float,
    *,
    along: bool = True,
) -> Box:
    """Returns a box square to the axes, ``length`` along the way up, or across it."""
    along_x = (abs(math.cos(stairs.heading)) > 0.5) == along
    size = (length, width, height) if along_x else (width, length, height)
    return Box(center, size)


def _at_wall(point: tuple[float, float], room: Room, gap: float) -> bool:
    x_min, y_min, x_max, y_max = room.rectangle
    x, y = point
    return min(x - x_min, x_max - x, y - y_min, y_max - y) <= gap
