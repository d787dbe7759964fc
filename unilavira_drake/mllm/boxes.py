"""The ways in which models write places in a picture, and pixels.

Each family of models was trained on one convention and keeps to it whatever the prompt says, so
the convention is data of the model.  Pixels here are floats of the picture as the robot has it: u
from 0 at the left edge to ``width`` at the right one, v from 0 at the top to ``height`` below.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

Box = tuple[float, float, float, float]
Point = tuple[float, float]

GRID = 1000
"""Last line of the normalised grids, on both axes."""
PATCH = 28
"""Qwen2.5-VL sees pictures in squares of this many pixels (patches of 14, merged 2 by 2)."""
MIN_PIXELS = 56 * 56
"""Smallest area that Qwen2.5-VL's processor leaves a picture by default."""
MAX_PIXELS = 14 * 14 * 4 * 1280
"""Largest one: 1,280 image tokens.  A server with other limits needs pictures between the two."""


@dataclass(frozen=True)
class BoxSpace:
    """One convention: the units of each axis, and whether u or v comes first."""

    name: str
    families: str
    """Which models write so."""
    size: Callable[[int, int], tuple[int, int]]
    """From a picture's width and height in pixels to both in this space's units."""
    v_first: bool = False
    is_grid: bool = False
    """Whether the units are those of a grid, the same for each picture, instead of pixels."""

    @property
    def box_order(self) -> str:
        """The order of a box's four numbers, in the words of the prompt."""
        return "[v_min, u_min, v_max, u_max]" if self.v_first else "[u_min, v_min, u_max, v_max]"

    @property
    def point_order(self) -> str:
        """The order of a point's two numbers, in the words of the prompt."""
        return "[v, u]" if self.v_first else "[u, v]"

    def extent(self, width: int, height: int) -> str:
        """Returns in words which numbers exist, e.g. for ``must be ...``."""
        if self.is_grid:
            return f"on a grid from 0 to {GRID} over the picture's width and height"
        columns, rows = self.size(width, height)
        return f"in pixels of the picture, which is {columns} wide and {rows} high"

    def rule(self, width: int, height: int) -> str:
        """Returns the sentences of the prompt that tell a model how to write box and point.

        A grid is told without the picture's size: told both, models mix them.
        """
        return (
            f"box is {self.box_order} and point is {self.point_order}, "
            f"{self.extent(width, height)}. u counts to the right from the left edge, v counts "
            "down from the top edge."
        )

    def to_pixels_box(self, box: Sequence[float], width: int, height: int) -> Box:
        """Returns (u_min, v_min, u_max, v_max) in pixels; checks nothing."""
        return (
            *self.to_pixels_point(box[:2], width, height),
            *self.to_pixels_point(box[2:], width, height),
        )

    def to_pixels_point(self, point: Sequence[float], width: int, height: int) -> Point:
        """Returns (u, v) in pixels; checks nothing."""
        u, v = self.uv(point)
        columns, rows = self.size(width, height)
        return u * (width / columns), v * (height / rows)

    def from_pixels_box(self, box: Sequence[float], width: int, height: int) -> Box:
        """Returns a box in pixels as a model of this space writes it."""
        return (
            *self.from_pixels_point(box[:2], width, height),
            *self.from_pixels_point(box[2:], width, height),
        )

    def from_pixels_point(self, point: Sequence[float], width: int, height: int) -> Point:
        """Returns a point in pixels as a model of this space writes it."""
        columns, rows = self.size(width, height)
        u, v = point[0] * (columns / width), point[1] * (rows / height)
        return (v, u) if self.v_first else (u, v)

    def uv(self, pair: Sequence[float]) -> Point:
        """Returns two numbers of a reply as (u, v), in this space's units."""
        return (pair[1], pair[0]) if self.v_first else (pair[0], pair[1])


def resized(width: int, height: int) -> tuple[int, int]:
    """Returns the size at which Qwen2.5-VL sees a picture, by its processor's published rule.

    Each side goes to the nearest multiple of 28; if the area is then outside ``MIN_PIXELS`` to
    ``MAX_PIXELS``, both sides are scaled alike and rounded back into it.
    """
    columns, rows = (max(PATCH, round(side / PATCH) * PATCH) for side in (width, height))
    if columns * rows > MAX_PIXELS:
        scale = math.sqrt(width * height / MAX_PIXELS)
        columns, rows = (
            max(PATCH, math.floor(side / scale / PATCH) * PATCH) for side in (width, height)
        )
    elif columns * rows < MIN_PIXELS:
        scale = math.sqrt(MIN_PIXELS / (width * height))
        columns, rows = (math.ceil(side * scale / PATCH) * PATCH for side in (width, height))
    return columns, rows


def _as_it_is(width: int, height: int) -> tuple[int, int]:
    return width, height


def _grid(width: int, height: int) -> tuple[int, int]:
    return GRID, GRID


BOX_SPACES: dict[str, BoxSpace] = {
    space.name: space
    for space in (
        BoxSpace("pixels", "rules, random, frontier; people", _as_it_is),
        BoxSpace("xyxy_1000", "Qwen2-VL, Qwen3-VL, Qwen3.5", _grid, is_grid=True),
        BoxSpace("yxyx_1000", "Gemini", _grid, v_first=True, is_grid=True),
        BoxSpace("xyxy_resized", "Qwen2.5-VL", resized),
    )
}
"""Name -> convention; the names that profiles and requests use."""
