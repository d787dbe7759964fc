"""The picture of the ground: materials, markings and the shadows of what stands on it."""

from __future__ import annotations

import functools
import zlib
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.outdoors.materials import GROUND, GroundMaterial
from unilavira_drake.worlds.outdoors.things import GroundPatch
from unilavira_drake.worlds.world import Box

DETAIL = 7.0
"""Pixels a metre."""
_TILE = 512
"""Pixels after which a pattern comes again."""
_SUN = (-0.55, -0.42)
"""Where the shadow of a point one metre high falls, metres."""
_SHADE = 0.36
_WHITE = (232, 232, 228)
_LINE = 0.22
"""Width of a painted line, metres."""

Image = NDArray[np.uint8]


class GroundPicture:
    """A picture of the ground from above, from which each part takes what it shows.

    Args:
        patches: later ones lie over earlier ones.
        boxes: what throws shadows.
        mirrored: whether the world is; the sun then stands on the other side.
    """

    def __init__(
        self, patches: Sequence[GroundPatch], boxes: Iterable[Box], *, mirrored: bool = False
    ) -> None:
        rectangles = np.array([patch.rectangle for patch in patches])
        self._x_min, self._y_max = rectangles[:, 0].min(), rectangles[:, 3].max()
        columns = round((rectangles[:, 2].max() - self._x_min) * DETAIL)
        rows = round((self._y_max - rectangles[:, 1].min()) * DETAIL)
        self._image = np.zeros((rows, columns, 3), np.uint8)
        for patch in patches:
            self._paint(patch)
        self._shade(boxes, (_SUN[0], -_SUN[1] if mirrored else _SUN[1]))

    def part(self, rectangle: tuple[float, float, float, float]) -> Image:
        """Returns the picture of a rectangle; its upper row lies at the largest y."""
        rows, columns = self._slices(rectangle)
        return np.ascontiguousarray(self._image[rows, columns])

    def _slices(self, rectangle: tuple[float, float, float, float]) -> tuple[slice, slice]:
        x0, y0, x1, y1 = rectangle
        left, right = (round((x - self._x_min) * DETAIL) for x in (x0, x1))
        upper, lower = (round((self._y_max - y) * DETAIL) for y in (y1, y0))
        return slice(upper, lower), slice(left, right)

    def _paint(self, patch: GroundPatch) -> None:
        rows, columns = self._slices(patch.rectangle)
        area = self._image[rows, columns]
        drawn = _repeated(_pattern(patch.material), area.shape[:2], rows.start, columns.start)
        if patch.marking:
            _MARKINGS[patch.marking](drawn)
        if patch.round:
            mask = np.zeros(area.shape[:2], np.uint8)
            height, width = area.shape[:2]
            cv2.ellipse(
                mask, (width // 2, height // 2), (width // 2, height // 2), 0, 0, 360, 1, -1
            )
            area[mask > 0] = drawn[mask > 0]
        else:
            area[:] = drawn

    def _shade(self, boxes: Iterable[Box], sun: tuple[float, float]) -> None:
        mask = np.zeros(self._image.shape[:2], np.uint8)
        for box in boxes:
            corners = np.array(box.corners())
            low = max(0.0, box.center[2] - box.size[2] / 2)
            high = low + box.size[2]
            points = np.concatenate([corners + np.array(sun) * z for z in (low, high)])
            pixels = (points - (self._x_min, self._y_max)) * (DETAIL, -DETAIL)
            hull: Any = cv2.convexHull(np.round(pixels).astype(np.int32))
            cv2.fillConvexPoly(mask, hull, 255)
        # In eight bits: a picture of a town has ten million pixels.
        soft: Any = cv2.blur(mask, (5, 5))
        light = 255 - (soft * np.float32(_SHADE)).astype(np.uint8)
        for channel in range(3):
            self._image[:, :, channel] = cv2.multiply(
                np.ascontiguousarray(self._image[:, :, channel]), light, scale=1 / 255.0
            )


@functools.lru_cache(maxsize=len(GROUND))
def _pattern(name: str) -> Image:
    """Returns the (512, 512, 3) picture of a material."""
    material = GROUND[name]
    generator = np.random.default_rng(zlib.crc32(name.encode()))
    shade = 1.0 + material.grain * generator.standard_normal((_TILE, _TILE))
    for side in (8, 32):
        small = generator.standard_normal((_TILE // side, _TILE // side)).astype(np.float32)
        # Repeated before it is enlarged, so that it goes on over the edge.
        wide: Any = cv2.resize(np.tile(small, (3, 3)), None, fx=side, fy=side)
        shade += 0.7 * material.patches * wide[_TILE : 2 * _TILE, _TILE : 2 * _TILE]
    if material.joint:
        shade *= _joints(material)
    image = 255.0 * shade[:, :, None] * np.array(material.color)
    pixels: Image = np.clip(image + 0.5, 0, 255).astype(np.uint8)
    pixels.flags.writeable = False
    return pixels


def _joints(material: GroundMaterial) -> NDArray[np.float64]:
    along = np.arange(_TILE) % max(4, round(material.joint * DETAIL)) == 0
    return np.where(along[:, None] | along[None, :], 0.86, 1.0)


def _repeated(pattern: Image, shape: tuple[int, ...], row: int, column: int) -> Image:
    rows = (np.arange(shape[0]) + row) % _TILE
    columns = (np.arange(shape[1]) + column) % _TILE
    return np.ascontiguousarray(pattern[rows][:, columns])


def _lane(image: Image) -> None:
    """Edges and a broken middle line along the longer side of a road."""
    turned = image.shape[0] > image.shape[1]
    road = image.transpose(1, 0, 2) if turned else image
    height, width = road.shape[:2]
    line = max(1, round(_LINE * DETAIL))
    edge = round(0.35 * DETAIL)
    for row in (edge, height - edge - line):
        road[row : row + line] = _WHITE
    dash, middle = round(3.0 * DETAIL), height // 2
    for start in range(0, width, 2 * dash):
        road[middle - line // 2 : middle - line // 2 + line, start : start + dash] = _WHITE


def _crossing_y(image: Image) -> None:
    """Stripes of a zebra crossing over a road along x."""
    stripe = round(0.55 * DETAIL)
    for start in range(stripe, image.shape[0] - stripe, 2 * stripe):
        image[start : start + stripe] = _WHITE


def _crossing_x(image: Image) -> None:
    """The same over a road along y."""
    _crossing_y(image.transpose(1, 0, 2))


def _parking(image: Image) -> None:
    """Bays at both longer sides."""
    turned = image.shape[0] > image.shape[1]
    place = image.transpose(1, 0, 2) if turned else image
    height, width = place.shape[:2]
    line, bay, depth = max(1, round(0.15 * DETAIL)), round(2.7 * DETAIL), round(5.2 * DETAIL)
    for start in range(0, width - line, bay):
        place[: min(depth, height // 2), start : start + line] = _WHITE
        if height > 2.2 * depth:
            place[height - depth :, start : start + line] = _WHITE


def _pitch(image: Image) -> None:
    """A football pitch."""
    turned = image.shape[0] > image.shape[1]
    field = np.ascontiguousarray(image.transpose(1, 0, 2) if turned else image)
    height, width = field.shape[:2]
    for start in range(0, width, 10 * round(DETAIL)):
        field[:, start : start + 5 * round(DETAIL)] = (
            field[:, start : start + 5 * round(DETAIL)] * 0.9
        ).astype(np.uint8)
    edge, line = round(1.5 * DETAIL), max(1, round(_LINE * DETAIL))
    corner = (width - edge, height - edge)
    cv2.rectangle(field, (edge, edge), corner, _WHITE, line)
    cv2.line(field, (width // 2, edge), (width // 2, height - edge), _WHITE, line)
    cv2.circle(field, (width // 2, height // 2), round(0.14 * height), _WHITE, line)
    box, half = round(0.14 * width), round(0.26 * height)
    for x0, x1 in ((edge, edge + box), (width - edge - box, width - edge)):
        cv2.rectangle(field, (x0, height // 2 - half), (x1, height // 2 + half), _WHITE, line)
    image[:] = field.transpose(1, 0, 2) if turned else field


_MARKINGS = {
    "lane": _lane,
    "crossing_x": _crossing_x,
    "crossing_y": _crossing_y,
    "parking": _parking,
    "pitch": _pitch,
}
MARKINGS = tuple(_MARKINGS)
"""What can be painted on the ground."""
