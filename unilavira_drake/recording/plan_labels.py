"""Where words find room on a floor plan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.recording.floor_plan import FloorPlan, PlanThing
from unilavira_drake.worlds.world import Room

Rectangle = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max), metres in the world."""

_LINE = 1.15
"""Height of a line, in letter heights."""
_FULL = 1.3
"""A word may reach over its thing's edge by this factor."""
_WALL = 0.15
"""Room names keep this far from the walls' centre lines, metres."""
_STEPS = 9
"""Places that are tried for a room's name along each side."""


@dataclass(frozen=True)
class Label:
    """A text centred on a point of the plan, upright or turned by a quarter to the left."""

    lines: tuple[str, ...]
    x: float
    y: float
    upright: bool = False

    @property
    def text(self) -> str:
        """All lines."""
        return "\n".join(self.lines)


@dataclass(frozen=True)
class Lettering:
    """The size of a font on the plan, metres."""

    height: float
    letter_width: float

    def size(self, lines: Sequence[str]) -> tuple[float, float]:
        """Returns width and height of a text."""
        return max(map(len, lines)) * self.letter_width, len(lines) * self.height * _LINE


def thing_labels(
    plan: FloorPlan, lettering: Lettering, taken: Iterable[Rectangle] = ()
) -> tuple[Label, ...]:
    """Returns a label for each thing whose category fits into its outline.

    Small things go first: a word on a table would leave none to the lamp on it.

    Args:
        plan: the floor plan.
        lettering: the font.
        taken: places that are to stay free.
    """
    occupied, labels = list(taken), []
    for thing in reversed(plan.things):
        label = None if thing.slight else _fit(thing, lettering)
        if label is None:
            continue
        rectangle = _rectangle(label, lettering)
        if not any(_overlap(rectangle, other) > 0.0 for other in occupied):
            occupied.append(rectangle)
            labels.append(label)
    return tuple(labels)


def room_labels(
    plan: FloorPlan,
    lettering: Lettering,
    points: NDArray[np.float64],
    marks: Sequence[Rectangle] = (),
) -> tuple[tuple[Label, Rectangle], ...]:
    """Returns the name of each room and what it covers, where it hides least.

    Args:
        plan: the floor plan.
        lettering: the font.
        points: (k, 2) points of the way, which it keeps clear of.
        marks: places of marks that are drawn over it.
    """
    things = [thing.box for thing in plan.things]
    found = []
    for room in plan.rooms:
        best = min(
            _room_places(room, lettering),
            key=lambda entry: _cost(entry[1], room, things, points, marks),
        )
        found.append(best)
    return tuple(found)


def _fit(thing: PlanThing, lettering: Lettering) -> Label | None:
    x_min, y_min, x_max, y_max = thing.box
    middle = ((x_min + x_max) / 2, (y_min + y_max) / 2)
    one, many = (thing.category,), tuple(thing.category.split())
    for lines in dict.fromkeys((one, many)):
        width, height = lettering.size(lines)
        if width <= _FULL * (x_max - x_min) and height <= _FULL * (y_max - y_min):
            return Label(lines, *middle)
    for lines in dict.fromkeys((one, many)):
        width, height = lettering.size(lines)
        if width <= _FULL * (y_max - y_min) and height <= _FULL * (x_max - x_min):
            return Label(lines, *middle, upright=True)
    return None


def _room_places(room: Room, lettering: Lettering) -> list[tuple[Label, Rectangle]]:
    x_min, y_min, x_max, y_max = room.rectangle
    places = []
    for lines in dict.fromkeys(((room.kind,), tuple(room.kind.split()))):
        width, height = lettering.size(lines)
        for upright in (False, True):
            w, h = (height, width) if upright else (width, height)
            free_x, free_y = x_max - x_min - w - 2 * _WALL, y_max - y_min - h - 2 * _WALL
            for i in range(_STEPS):
                for j in range(_STEPS):
                    x = (x_min + x_max) / 2 + max(free_x, 0.0) * (i / (_STEPS - 1) - 0.5)
                    y = (y_min + y_max) / 2 + max(free_y, 0.0) * (j / (_STEPS - 1) - 0.5)
                    label = Label(lines, x, y, upright)
                    places.append((label, _rectangle(label, lettering)))
    return places


def _cost(
    rectangle: Rectangle,
    room: Room,
    things: Sequence[Rectangle],
    points: NDArray[np.float64],
    marks: Sequence[Rectangle],
) -> float:
    x_min, y_min, x_max, y_max = rectangle
    hidden = sum(_overlap(rectangle, other) for other in things) / _area(rectangle)
    margin = 0.15
    on_way = (
        (points[:, 0] > x_min - margin)
        & (points[:, 0] < x_max + margin)
        & (points[:, 1] > y_min - margin)
        & (points[:, 1] < y_max + margin)
    )
    left, bottom, right, top = room.rectangle
    marked = any(_overlap(rectangle, mark) > 0.0 for mark in marks)
    beyond = 1.0 - _overlap(rectangle, (left, bottom, right, top)) / _area(rectangle)
    # In the middle, and above it rather than below, if nothing else decides.
    off_x = abs((x_min + x_max) - (left + right)) / (right - left)
    off_y = abs((y_min + y_max) / 2 - (bottom + 0.7 * (top - bottom))) / (top - bottom)
    turned = (y_max - y_min) > (x_max - x_min)
    covered = 3.0 * bool(on_way.any()) + 6.0 * marked
    return 20.0 * beyond + 20.0 * hidden + covered + 0.4 * turned + off_x / 2 + off_y


def _rectangle(label: Label, lettering: Lettering) -> Rectangle:
    width, height = lettering.size(label.lines)
    w, h = (height, width) if label.upright else (width, height)
    return label.x - w / 2, label.y - h / 2, label.x + w / 2, label.y + h / 2


def _area(rectangle: Rectangle) -> float:
    return (rectangle[2] - rectangle[0]) * (rectangle[3] - rectangle[1])


def _overlap(a: Rectangle, b: Rectangle) -> float:
    """Returns the area that two rectangles share, square metres."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0)
