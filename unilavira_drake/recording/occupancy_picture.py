"""The occupancy map as a small picture: three grey levels, seen from above."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import OccupancyMap

OCCUPIED, UNKNOWN, FREE = 0, 205, 255
"""Grey of a cell; the signs of the log-odds, not their amounts."""

PNG_MAGIC = b"\x89PNG"


def grey_levels(occupancy: OccupancyMap) -> NDArray[np.uint8]:
    """Returns (rows, columns) uint8: ``OCCUPIED``, ``UNKNOWN`` or ``FREE`` for each cell.

    Rows run as in the map, from the least y up.
    """
    log_odds = occupancy.log_odds
    levels = np.full(log_odds.shape, UNKNOWN, np.uint8)
    levels[log_odds < 0] = FREE
    levels[log_odds > 0] = OCCUPIED
    return levels


def occupancy_png(occupancy: OccupancyMap) -> bytes:
    """Returns the map as an 8-bit grey PNG, one pixel a cell.

    Seen from above: x to the right, y up, so the first row of pixels is the last of the map.
    """
    ok, png = cv2.imencode(
        ".png", np.flipud(grey_levels(occupancy)), [cv2.IMWRITE_PNG_COMPRESSION, 6]
    )
    assert ok  # any grey image can be encoded
    return bytes(png)


def occupancy_from_png(
    png: bytes, *, n: int, resolution: float, origin: tuple[float, float]
) -> OccupancyMap | None:
    """Returns the map of a picture, with log-odds of -1, 0 and 1; None if it is no picture.

    Args:
        png: from :func:`occupancy_png`.
        n: number of the panorama.
        resolution: side of a cell, metres.
        origin: world (x0, y0) of the corner of cell (0, 0), metres.
    """
    read = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE) if png else None
    if read is None:
        return None
    levels = np.flipud(read)
    log_odds = np.zeros(levels.shape, np.int8)
    log_odds[levels > UNKNOWN] = -1
    log_odds[levels < UNKNOWN] = 1
    return OccupancyMap(n=n, resolution=resolution, origin=origin, log_odds=log_odds)
