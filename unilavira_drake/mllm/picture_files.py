"""Pictures from files, as the JPEG bytes that requests carry."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

from PIL import Image, ImageOps, UnidentifiedImageError

from unilavira_drake.errors import InputError

JPEG_QUALITY = 90
"""Of pictures that come in another format."""
MOST_PIXELS = 50_000_000
"""A larger picture is a mistake; no provider looks at so many."""


def read_picture(path: Path) -> bytes:
    """Returns the picture of a file: a JPEG file as it is, any other one as a new JPEG.

    Raises:
        InputError: if the file cannot be read, or is no picture.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{str(path)!r}: no such file.") from None
    except OSError as error:
        raise InputError(f"{str(path)!r} cannot be read ({error.strerror or error}).") from None
    try:
        return as_jpeg(data)
    except InputError as error:
        raise InputError(f"{str(path)!r} {error}") from None


def as_jpeg(data: bytes) -> bytes:
    """Returns a picture's bytes as JPEG; what is JPEG already, and whole, is returned as it is.

    What is transparent becomes white; of an animation the first picture is taken.

    Raises:
        InputError: if the bytes are no picture, or a broken or far too large one.
    """
    try:
        with warnings.catch_warnings():
            # The size is checked here.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            return _as_jpeg(data)
    except UnidentifiedImageError:
        raise InputError("is no picture; give a JPEG, PNG, WebP or similar file.") from None
    # Pillow's decoders raise whatever the first damaged field leads to.
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        raise InputError(f"is a damaged picture ({error}).") from None


def _as_jpeg(data: bytes) -> bytes:
    with Image.open(io.BytesIO(data)) as picture:
        width, height = picture.size
        if width * height > MOST_PIXELS:
            raise InputError(f"has {width} x {height} pixels; the most is {MOST_PIXELS:,}.")
        picture.load()
        if picture.format == "JPEG":
            return data
        return _encoded(picture)


def _encoded(picture: Image.Image) -> bytes:
    picture = ImageOps.exif_transpose(picture)
    if "A" in picture.getbands() or "transparency" in picture.info:
        layer = picture.convert("RGBA")
        ground = Image.new("RGBA", layer.size, "white")
        picture = Image.alpha_composite(ground, layer)
    elif picture.mode.startswith("I;16"):
        # Sixteen bits a pixel; a plain conversion would cut the upper half off.
        picture = picture.point(lambda level: level / 256.0).convert("L")
    out = io.BytesIO()
    picture.convert("RGB").save(out, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return out.getvalue()
