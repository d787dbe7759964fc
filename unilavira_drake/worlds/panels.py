"""Flat things with a picture on them: windows, paintings, mirrors, whiteboards, signs and rugs."""

from __future__ import annotations

import math
import zlib
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.schema import PanelEntry
from unilavira_drake.worlds.signs import sign_picture
from unilavira_drake.worlds.world import Box, Panel, Room

DEPTH = 0.04
"""Thickness of what hangs on a wall, metres."""
PILE = 0.012
"""Thickness of a rug, metres."""
DETAIL = 160.0
"""Pixels a metre of the picture."""
SIGN_DETAIL = 320.0
"""The same of a sign: its words are read from across a room."""

Picture = NDArray[np.float32]


def panel(
    entry: PanelEntry,
    room: Room,
    position: tuple[float, float],
    size: tuple[float, float],
    thickness: float,
) -> Panel:
    """Returns the panel of an entry: a rug where it lies, anything else on the nearest wall."""
    x, y = position
    width, height = size
    seed = zlib.crc32(entry.name.encode())
    if entry.category == "rug":
        box = Box((x, y, PILE / 2), (width, height, PILE))
        return Panel("rug", entry.color, box, None, seed)
    x_min, y_min, x_max, y_max = room.rectangle
    inset = (thickness + DEPTH) / 2 + 1e-3
    # Distance to each wall, the panel's middle there, and the direction into the room.
    walls = (
        (x - x_min, (x_min + inset, y), 0.0),
        (x_max - x, (x_max - inset, y), math.pi),
        (y - y_min, (x, y_min + inset), math.pi / 2),
        (y_max - y, (x, y_max - inset), -math.pi / 2),
    )
    _, middle, facing = min(walls, key=lambda wall: wall[0])
    box = Box((*middle, entry.height + height / 2), (DEPTH, width, height), facing)
    return Panel(entry.category, entry.color, box, facing, seed, entry.text)


def panel_quads(thing: Panel) -> list[TexturedQuads]:
    """Returns the picture and the edges of a panel."""
    box = thing.box
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) * np.array(box.size)[:, None] / 2
    length, width, up = axes
    middle = np.array(box.center)
    if thing.facing is None:
        size = (box.size[0], box.size[1])
        face = [middle + up + a * length + b * width for a, b in _LOOP]
    else:
        size = (box.size[1], box.size[2])
        face = [middle + length + a * width + b * up for a, b in _LOOP]
    detail = SIGN_DETAIL if thing.text else DETAIL
    columns, rows = (max(16, round(side * detail)) for side in size)
    color = np.array(PALETTE[thing.color], np.float32)
    if thing.text:
        image = sign_picture(thing.text, rows, columns, color)
    else:
        image = PATTERNS[thing.pattern](np.random.default_rng(thing.seed), rows, columns, color)
    uv = np.array([[(0, 1), (1, 1), (1, 0), (0, 0)]], float)
    front = TexturedQuads(np.array([face]), uv, _bytes(image))
    edge = _bytes(np.broadcast_to(image[0, 0], (4, 4, 3)))
    sides = _edges(middle, length, width, up, flat=thing.facing is None)
    return [front, TexturedQuads(sides, np.repeat(uv, len(sides), axis=0), edge)]


_LOOP = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def _edges(
    middle: NDArray[np.float64],
    length: NDArray[np.float64],
    width: NDArray[np.float64],
    up: NDArray[np.float64],
    *,
    flat: bool,
) -> NDArray[np.float64]:
    """Returns the four narrow faces around the picture."""
    front, a, b = (up, length, width) if flat else (length, width, up)
    quads = []
    for side, along in ((a, b), (-a, -b), (b, -a), (-b, a)):
        quads.append(
            [
                middle + side + sign * along + depth * front
                for sign, depth in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
        )
    return np.array(quads)


def _window(generator: np.random.Generator, rows: int, columns: int, color: Picture) -> Picture:
    """Sky above a far line of green, behind a cross of frame."""
    v = np.linspace(0.0, 1.0, rows, dtype=np.float32)[:, None, None]
    sky = (1 - v) * np.array([0.55, 0.75, 0.97]) + v * np.array([0.88, 0.95, 1.0])
    image = np.repeat(sky, columns, axis=1)
    hills = 0.68 + 0.05 * np.interp(
        np.arange(columns), np.linspace(0, columns, 9), generator.standard_normal(9)
    )
    below = np.arange(rows)[:, None] / rows > hills[None, :]
    shade = generator.normal(1.0, 0.06, (rows, columns, 1))
    image = np.where(below[:, :, None], np.array([0.42, 0.60, 0.34]) * shade, image)
    return _framed(image, (0.95, 0.95, 0.94), 0.055, cross=True)


def _picture(generator: np.random.Generator, rows: int, columns: int, color: Picture) -> Picture:
    """An abstract painting whose leading colour is the one asked for."""
    image = np.full((rows, columns, 3), 0.93, np.float32)
    for i in range(14):
        shade = color if i % 3 else generator.uniform(0.1, 0.95, 3).astype(np.float32)
        center = (int(generator.uniform(0, columns)), int(generator.uniform(0, rows)))
        axes = (
            int(generator.uniform(0.10, 0.45) * columns),
            int(generator.uniform(0.10, 0.35) * rows),
        )
        angle = float(generator.uniform(0, 180))
        cv2.ellipse(image, center, axes, angle, 0, 360, shade.tolist(), -1, cv2.LINE_AA)
    return _framed(image, (0.20, 0.14, 0.10), 0.03)


def _mirror(generator: np.random.Generator, rows: int, columns: int, color: Picture) -> Picture:
    """Bright glass with a slanting gleam; it reflects nothing."""
    u = np.linspace(0, 1, columns)[None, :, None]
    v = np.linspace(0, 1, rows)[:, None, None]
    gleam = 0.06 * np.exp(-(((u + v - 0.8) / 0.1) ** 2)) + 0.04 * np.exp(
        -(((u + v - 1.1) / 0.05) ** 2)
    )
    image = np.array([0.74, 0.82, 0.85]) + gleam - 0.06 * v
    return _framed(np.asarray(image, np.float32), tuple(color.tolist()), 0.03)


def _whiteboard(generator: np.random.Generator, rows: int, columns: int, color: Picture) -> Picture:
    """Lines of writing on white."""
    image = np.full((rows, columns, 3), 0.96, np.float32)
    for row in range(int(0.15 * rows), int(0.8 * rows), max(4, rows // 9)):
        end = int(generator.uniform(0.35, 0.85) * columns)
        x = np.arange(int(0.08 * columns), end, 2)
        y = row + 0.012 * rows * np.cumsum(generator.choice((-1, 0, 1), len(x)))
        y = np.clip(y, row - 0.03 * rows, row + 0.03 * rows)
        line: Any = np.stack((x, y), axis=1).astype(np.int32)
        cv2.polylines(image, [line], False, (0.15, 0.25, 0.60), 2, cv2.LINE_AA)
    return _framed(image, (0.55, 0.56, 0.58), 0.02)


def _rug(generator: np.random.Generator, rows: int, columns: int, color: Picture) -> Picture:
    """A border and lozenges in the colour asked for, with a woven grain."""
    light = np.clip(0.45 * color + 0.5, 0, 1)
    v = np.abs(np.arange(rows) - rows / 2)[:, None] / (rows / 2)
    u = np.abs(np.arange(columns) - columns / 2)[None, :] / (columns / 2)
    edge = np.maximum(u, v)
    band = ((edge > 0.80) & (edge < 0.88)) | ((u + v) % 0.5 < 0.07) & (edge < 0.72)
    image = np.where(band[:, :, None], light, color)
    grain = generator.normal(1.0, 0.05, (rows, columns, 1))
    return np.clip(image * grain, 0, 1).astype(np.float32)


def _framed(
    image: Picture, color: tuple[float, ...], share: float, *, cross: bool = False
) -> Picture:
    framed = np.array(image, np.float32)
    rows, columns = framed.shape[:2]
    side = max(2, round(share * min(rows, columns)))
    framed[:side] = framed[-side:] = color
    framed[:, :side] = framed[:, -side:] = color
    if cross:
        half = max(1, side // 2)
        middle = columns // 2
        framed[:, middle - half : middle + half] = color
        framed[rows // 3 - half : rows // 3 + half] = color
    return framed


PATTERNS = {
    "window": _window,
    "picture": _picture,
    "mirror": _mirror,
    "whiteboard": _whiteboard,
    "rug": _rug,
}
"""Category -> what is drawn; a ``SIGN`` shows its text instead."""

SIGN = "sign"


def _bytes(image: NDArray[Any]) -> NDArray[np.uint8]:
    return np.clip(255.0 * image + 0.5, 0, 255).astype(np.uint8)
