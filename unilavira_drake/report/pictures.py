"""The pictures of a run folder, small and as text, each one once."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from unilavira_drake.recording.occupancy_picture import FREE, UNKNOWN

WIDTH = 480
"""Pixels; larger views are scaled down to it."""
_QUALITY = 72
_OCCUPIED = 90
"""Grey of occupied cells: light enough for words on them."""
_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Picture:
    """A picture of the page: its id there and its data URI."""

    id: str
    uri: str


class Pictures:
    """Reads frames and maps by their SHA-256, and remembers what is missing.

    Args:
        folder: the run folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._frames: dict[str, Picture | None] = {}
        self.problems: list[str] = []
        """One sentence for each picture that is not there."""

    @property
    def frames(self) -> tuple[Picture, ...]:
        """Every frame that was asked for and is there, once."""
        return tuple(picture for picture in self._frames.values() if picture is not None)

    def frame(self, digest: str) -> Picture | None:
        """Returns a view, scaled down; None if it is missing or no picture."""
        if digest not in self._frames:
            jpeg = _scaled(self._read(f"frames/{digest}.jpg", digest))
            self._frames[digest] = (
                Picture(f"frame-{len(self._frames) + 1}", _uri("jpeg", jpeg)) if jpeg else None
            )
        return self._frames[digest]

    def map(self, digest: str) -> str:
        """Returns the data URI of a map, clear where it is unknown; empty if it is missing."""
        png = self._read(f"maps/{digest}.png", digest)
        return _uri("png", _clear(png)) if png else ""

    def _read(self, name: str, digest: str) -> bytes:
        """Returns a picture's file; empty, and told, if it cannot be decoded."""
        # A digest comes out of a file that anybody may have written: it must stay a file's name.
        content = b""
        if _DIGEST.fullmatch(digest):
            try:
                content = (self._folder / name).read_bytes()
            except OSError:
                content = b""
        if content and _decoded(content) is not None:
            return content
        what = "is no picture" if content else "is missing"
        problem = f"{name} {what}."
        if problem not in self.problems:
            self.problems.append(problem)
        return b""


def _decoded(content: bytes) -> np.ndarray | None:
    image: np.ndarray | None = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    return image


def _scaled(jpeg: bytes) -> bytes:
    image = _decoded(jpeg) if jpeg else None
    if image is None:
        return b""
    height, width = image.shape[:2]
    if width > WIDTH:
        size = (WIDTH, round(height * WIDTH / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    _, small = cv2.imencode(
        ".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    )
    return bytes(small)


def _clear(png: bytes) -> bytes:
    grey = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    alpha = np.where(grey == UNKNOWN, 0, 255).astype(np.uint8)
    level = np.where(grey == FREE, 255, _OCCUPIED).astype(np.uint8)
    _, clear = cv2.imencode(
        ".png", cv2.merge([level, level, level, alpha]), [cv2.IMWRITE_PNG_COMPRESSION, 9]
    )
    return bytes(clear)


def _uri(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
