"""Colour words of pixels.

A fixed partition of hue, saturation and value into the basic colour terms of English (Berlin and
Kay, 1969, with cyan for the blue-greens), wide enough in value that shading does not change the
word.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

COLOR_WORDS = (
    "red",
    "orange",
    "yellow",
    "green",
    "cyan",
    "blue",
    "purple",
    "pink",
    "brown",
    "white",
    "gray",
    "black",
)

_INDEX = {word: i for i, word in enumerate(COLOR_WORDS)}

# Upper end of each hue's sector, degrees; red closes the circle.
_HUES = (
    (13.0, "red"),
    (42.0, "orange"),
    (70.0, "yellow"),
    (165.0, "green"),
    (200.0, "cyan"),
    (255.0, "blue"),
    (305.0, "purple"),
    (345.0, "pink"),
    (360.0, "red"),
)
_BLACK_VALUE = 0.20
_WHITE_VALUE = 0.66
_GRAY_SATURATION = 0.20
_PINK_SATURATION = 0.60
_PINK_VALUE = 0.60
_BROWN_VALUE = 0.62
_BROWN_SATURATION = 0.55


def color_indices(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns the index into ``COLOR_WORDS`` of each pixel.

    Args:
        rgb: (..., 3) uint8.

    Returns:
        (...) uint8.
    """
    hue, saturation, value = _hsv(np.asarray(rgb, dtype=np.float64) / 255.0)
    words = np.array([_INDEX[word] for _, word in _HUES], dtype=np.uint8)
    limits = np.array([limit for limit, _ in _HUES])
    index: NDArray[np.uint8] = words[
        np.searchsorted(limits, hue, side="right").clip(max=len(words) - 1)
    ]
    pale_red = (index == _INDEX["red"]) & (saturation < _PINK_SATURATION) & (value > _PINK_VALUE)
    index[pale_red] = _INDEX["pink"]
    dull = (value < _BROWN_VALUE) | (saturation < _BROWN_SATURATION)
    index[(index == _INDEX["orange"]) & dull] = _INDEX["brown"]
    index[(index == _INDEX["pink"]) & (value < _PINK_VALUE)] = _INDEX["purple"]
    index[saturation < _GRAY_SATURATION] = _INDEX["gray"]
    index[(saturation < _GRAY_SATURATION) & (value > _WHITE_VALUE)] = _INDEX["white"]
    index[value < _BLACK_VALUE] = _INDEX["black"]
    return index


def color_word(rgb: tuple[float, float, float]) -> str:
    """Returns the word of one colour given as red, green, blue in [0, 1]."""
    pixel = np.round(np.clip(rgb, 0.0, 1.0) * np.float64(255)).astype(np.uint8)
    return COLOR_WORDS[int(color_indices(pixel[np.newaxis])[0])]


@lru_cache(maxsize=1)
def color_table() -> NDArray[np.uint8]:
    """Returns the (32768,) table of indices for colours cut to five bits a channel.

    The entry of red, green, blue is ``(r >> 3) << 10 | (g >> 3) << 5 | (b >> 3)``.
    """
    cells = np.arange(32 * 32 * 32)
    rgb = np.stack((cells >> 10, (cells >> 5) & 31, cells & 31), axis=-1) * 8 + 4
    table = color_indices(rgb.astype(np.uint8))
    table.flags.writeable = False
    return table


def _hsv(
    rgb: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Returns hue in degrees, and saturation and value in [0, 1]."""
    value = rgb.max(axis=-1)
    chroma = value - rgb.min(axis=-1)
    safe = np.where(chroma > 0.0, chroma, 1.0)
    red, green, blue = (rgb[..., i] for i in range(3))
    sector = np.where(
        value == red,
        ((green - blue) / safe) % 6.0,
        np.where(value == green, (blue - red) / safe + 2.0, (red - green) / safe + 4.0),
    )
    hue = np.where(chroma > 0.0, 60.0 * sector, 0.0)
    saturation = np.where(value > 0.0, chroma / np.where(value > 0.0, value, 1.0), 0.0)
    return hue, saturation, value
