"""Pictures of every kind as JPEG."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.picture_files import as_jpeg, read_picture


def encoded(picture: Image.Image, form: str, **options: object) -> bytes:
    out = io.BytesIO()
    picture.save(out, form, **options)
    return out.getvalue()


def pixels(jpeg: bytes) -> np.ndarray:
    picture = Image.open(io.BytesIO(jpeg))
    assert picture.format == "JPEG"
    return np.asarray(picture.convert("RGB")).astype(int)


def test_jpeg_is_left_as_it_is(tmp_path: Path) -> None:
    data = encoded(Image.new("RGB", (30, 20), "teal"), "JPEG", quality=17)
    (tmp_path / "any.name").write_bytes(data)
    assert read_picture(tmp_path / "any.name") == data


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L", "LA", "P", "1"])
def test_other_pictures_keep_their_size_and_colours(mode: str) -> None:
    half = Image.new("RGB", (32, 16), "black")
    half.paste((255, 255, 255), (16, 0, 32, 16))
    found = pixels(as_jpeg(encoded(half.convert(mode), "PNG")))
    assert found.shape == (16, 32, 3)
    assert found[:, :12].max() < 12
    assert found[:, 20:].min() > 243


def test_what_is_transparent_becomes_white() -> None:
    clear = Image.new("RGBA", (16, 16), (0, 0, 0, 0))
    assert pixels(as_jpeg(encoded(clear, "PNG"))).min() > 250
    palette = Image.new("P", (16, 16), 3)
    palette.putpalette([0] * 768)
    assert pixels(as_jpeg(encoded(palette, "PNG", transparency=3))).min() > 250


def test_sixteen_bits_a_pixel_keep_their_brightness() -> None:
    levels = np.linspace(0, 65535, 256).astype(np.uint16).reshape(1, 256).repeat(16, axis=0)
    found = pixels(as_jpeg(encoded(Image.fromarray(levels), "PNG")))[8, :, 0]
    np.testing.assert_allclose(found, np.arange(256), atol=4)


def test_of_an_animation_the_first_picture_is_taken() -> None:
    colors = [Image.new("RGB", (16, 16), color) for color in ("red", "blue")]
    data = encoded(colors[0], "GIF", save_all=True, append_images=colors[1:])
    red, green, blue = pixels(as_jpeg(data))[8, 8]
    assert red > 240 > 20 > max(green, blue)


def test_a_picture_is_turned_as_its_camera_was_held() -> None:
    upright = Image.new("RGB", (40, 20))
    exif = Image.Exif()
    exif[0x0112] = 6
    assert pixels(as_jpeg(encoded(upright, "PNG", exif=exif))).shape == (40, 20, 3)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is no picture"),
        (b"GIF89a", "is a damaged picture|is no picture"),
        (encoded(Image.new("RGB", (64, 64)), "PNG")[:60], "is a damaged picture"),
        (encoded(Image.new("RGB", (64, 64)), "JPEG")[:300], "is a damaged picture|is no picture"),
        (encoded(Image.new("1", (10_000, 6_000)), "PNG"), "has 10000 x 6000 pixels"),
    ],
    ids=["empty", "gif head", "cut png", "cut jpeg", "huge"],
)
def test_what_cannot_be_sent_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        as_jpeg(data)
