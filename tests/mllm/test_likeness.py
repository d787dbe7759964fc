from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from unilavira_drake.mllm.likeness import content_digest, look, prompt_difference, same_look
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.request import ImagePart


def jpeg(pixels: NDArray[np.uint8], quality: int = 90) -> bytes:
    return bytes(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1])


def picture(seed: int = 0) -> NDArray[np.uint8]:
    fields = np.random.default_rng(seed).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(fields, (320, 240)), dtype=np.uint8)


@pytest.mark.parametrize(
    ("recorded", "asked"),
    [
        ("front: 2.3 m free", "front: 2.4 m free"),
        ("10.0 m", "9.9 m"),
        ("2.34 m", "2.35 m"),
        ("waypoint 3, 45 degrees to the left", "waypoint 3, 50 degrees to the left"),
        ("5 degrees to the left", "straight to the front"),
        ("straight to the front", "5 degrees to the right"),
        ("175 degrees to the right", "straight to the back"),
    ],
)
def test_the_last_shown_digit_may_differ(recorded: str, asked: str) -> None:
    for one, other in ((recorded, asked), (asked, recorded)):
        assert prompt_difference(f"a\n{one}\nb", f"a\n{other}\nb") == ""


@pytest.mark.parametrize(
    ("recorded", "asked"),
    [
        ("front: 2.3 m free", "front: 2.5 m free"),
        ("2.34 m", "2.36 m"),
        ("waypoint 3", "waypoint 4"),
        ("45 degrees to the left", "55 degrees to the left"),
        ("45 degrees to the left", "45 degrees to the right"),
        ("front", "left"),
        ("2.3 m", "far"),
        ("one line", "one line\nand another"),
        ("2.3 m", "2.3 m 2.3 m"),
    ],
)
def test_words_and_larger_differences_are_told_with_their_line(recorded: str, asked: str) -> None:
    difference = prompt_difference(f"same\n{recorded}", f"same\n{asked}")
    assert difference.startswith("line ")
    assert "was" in difference


def test_a_long_line_is_shown_in_part() -> None:
    assert len(prompt_difference("a" * 5000, "b" * 5000)) < 400
    assert prompt_difference("a\nb", "a") == "line 2 was 'b' and is now missing"


def test_another_encoding_or_a_little_noise_looks_the_same() -> None:
    original = picture()
    noise = np.random.default_rng(1).normal(0.0, 3.0, original.shape)
    noisy = np.clip(original + noise, 0, 255).astype(np.uint8)
    shifted = np.roll(original, 1, axis=1)
    for other in (jpeg(original, 60), jpeg(noisy), jpeg(shifted)):
        assert other != jpeg(original)
        assert same_look(look(jpeg(original)), look(other))


def test_another_picture_looks_otherwise() -> None:
    assert not same_look(look(jpeg(picture(0))), look(jpeg(picture(1))))
    assert not same_look(look(jpeg(picture())), look(jpeg(picture()[:, ::-1].copy())))
    assert look(b"no picture") == look(b"") == ""
    assert not same_look("", "")


def test_the_digest_is_of_words_pictures_and_their_order() -> None:
    one, two = ImagePart("a", jpeg(picture(1))), ImagePart("a", jpeg(picture(2)))
    prompts = [
        Prompt("rules", ("text",)),
        Prompt("rules", ("text", one)),
        Prompt("rules", (one, "text")),
        Prompt("rules", (one, two)),
        Prompt("rules", (two, one)),
        Prompt("rules", ("half \ud800",)),
    ]
    assert len({content_digest(prompt) for prompt in prompts}) == len(prompts)
    assert content_digest(prompts[0]) == content_digest(Prompt("rules", ("text",)))
