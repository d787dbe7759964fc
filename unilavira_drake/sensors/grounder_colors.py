"""A grounder on pixels: finds things of the colour that a description names."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Candidate
from unilavira_drake.messages.grounding import Box
from unilavira_drake.sensors.color_names import COLOR_WORDS, color_table
from unilavira_drake.sensors.grounder_words import read_target

LEAST_PIXELS = 60
"""Smaller parts are specks."""
STEP = 0.1
"""Neighbouring pixels whose depths differ by this share lie on different things."""
SPECKLE = 5
"""Width of the median filter over a colour's mask, pixels: patterns and noise are not shapes."""
BACKGROUND = 0.9
"""What spans this share of the searched part both ways is a wall or a floor, not a thing."""


def color_candidates(
    color: NDArray[np.uint8], depth: NDArray[np.float32], target_desc: str, box: Box
) -> list[Candidate]:
    """Returns the connected regions of the named colour in and around a box.

    The box is searched with half its width and height more on each side.  Regions end where the
    colour word changes or the depth jumps; what spans the whole searched part is background.  The
    score of a region is its size as a share of the largest; its point lies deepest inside.

    Args:
        color: (H, W, 3) uint8 RGB.
        depth: (H, W) float32, metres along the camera's z.
        target_desc: what is looked for; without a colour word nothing is found.
        box: where the model marked it, pixels.
    """
    word = read_target(target_desc).color
    if word not in COLOR_WORDS:
        return []
    u_min, v_min, u_max, v_max = _searched(box, *depth.shape)
    if u_max - u_min < 3 or v_max - v_min < 3:
        return []
    part = (slice(v_min, v_max), slice(u_min, u_max))
    mask = np.asarray(cv2.medianBlur(_mask(color[part], word), SPECKLE), dtype=np.uint8)
    mask[_steps(depth[part])] = 0
    found = [
        (pixels, region, point)
        for pixels, region, point in _regions(mask)
        if not _is_background(region, mask)
    ]
    largest = max((pixels for pixels, _, _ in found), default=0)
    return [
        Candidate(
            (a + u_min, b + v_min, c + u_min, d + v_min),
            pixels / largest,
            (u + u_min, v + v_min),
        )
        for pixels, (a, b, c, d), (u, v) in found
    ]


def _searched(box: Box, rows: int, columns: int) -> tuple[int, int, int, int]:
    u, v = (box[2] - box[0]) / 2, (box[3] - box[1]) / 2
    return (
        max(round(box[0] - u), 0),
        max(round(box[1] - v), 0),
        min(round(box[2] + u), columns),
        min(round(box[3] + v), rows),
    )


def _mask(color: NDArray[np.uint8], word: str) -> NDArray[np.uint8]:
    red, green, blue = (color[..., i].astype(np.uint16) >> 3 for i in range(3))
    indices = color_table()[red << 10 | green << 5 | blue]
    return np.asarray(indices == COLOR_WORDS.index(word), dtype=np.uint8)


def _steps(depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Returns the pixels at whose right or lower edge the depth jumps."""
    # Too near (0) and too far (inf) are depths like others: what matters is the change.
    log = np.log(np.clip(depth, 0.01, 100.0))
    steps = np.zeros(depth.shape, dtype=bool)
    steps[:, :-1] |= np.abs(np.diff(log, axis=1)) > STEP
    steps[:-1, :] |= np.abs(np.diff(log, axis=0)) > STEP
    return steps


def _regions(mask: NDArray[np.uint8]) -> list[tuple[int, Box, tuple[float, float]]]:
    """Returns pixels, box and innermost pixel of each region that is large enough."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    inside: Any = cv2.distanceTransform(np.pad(mask, 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    regions = []
    for label in range(1, count):
        u, v, width, height, pixels = (int(value) for value in stats[label])
        if pixels < LEAST_PIXELS:
            continue
        patch = np.s_[v : v + height, u : u + width]
        deepest = int(np.argmax(np.where(labels[patch] == label, inside[patch], -1.0)))
        row, column = divmod(deepest, width)
        box = (float(u), float(v), float(u + width), float(v + height))
        regions.append((pixels, box, (float(u + column), float(v + row))))
    return regions


def _is_background(region: Box, mask: NDArray[np.uint8]) -> bool:
    rows, columns = mask.shape
    width, height = region[2] - region[0], region[3] - region[1]
    return bool(width >= BACKGROUND * columns and height >= BACKGROUND * rows)
