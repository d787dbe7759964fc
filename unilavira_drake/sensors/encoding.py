"""Pictures as bytes."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

JPEG_QUALITY = 85


def rgb_of(rgba: NDArray[Any]) -> NDArray[np.uint8]:
    """Returns the colours of an (H, W, 4) uint8 RGBA image as a read-only (H, W, 3) array."""
    # Thirty times faster than slicing and copying.
    rgb: NDArray[np.uint8] = np.asarray(cv2.cvtColor(rgba, cv2.COLOR_RGBA2RGB), dtype=np.uint8)
    rgb.flags.writeable = False
    return rgb


def encode_jpeg(color: NDArray[Any], *, width: int | None = None) -> bytes:
    """Returns an (H, W, 3) uint8 RGB image as JPEG, scaled down to ``width`` pixels if given."""
    if width is not None and width < color.shape[1]:
        height = round(color.shape[0] * width / color.shape[1])
        color = np.asarray(cv2.resize(color, (width, height), interpolation=cv2.INTER_AREA))
    bgr = cv2.cvtColor(color, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return data.tobytes()
