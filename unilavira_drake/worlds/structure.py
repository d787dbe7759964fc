"""Walls between rectangular rooms, doorways cut into them, and the door frames."""

from __future__ import annotations

import dataclasses as dc
from collections.abc import Iterable
from dataclasses import dataclass

from unilavira_drake.worlds.world import JAMB_WIDTH, Box, Doorway, Room

JAMB_DEPTH = 0.20
"""Metres, across the wall."""

DOOR_HEIGHT = 2.1
"""Clear height of a doorway, metres."""


@dataclass(frozen=True)
class _Line:
    """A stretch of wall: along x (or y) at ``offset`` from ``start`` to ``end``."""

    along_x: bool
    offset: float
    start: float
    end: float

    def box(self, low: float, high: float, thickness: float) -> Box:
        middle, length = (self.start + self.end) / 2, self.end - self.start
        z, height = (low + high) / 2, high - low
        if self.along_x:
            return Box((middle, self.offset, z), (length, thickness, height))
        return Box((self.offset, middle, z), (thickness, length, height))


def wall_lines(rooms: Iterable[Room]) -> tuple[_Line, ...]:
    """Returns the centre lines of all walls, shared walls once, in a fixed order."""
    spans: dict[tuple[bool, float], list[tuple[float, float]]] = {}
    for room in rooms:
        x_min, y_min, x_max, y_max = room.rectangle
        for y in (y_min, y_max):
            spans.setdefault((True, y), []).append((x_min, x_max))
        for x in (x_min, x_max):
            spans.setdefault((False, x), []).append((y_min, y_max))
    return tuple(
        _Line(along_x, offset, start, end)
        for (along_x, offset), parts in sorted(spans.items())
        for start, end in _merged(parts)
    )


def doorway(opening: Doorway, rooms: tuple[Room, Room], thickness: float) -> Doorway | None:
    """Returns the opening with its wall's direction, or None where the rooms share no wall."""
    for along_x in (True, False):
        across, along = (opening.y, opening.x) if along_x else (opening.x, opening.y)
        reach = opening.gap + thickness / 2
        if all(_borders(room, along_x, across, along - reach, along + reach) for room in rooms):
            return dc.replace(opening, along_x=along_x)
    return None


def walls(
    rooms: Iterable[Room], doorways: Iterable[Doorway], height: float, thickness: float
) -> tuple[Box, ...]:
    """Returns the boxes of all walls with the doorways cut out and lintels above them."""
    openings = tuple(doorways)
    boxes: list[Box] = []
    for line in wall_lines(rooms):
        # Walls along x own the corners, so no two faces lie in the same plane there.
        grow = thickness / 2 if line.along_x else -thickness / 2
        cursor, end = line.start - grow, line.end + grow
        for opening in _on_line(line, openings):
            middle = opening.x if line.along_x else opening.y
            half = opening.gap
            boxes.append(_part(line, cursor, middle - half).box(0.0, height, thickness))
            if not opening.open:
                lintel = _part(line, middle - half, middle + half)
                boxes.append(lintel.box(DOOR_HEIGHT + JAMB_WIDTH, height, thickness))
            cursor = middle + half
        boxes.append(_part(line, cursor, end).box(0.0, height, thickness))
    return tuple(boxes)


def frame_boxes(opening: Doorway) -> tuple[Box, ...]:
    """Returns two jambs and the head of a door frame; the clear width stays free."""
    reach = (opening.width + JAMB_WIDTH) / 2
    line = _Line(
        opening.along_x,
        opening.y if opening.along_x else opening.x,
        *((opening.x, opening.x) if opening.along_x else (opening.y, opening.y)),
    )
    top = DOOR_HEIGHT + JAMB_WIDTH
    half = JAMB_WIDTH / 2
    parts = (
        (_part(line, line.start - reach - half, line.start - reach + half), 0.0),
        (_part(line, line.start + reach - half, line.start + reach + half), 0.0),
        (_part(line, line.start - reach + half, line.start + reach - half), DOOR_HEIGHT),
    )
    return tuple(part.box(low, top, JAMB_DEPTH) for part, low in parts)


def _part(line: _Line, start: float, end: float) -> _Line:
    return _Line(line.along_x, line.offset, start, end)


def _on_line(line: _Line, openings: tuple[Doorway, ...]) -> list[Doorway]:
    along = [
        opening
        for opening in openings
        if opening.along_x == line.along_x
        and abs((opening.y if line.along_x else opening.x) - line.offset) < 1e-6
        and line.start < (opening.x if line.along_x else opening.y) < line.end
    ]
    return sorted(along, key=lambda opening: opening.x if line.along_x else opening.y)


def _borders(room: Room, along_x: bool, across: float, low: float, high: float) -> bool:
    x_min, y_min, x_max, y_max = room.rectangle
    sides, start, end = (
        ((y_min, y_max), x_min, x_max) if along_x else ((x_min, x_max), y_min, y_max)
    )
    return start <= low and high <= end and any(abs(across - side) < 1e-6 for side in sides)


def _merged(parts: list[tuple[float, float]]) -> list[tuple[float, float]]:
    merged: list[tuple[float, float]] = []
    for start, end in sorted(parts):
        if merged and start <= merged[-1][1] + 1e-9:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end))
        else:
            merged.append((start, end))
    return merged
