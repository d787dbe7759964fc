"""What one exposure of a camera rig gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message


@dataclass(frozen=True, eq=False)
class Frame(Message):
    """The pictures of one view, read-only; depth alone when no more was asked for."""

    depth: NDArray[np.float32]
    """(H, W) float32 metres along the optical axis; 0 too close, inf too far."""
    color: NDArray[np.uint8] | None = None
    """(H, W, 4) uint8 RGBA."""
    label: NDArray[np.int16] | None = None
    """(H, W) int16."""


def millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Returns depth as Drake's 16-bit images have it: 0 too close, 65535 too far."""
    scaled = np.minimum(depth, np.float32(65.535)) * np.float32(1000.0)
    result: NDArray[np.uint16] = scaled.astype(np.uint16)
    return result
