"""Signs: panels with words on them."""

from __future__ import annotations

import textwrap

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_LETTERS = 160
"""A longer text could not be read from across a room."""

_FONT = cv2.FONT_HERSHEY_DUPLEX
_MARGIN = 0.08
"""Share of each side that stays free."""
_LINE_HEIGHT = 1.5
"""Of the height of a capital letter."""
_MOST_LINES = 8


def sign_picture(
    text: str, rows: int, columns: int, color: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Returns (rows, columns, 3) float32 RGB in [0, 1]: dark words on a light ground, as large as
    they fit, in a frame of the given colour.
    """
    image = np.full((rows, columns, 3), 247, np.uint8)
    width, height = (1 - 2 * _MARGIN) * columns, (1 - 2 * _MARGIN) * rows
    scale, lines = max(
        (_scale(lines, width, height), lines)
        for lines in (
            textwrap.wrap(text, max(1, -(-len(text) // count))) for count in range(1, _MOST_LINES)
        )
    )
    thickness = max(1, round(1.6 * scale))
    step = _LINE_HEIGHT * _letter(scale)
    baseline = (rows - step * len(lines)) / 2 + (step + _letter(scale)) / 2
    for line in lines:
        (length, _), _ = cv2.getTextSize(line, _FONT, scale, thickness)
        corner = (round((columns - length) / 2), round(baseline))
        cv2.putText(image, line, corner, _FONT, scale, (25, 25, 30), thickness, cv2.LINE_AA)
        baseline += step
    side = max(2, round(0.03 * min(rows, columns)))
    frame = [255.0 * float(part) for part in color]
    cv2.rectangle(image, (0, 0), (columns - 1, rows - 1), frame, 2 * side)
    return image.astype(np.float32) / 255.0


def _letter(scale: float) -> float:
    """Returns the height of a capital letter, pixels."""
    (_, height), _ = cv2.getTextSize("H", _FONT, 1.0, 1)
    return scale * height


def _scale(lines: list[str], width: float, height: float) -> float:
    """Returns the largest scale at which the lines fit."""
    longest = max(cv2.getTextSize(line, _FONT, 1.0, 1)[0][0] for line in lines)
    return min(width / longest, height / (_LINE_HEIGHT * _letter(1.0) * len(lines)))
