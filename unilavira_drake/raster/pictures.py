"""Pictures on surfaces: decoded, checked, named by their content."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.errors import GeometryError
from unilavira_drake.raster.surface import MAX_TEXTURE, Texture

_SLACK = 1e-3


def stays_inside(uv: NDArray[np.floating]) -> bool:
    """Whether picture coordinates never leave the picture, so that its edge need not repeat."""
    return bool(len(uv) == 0 or (uv.min() >= -_SLACK and uv.max() <= 1.0 + _SLACK))


def make_texture(pixels: NDArray[np.uint8], *, repeats: bool) -> Texture:
    """Returns the texture of (H, W, 4) uint8 RGBA pixels."""
    data = np.ascontiguousarray(pixels)
    digest = hashlib.sha1(f"{data.shape}{repeats}".encode())
    digest.update(data.tobytes())
    data.flags.writeable = False
    return Texture(digest.hexdigest(), data, repeats)


def picture_texture(image: Any, *, repeats: bool) -> Texture:
    """Returns the texture of a Pillow image.

    Raises:
        GeometryError: if it is too large or its data are broken.
    """
    check_size(*image.size)
    try:
        pixels = np.asarray(image.convert("RGBA"))
    except (OSError, SyntaxError, ValueError) as error:
        raise GeometryError(f"its picture cannot be decoded: {error}") from None
    return make_texture(pixels, repeats=repeats)


def read_texture(path: Path, *, repeats: bool) -> Texture:
    """Returns the texture of a picture file.

    Raises:
        GeometryError: if the file is missing, no picture or too large.
    """
    if not path.is_file():
        raise GeometryError(f"picture {str(path)!r} does not exist")
    image: Any = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise GeometryError(f"{str(path)!r} is not a picture that can be read")
    check_size(image.shape[1], image.shape[0])
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    code = {2: cv2.COLOR_GRAY2RGBA, 3: cv2.COLOR_BGR2RGBA, 4: cv2.COLOR_BGRA2RGBA}
    channels = 2 if image.ndim == 2 else image.shape[2]
    pixels: Any = cv2.cvtColor(image, code[channels])
    return make_texture(pixels, repeats=repeats)


def only_color(texture: Texture) -> NDArray[np.uint8] | None:
    """Returns the (4,) RGBA of a picture that has no other, or None."""
    first: NDArray[np.uint8] = texture.pixels[0, 0]
    return first if (texture.pixels == first).all() else None


def check_size(width: int, height: int) -> None:
    """Refuses a huge picture.

    Raises:
        GeometryError: if a side has more than ``MAX_TEXTURE`` pixels.
    """
    if max(width, height) > MAX_TEXTURE:
        raise GeometryError(
            f"its picture has {width} x {height} pixels; at most {MAX_TEXTURE} a side are drawn, "
            "so make it smaller"
        )
