"""Simple solids as quads: (k, 4, 3) corners, counter-clockwise seen from outside.

A quad whose last two corners are the same is a triangle.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Quads = NDArray[np.float64]
Point = tuple[float, float, float]

_CUBE = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 2.0
_FACES = np.array(
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)


def box(middle: Point, size: Point) -> Quads:
    """Returns a box around a middle: faces -x +x -y +y -z +z."""
    quads: Quads = (_CUBE * np.array(size) + np.array(middle))[_FACES]
    return quads


def standing(foot: Point, size: Point) -> Quads:
    """Returns a box that stands on a point, without its underside."""
    x, y, z = foot
    return np.delete(box((x, y, z + size[2] / 2), size), 4, axis=0)


def prism(foot: Point, radii: tuple[float, float], height: float, sides: int) -> Quads:
    """Returns an upright prism, cone or frustum with its top, without its underside."""
    angle = 2.0 * math.pi * np.arange(sides + 1) / sides
    ring = np.stack((np.cos(angle), np.sin(angle), np.zeros(sides + 1)), axis=1)
    low = np.array(foot) + radii[0] * ring
    top = np.array(foot) + np.array([0.0, 0.0, height])
    high = top + radii[1] * ring
    walls = np.stack((low[:-1], low[1:], high[1:], high[:-1]), axis=1)
    if radii[1] <= 0.0:
        return walls
    lid = np.stack((high[:-1], high[1:], np.broadcast_to(top, (sides, 3))), axis=1)
    return np.concatenate((walls, np.concatenate((lid, lid[:, 2:]), axis=1)))


def blob(middle: Point, radii: Point, generator: np.random.Generator) -> Quads:
    """Returns an uneven ball of 24 faces: a crown of leaves."""
    steps = np.linspace(-1.0, 1.0, 3)
    quads = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            for i in range(2):
                for k in range(2):
                    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
                    if sign < 0:
                        square.reverse()
                    corners = np.full((4, 3), sign)
                    for n, (a, b) in enumerate(square):
                        corners[n, (axis + 1) % 3] = steps[i + a]
                        corners[n, (axis + 2) % 3] = steps[k + b]
                    quads.append(corners)
    cube = np.array(quads)
    points, place = np.unique(cube.reshape(-1, 3), axis=0, return_inverse=True)
    ball = points / np.linalg.norm(points, axis=1, keepdims=True)
    ball *= generator.uniform(0.84, 1.08, (len(ball), 1))
    corners_of: Quads = (ball * np.array(radii) + np.array(middle))[place.reshape(-1)]
    return corners_of.reshape(-1, 4, 3)


def gable(foot: Point, size: Point) -> tuple[Quads, Quads]:
    """Returns the two slopes of a roof whose ridge runs along y, and its two gable ends."""
    x, y, z = foot
    a, b = size[0] / 2, size[1] / 2
    ridge = ((x, y - b, z + size[2]), (x, y + b, z + size[2]))
    front = ((x + a, y - b, z), (x + a, y + b, z))
    back = ((x - a, y + b, z), (x - a, y - b, z))
    slopes = np.array(
        [
            (front[0], front[1], ridge[1], ridge[0]),
            (back[0], back[1], ridge[0], ridge[1]),
        ]
    )
    ends = np.array(
        [
            (back[1], front[0], ridge[0], ridge[0]),
            (front[1], back[0], ridge[1], ridge[1]),
        ]
    )
    return slopes, ends


def pyramid(foot: Point, size: Point) -> Quads:
    """Returns the four slopes of a pyramid."""
    x, y, z = foot
    a, b = size[0] / 2, size[1] / 2
    ring = [(x - a, y - b, z), (x + a, y - b, z), (x + a, y + b, z), (x - a, y + b, z)]
    tip = (x, y, z + size[2])
    return np.array([(ring[i], ring[(i + 1) % 4], tip, tip) for i in range(4)])


def moved(quads: Quads, place: tuple[float, float, float, float], *, mirrored: bool) -> Quads:
    """Returns solids of a local frame in the world.

    Args:
        quads: (k, 4, 3).
        place: x, y, z (metres) and yaw (radians).
        mirrored: whether the local y is negated first.
    """
    if mirrored:
        quads = np.where([True, False, True], quads, -quads)[:, REVERSED]
    x, y, z, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    turned: Quads = quads @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    turned += np.array([x, y, z])
    return turned


REVERSED = [1, 0, 3, 2]
"""The order of a quad's corners that turns it around.  A triangle's double corner stays last."""
