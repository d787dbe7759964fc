"""The pictures of the past: which are worth keeping, and which of them a prompt shows.

Pictures are numbered in the order of capture and never renumbered, and a prompt shows them oldest
first, so that a prompt begins as the one before it did and a provider can serve that part from its
cache.  Dropping one at each call would break this at each call; they are dropped in blocks instead,
those taken on the way first.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import KeyPicture

BLOCK = 4
"""Pictures dropped at once."""
LEAST_OF_LEG = 4
"""Pictures of a failed leg that a second chance shows, if there are as many."""
MOST_KEPT = 128
"""Pictures remembered, shown or not: about 2 MB of small ones."""
VIEW_CHANGE = np.radians(45.0)
"""A picture on the way is due after this much turning, whatever the travel."""

_LOOK_SIZE = (32, 24)
SAME_LOOK = 18.0
"""Looks that differ by less than this show the same thing, grey levels of 255: in the apartment
pairs below it were a step towards the same wall, pairs above it another view."""


def look_of(color: NDArray[Any]) -> bytes:
    """Returns a picture's look: 32 x 24 grey pixels, row by row.

    Args:
        color: (H, W, 3) uint8 RGB.
    """
    small = cv2.resize(color, _LOOK_SIZE, interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).tobytes()


def look_difference(first: bytes, second: bytes) -> float:
    """Returns the mean absolute difference of two looks in grey levels, 255 when one is missing."""
    if len(first) != len(second) or not first:
        return 255.0
    a, b = (np.frombuffer(look, np.uint8).astype(np.int16) for look in (first, second))
    return float(np.mean(np.abs(a - b)))


def shown(pictures: tuple[KeyPicture, ...], keep: int) -> tuple[KeyPicture, ...]:
    """Returns the pictures of a prompt: at least ``keep`` if there are as many, at most three more.

    Whenever there are ``keep + 4``, four go: the oldest of those taken on the way, and once there
    are none of these, the oldest views at waypoints; so a place is shown longer than a way.
    """
    window: list[KeyPicture] = []
    for picture in pictures:
        window.append(picture)
        if len(window) >= keep + BLOCK:
            ways = [p for p in window if p.direction]
            places = [p for p in window if not p.direction]
            dropped = (ways + places)[:BLOCK]
            window = [p for p in window if p not in dropped]
    return tuple(window)


def of_failed_leg(
    pictures: tuple[KeyPicture, ...], window: tuple[KeyPicture, ...]
) -> tuple[KeyPicture, ...]:
    """Returns the pictures of a leg that a prompt shows: those in the window, and more if few are.

    Args:
        pictures: all of the leg, oldest first.
        window: what the history shows anyway.
    """
    inside = tuple(picture for picture in pictures if picture in window)
    outside = tuple(picture for picture in pictures if picture not in window)
    wanted = min(len(outside), max(0, LEAST_OF_LEG - len(inside)))
    # Evenly spread, the latest included.
    chosen = tuple(outside[round((i + 1) * len(outside) / wanted) - 1] for i in range(wanted))
    return tuple(sorted(chosen + inside, key=lambda picture: picture.number))
