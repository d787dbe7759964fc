"""The ground as rectangles and ellipses that lie beside each other, never one over another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.outdoors.solids import Quads
from unilavira_drake.worlds.outdoors.things import GroundPatch

Rectangle = tuple[float, float, float, float]

SIDES = 48
"""Corners of an ellipse."""


def ground_quads(patches: Sequence[GroundPatch]) -> list[Quads]:
    """Returns what is seen of each patch, (k, 4, 3) at z = 0; later ones lie over earlier ones."""
    x = np.unique([patch.rectangle[i] for patch in patches for i in (0, 2)])
    y = np.unique([patch.rectangle[i] for patch in patches for i in (1, 3)])
    owner = np.full((len(y) - 1, len(x) - 1), -1)
    under: dict[int, int] = {}
    for index, patch in enumerate(patches):
        rows, columns = _cells(patch.rectangle, x, y)
        if patch.round:
            under[index] = int(owner[rows, columns].flat[0])
        owner[rows, columns] = index
    quads: list[list[NDArray[np.float64]]] = [[] for _ in patches]
    for index, patch in enumerate(patches):
        if patch.round:
            disc, corners = _ellipse(patch.rectangle)
            quads[index].extend(disc)
            quads[under[index]].extend(corners)
        else:
            quads[index].extend(_rectangles(owner == index, x, y))
    return [np.array(parts).reshape(-1, 4, 3) for parts in quads]


def overlapping(patches: Sequence[GroundPatch]) -> tuple[str, str] | None:
    """Returns an ellipse that something lies over, or that lies on two things, and what it is."""
    for index, patch in enumerate(patches):
        if not patch.round:
            continue
        for other in patches[index + 1 :]:
            if _meet(patch.rectangle, other.rectangle):
                return patch.name, other.name
        on = [other for other in patches[:index] if _meet(patch.rectangle, other.rectangle)]
        if on and not _holds(on[-1].rectangle, patch.rectangle):
            return patch.name, on[-1].name
    return None


def _cells(
    rectangle: Rectangle, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[slice, slice]:
    x_min, y_min, x_max, y_max = rectangle
    left, right = (int(np.searchsorted(x, value)) for value in (x_min, x_max))
    low, high = (int(np.searchsorted(y, value)) for value in (y_min, y_max))
    return slice(low, high), slice(left, right)


def _rectangles(
    mine: NDArray[np.bool_], x: NDArray[np.float64], y: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Few rectangles that cover the cells of a patch."""
    left = mine.copy()
    found = []
    for row in range(left.shape[0]):
        column = 0
        while column < left.shape[1]:
            if not left[row, column]:
                column += 1
                continue
            end = column
            while end < left.shape[1] and left[row, end]:
                end += 1
            top = row
            while top < left.shape[0] and left[top, column:end].all():
                left[top, column:end] = False
                top += 1
            found.append(_flat((x[column], y[row], x[end], y[top])))
            column = end
    return found


def _flat(rectangle: Rectangle) -> NDArray[np.float64]:
    x0, y0, x1, y1 = rectangle
    return np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)])


def _ellipse(rectangle: Rectangle) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """The ellipse in a rectangle, and the four corners beside it, as triangles."""
    x0, y0, x1, y1 = rectangle
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.0])
    angle = 2.0 * math.pi * np.arange(SIDES + 1) / SIDES
    ring = np.stack(
        ((x1 - x0) / 2 * np.cos(angle), (y1 - y0) / 2 * np.sin(angle), np.zeros(SIDES + 1)), axis=1
    )
    ring += middle
    disc, corners = [], []
    for i in range(SIDES):
        a, b = ring[i], ring[i + 1]
        disc.append(np.array([middle, a, b, b]))
        along = (a + b) / 2 - middle
        corner = np.array([x1 if along[0] > 0 else x0, y1 if along[1] > 0 else y0, 0.0])
        corners.append(np.array([corner, b, a, a]))
    return disc, corners


def _meet(a: Rectangle, b: Rectangle) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _holds(outer: Rectangle, inner: Rectangle) -> bool:
    return (
        outer[0] <= inner[0]
        and outer[1] <= inner[1]
        and outer[2] >= inner[2]
        and outer[3] >= inner[3]
    )
