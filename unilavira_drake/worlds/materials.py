"""Materials of floors and walls: small procedural textures, the same for the same seed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message

Image = NDArray[np.float32]
"""(H, W, 3) float32 red, green, blue in [0, 1]."""

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Material(Message):
    """What a surface is made of."""

    pattern: str = "paint"
    """``paint``, ``wood``, ``tile`` or ``carpet``."""
    color: Color = (0.9, 0.9, 0.9)
    """Red, green, blue, each in [0, 1]."""
    size: float = 0.3
    """Side of a tile, width of a plank, metres."""


FLOORS: dict[str, Material] = {
    "oak": Material("wood", (0.70, 0.54, 0.36), 0.14),
    "walnut": Material("wood", (0.46, 0.31, 0.20), 0.14),
    "pine": Material("wood", (0.84, 0.70, 0.50), 0.18),
    "parquet": Material("wood", (0.62, 0.42, 0.26), 0.09),
    "white_tile": Material("tile", (0.86, 0.87, 0.86), 0.33),
    "gray_tile": Material("tile", (0.60, 0.62, 0.64), 0.45),
    "sand_tile": Material("tile", (0.80, 0.72, 0.60), 0.40),
    "blue_tile": Material("tile", (0.52, 0.66, 0.76), 0.20),
    "gray_carpet": Material("carpet", (0.50, 0.52, 0.56)),
    "beige_carpet": Material("carpet", (0.76, 0.68, 0.56)),
    "green_carpet": Material("carpet", (0.42, 0.52, 0.42)),
    "rubber": Material("carpet", (0.24, 0.26, 0.29)),
    "concrete": Material("paint", (0.66, 0.65, 0.63)),
}
"""Name -> what floors are made of."""

WALLS: dict[str, Material] = {
    "white_paint": Material("paint", (0.94, 0.94, 0.92)),
    "cream_paint": Material("paint", (0.95, 0.91, 0.81)),
    "sand_paint": Material("paint", (0.88, 0.80, 0.68)),
    "sage_paint": Material("paint", (0.76, 0.83, 0.73)),
    "sky_paint": Material("paint", (0.76, 0.85, 0.91)),
    "rose_paint": Material("paint", (0.93, 0.81, 0.78)),
    "lilac_paint": Material("paint", (0.84, 0.80, 0.90)),
    "gray_paint": Material("paint", (0.78, 0.79, 0.80)),
    "white_tiles": Material("tile", (0.92, 0.94, 0.94), 0.20),
    "brick": Material("tile", (0.68, 0.38, 0.30), 0.24),
}
"""Name -> what walls are made of."""


def texture(
    material: Material, length: float, width: float, *, pixels_per_metre: float, seed: int
) -> Image:
    """Returns a texture of a rectangle: (H, W, 3), ``length`` metres along W, ``width`` along H."""
    columns = max(8, round(length * pixels_per_metre))
    rows = max(8, round(width * pixels_per_metre))
    generator = np.random.default_rng(seed)
    shade = _PATTERNS[material.pattern](generator, rows, columns, material.size * pixels_per_metre)
    color = np.array(material.color, np.float32)
    image: Image = np.clip(shade[:, :, None] * color, 0.0, 1.0).astype(np.float32)
    return image


def _noise(
    generator: np.random.Generator, rows: int, columns: int, x_scale: float, y_scale: float
) -> NDArray[np.float32]:
    """Smooth noise of zero mean and unit deviation; scales in pixels."""
    small = generator.standard_normal(
        (max(2, round(rows / y_scale) + 2), max(2, round(columns / x_scale) + 2))
    ).astype(np.float32)
    noise: Any = cv2.resize(small, (columns, rows), interpolation=cv2.INTER_CUBIC)
    scaled: NDArray[np.float32] = (noise - noise.mean()) / (noise.std() + 1e-6)
    return scaled


def _paint(
    generator: np.random.Generator, rows: int, columns: int, size: float
) -> NDArray[np.float32]:
    return 1.0 + 0.006 * _noise(generator, rows, columns, 40, 40)


def _carpet(
    generator: np.random.Generator, rows: int, columns: int, size: float
) -> NDArray[np.float32]:
    fibres = generator.standard_normal((rows, columns)).astype(np.float32)
    return 1.0 + 0.06 * fibres + 0.03 * _noise(generator, rows, columns, 25, 25)


def _tile(
    generator: np.random.Generator, rows: int, columns: int, size: float
) -> NDArray[np.float32]:
    i = (np.arange(rows)[:, None] / size).astype(int)
    j = (np.arange(columns)[None, :] / size).astype(int)
    each = generator.normal(1.0, 0.025, (i.max() + 1, j.max() + 1)).astype(np.float32)
    shade = each[i, j] + 0.01 * _noise(generator, rows, columns, 12, 12)
    grout = max(1.0, 0.02 * size)
    joint = (np.arange(rows)[:, None] % size < grout) | (np.arange(columns)[None, :] % size < grout)
    return np.where(joint, 0.78, shade).astype(np.float32)


def _wood(
    generator: np.random.Generator, rows: int, columns: int, size: float
) -> NDArray[np.float32]:
    plank = 9.0 * size
    i = (np.arange(rows) / size).astype(int)
    shift = generator.uniform(0.0, plank, i.max() + 1)
    along = np.arange(columns)[None, :] + shift[i][:, None]
    j = (along / plank).astype(int)
    each = generator.normal(1.0, 0.06, (i.max() + 1, j.max() + 1)).astype(np.float32)
    shade = each[i[:, None], j]
    shade = shade + 0.045 * _noise(generator, rows, columns, 8.0 * size, max(1.0, size / 10))
    joint = (np.arange(rows)[:, None] % size < 1.0) | (along % plank < 1.0)
    wood: NDArray[np.float32] = np.where(joint, 0.72 * shade, shade).astype(np.float32)
    return wood


_PATTERNS = {"paint": _paint, "carpet": _carpet, "tile": _tile, "wood": _wood}
