"""Turns messages into lines of the transcript: the same episode gives the same bytes.

A line is ``{t, decision, system, event, data}`` in simulated time.  Floats are rounded to six
digits; pictures stand as the SHA-256 of their file; arrays larger than a pose are left out.  An
occupancy map is such a picture too, see ``occupancy_picture``; so is a voxel map, seen from above.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from unilavira_drake.messages import Frame, OccupancyMap, VoxelMap
from unilavira_drake.recording.occupancy_picture import PNG_MAGIC, occupancy_png
from unilavira_drake.recording.voxel_picture import top_view

DIGITS = 6
LARGEST_ARRAY = 16
"""Elements of a (4, 4) pose."""

_FRAME_FIELDS = ("view", "time", "jpeg", "intrinsics", "X_WC")
_JPEG_MAGIC = b"\xff\xd8"


def plain(value: Any, pictures: dict[str, bytes]) -> Any:
    """Returns the JSON value of a message or of a part of one; keys are in sorted order.

    Args:
        pictures: gets every picture in the value (JPEG; PNG for a map), by SHA-256.

    Raises:
        TypeError: for a value that is no message.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return _rounded(value)
    if isinstance(value, bytes):
        return _digest(value, pictures)
    if isinstance(value, tuple | list):
        return [plain(item, pictures) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item(), pictures)
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), pictures)
    return {key: plain(item, pictures) for key, item in sorted(_items(value).items())}


def transcript_line(
    t: float, decision: int, system: str, event: str, message: Any, pictures: dict[str, bytes]
) -> str:
    """Returns one line of ``transcript.jsonl``, without its line feed.

    Args:
        t: simulated seconds.
        decision: number of the language call that the message belongs to.
        pictures: gets every picture in the message (JPEG; PNG for a map), by SHA-256.
    """
    line = {
        "t": _rounded(t),
        "decision": decision,
        "system": system,
        "event": event,
        "data": plain(message, pictures),
    }
    return json.dumps(line, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _items(value: Any) -> Mapping[str, Any]:
    if isinstance(value, Mapping):
        return {str(key): item for key, item in value.items()}
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        raise TypeError(f"a transcript holds messages, not {type(value).__name__}")
    if isinstance(value, Frame):
        return {name: getattr(value, name) for name in _FRAME_FIELDS}
    if isinstance(value, VoxelMap):
        return _items(top_view(value))
    items = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, OccupancyMap):
        items |= {"shape": value.shape, "image": occupancy_png(value)}
        del items["cells"]
        if not value.rejected:
            del items["rejected"]
    return {name: item for name, item in items.items() if not _is_large(item)}


def _is_large(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size > LARGEST_ARRAY


def _rounded(value: float) -> float | str:
    if not math.isfinite(value):
        return str(value)  # JSON has no such numbers
    return round(value, DIGITS) + 0.0  # no negative zero


def _digest(value: bytes, pictures: dict[str, bytes]) -> str:
    if not value:
        return ""
    digest = hashlib.sha256(value).hexdigest()
    if value.startswith((_JPEG_MAGIC, PNG_MAGIC)):
        pictures[digest] = value
    return digest
