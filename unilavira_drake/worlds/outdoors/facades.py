"""The picture of a building: sixteen cells with windows, doors, bare wall, roof and trim."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.outdoors.materials import FACADES, ROOFS

CELL = 64
"""Pixels a side of a cell; a cell of wall is one window wide and one storey high."""
GRID = 4
"""Cells in a row of the picture."""
CELLS = {
    "window": 0,
    "shutters": 1,
    "door": 2,
    "shop": 3,
    "wall": 4,
    "arch": 5,
    "clock": 6,
    "gate": 7,
    "roof": 8,
    "deck": 10,
    "glass": 12,
    "trim": 14,
}
"""Name -> cell, row by row.  From the third row on a cell is drawn twice, side by side."""
_INSET = 3.0
"""Pixels at the border of a cell that are not shown: in smaller sizes of the picture its neighbour
is mixed into them."""

Picture = NDArray[np.float32]

_GLASS = np.array((0.30, 0.38, 0.46), np.float32)
_FRAME = np.array((0.96, 0.96, 0.94), np.float32)


@functools.lru_cache(maxsize=256)
def facade_picture(facade: str, roof_color: str, seed: int) -> NDArray[np.uint8]:
    """Returns the (256, 256, 3) uint8 picture of a building."""
    generator = np.random.default_rng(seed)
    wall = _wall(facade, generator)
    roof = np.array(ROOFS[roof_color], np.float32)
    door_color = np.array(((0.30, 0.18, 0.12), (0.16, 0.30, 0.24), (0.18, 0.22, 0.38))[seed % 3])
    drawn = {
        "window": _opening(wall, 0.22, 0.20, 0.56, 0.56),
        "shutters": _shutters(wall, door_color.astype(np.float32)),
        "door": _door(wall, door_color.astype(np.float32)),
        "shop": _opening(wall, 0.06, 0.16, 0.88, 0.74),
        "wall": wall,
        "roof": _tiles(roof, generator),
        "deck": _grained(np.array((0.52, 0.52, 0.53)) * 0.5 + 0.5 * roof, 0.03, generator),
        "trim": _grained(np.array((0.80, 0.78, 0.74)), 0.01, generator),
        "arch": _arch(wall),
        "gate": _gate(wall),
        "clock": _clock(wall),
        "glass": _curtain(wall),
    }
    side = CELL * GRID
    image = np.zeros((side, side, 3), np.float32)
    for name, index in CELLS.items():
        row, column = divmod(index, GRID)
        for twin in (column, column + 1) if row >= 2 else (column,):
            image[row * CELL : (row + 1) * CELL, twin * CELL : (twin + 1) * CELL] = drawn[name]
    pixels: NDArray[np.uint8] = np.clip(255.0 * image + 0.5, 0, 255).astype(np.uint8)
    pixels.flags.writeable = False
    return pixels


def cell_uv(name: str) -> NDArray[np.float64]:
    """Returns the (4, 2) picture coordinates of a cell's corners: lower left first, then around."""
    row, column = divmod(CELLS[name], GRID)
    inset = _INSET / CELL
    left, right = (column + inset) / GRID, (column + 1 - inset) / GRID
    upper, lower = (row + inset) / GRID, (row + 1 - inset) / GRID
    return np.array([(left, lower), (right, lower), (right, upper), (left, upper)])


def _grained(color: NDArray[np.floating], grain: float, generator: np.random.Generator) -> Picture:
    noise = generator.normal(1.0, grain, (CELL, CELL, 1)) if grain else np.ones((CELL, CELL, 1))
    return np.asarray(noise * np.asarray(color), np.float32)


def _wall(facade: str, generator: np.random.Generator) -> Picture:
    material = FACADES[facade]
    color = np.array(material.color, np.float32)
    image = _grained(color, 0.015, generator)
    if material.pattern == "brick":
        for row in range(0, CELL, 4):
            image[row] *= 0.84
            image[row + 1 : row + 4, (row // 4 % 2) * 4 :: 8] *= 0.88
        image *= generator.normal(1.0, 0.03, (CELL // 4, 1, 1)).repeat(4, axis=0)
    elif material.pattern == "panel":
        image[:2] *= 0.80
        image[:, :1] *= 0.82
    elif material.pattern == "wood":
        image[::6] *= 0.75
        image *= generator.normal(1.0, 0.04, (1, CELL, 1))
    elif material.pattern == "glass":
        return _curtain(image)
    return image.astype(np.float32)


def _curtain(wall: Picture) -> Picture:
    """A wall of glass between thin posts."""
    image = np.array(wall)
    v = np.linspace(1.12, 0.92, CELL, dtype=np.float32)[:, None, None]
    image = np.asarray(np.array((0.36, 0.53, 0.74), np.float32) * v * np.ones_like(image))
    image[:4] = (0.62, 0.65, 0.68)
    image[:, :2] = image[:, CELL // 2 - 1 : CELL // 2 + 1] = (0.62, 0.65, 0.68)
    return image


def _opening(wall: Picture, left: float, top: float, width: float, height: float) -> Picture:
    """A window with a light frame, a cross and a gleam; shares of the cell."""
    image = np.array(wall)
    x0, y0 = round(left * CELL), round(top * CELL)
    x1, y1 = round((left + width) * CELL), round((top + height) * CELL)
    image[y0 - 2 : y1 + 3, x0 - 2 : x1 + 2] = _FRAME
    v = np.linspace(1.35, 0.85, y1 - y0, dtype=np.float32)[:, None, None]
    image[y0:y1, x0:x1] = _GLASS * v
    middle = (x0 + x1) // 2
    image[y0:y1, middle - 1 : middle + 1] = _FRAME
    image[y0 + (y1 - y0) // 3, x0:x1] = _FRAME
    image[y1 + 2 : y1 + 4, x0 - 3 : x1 + 3] *= 0.75
    return image


def _shutters(wall: Picture, color: NDArray[np.float32]) -> Picture:
    image = _opening(wall, 0.30, 0.20, 0.40, 0.56)
    for x0 in (round(0.13 * CELL), round(0.72 * CELL)):
        image[round(0.2 * CELL) - 2 : round(0.76 * CELL) + 2, x0 : x0 + round(0.15 * CELL)] = (
            0.6 * color + 0.2
        )
    return image


def _door(wall: Picture, color: NDArray[np.float32]) -> Picture:
    image = np.array(wall)
    x0, x1, y0 = round(0.30 * CELL), round(0.70 * CELL), round(0.24 * CELL)
    image[y0 - 4 :, x0 - 3 : x1 + 3] = _FRAME
    image[y0:, x0:x1] = color
    image[y0 + 4 : y0 + 14, x0 + 4 : x1 - 4] = _GLASS
    return image


def _arch(wall: Picture) -> Picture:
    """A pointed window that is as high as the wall."""
    image = np.array(wall)
    top, bottom, half = round(0.12 * CELL), round(0.82 * CELL), round(0.15 * CELL)
    for shrink, color in ((0, (0.74, 0.72, 0.68)), (3, (0.24, 0.26, 0.40))):
        x0, x1 = CELL // 2 - half + shrink, CELL // 2 + half - shrink
        outline = [(x0, bottom - shrink), (x1, bottom - shrink), (x1, top + 12), (CELL // 2, top)]
        points: Any = np.array([*outline, (x0, top + 12)], np.int32)
        cv2.fillPoly(image, [points + np.array([0, shrink])], color, cv2.LINE_AA)
    image[top + 4 : bottom - 3, CELL // 2] = (0.74, 0.72, 0.68)
    return image


def _gate(wall: Picture) -> Picture:
    """A roller door."""
    image = np.array(wall)
    x0, x1, y0 = round(0.08 * CELL), round(0.92 * CELL), round(0.14 * CELL)
    image[y0:, x0:x1] = (0.70, 0.72, 0.74)
    image[y0::5, x0:x1] = (0.54, 0.56, 0.58)
    return image


def _tiles(color: NDArray[np.float32], generator: np.random.Generator) -> Picture:
    image = _grained(color, 0.05, generator)
    image[::8] *= 0.76
    image[1::8] *= 0.9
    for row in range(0, CELL, 8):
        image[row : row + 8, (row // 8 % 2) * 4 :: 8] *= 0.90
    return image


def _clock(wall: Picture) -> Picture:
    image = np.array(wall)
    middle = (CELL // 2, CELL // 2)
    cv2.circle(image, middle, 24, (0.97, 0.96, 0.92), -1, cv2.LINE_AA)
    cv2.circle(image, middle, 24, (0.12, 0.12, 0.14), 2, cv2.LINE_AA)
    cv2.line(image, middle, (CELL // 2, CELL // 2 - 18), (0.1, 0.1, 0.1), 2, cv2.LINE_AA)
    cv2.line(image, middle, (CELL // 2 + 12, CELL // 2 + 6), (0.1, 0.1, 0.1), 2, cv2.LINE_AA)
    return image
