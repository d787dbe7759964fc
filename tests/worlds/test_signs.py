"""Signs: words that can be read, and nothing else that carries words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from unilavira_drake.errors import ScenarioError
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.panels import panel_quads
from unilavira_drake.worlds.signs import MOST_LETTERS, sign_picture
from unilavira_drake.worlds.world import Panel, World

WORDS = "Kitchen closed. Use the other door."
BLACK = np.zeros(3, np.float32)
FILE = """
name: small
rooms:
- {{name: den, kind: study, rectangle: [0, 0, 4, 4], floor: oak, walls: cream_paint}}
panels:
- {{name: one, category: {category}, color: black, room: den, position: [0, 2], size: [1.2, 0.6],
   text: {text!r}}}
"""


def read(folder: Path, category: str, text: str) -> World:
    file = folder / "small.yaml"
    file.write_text(FILE.format(category=category, text=text), encoding="utf-8")
    return load_world(str(file))


@pytest.mark.parametrize("text", ["EXIT", WORDS, "word " * 30])
def test_the_words_are_dark_on_light_and_as_large_as_they_fit(text: str) -> None:
    image = sign_picture(text, 240, 480, BLACK)
    assert image.shape == (240, 480, 3)
    assert image.dtype == np.float32
    assert 0.0 <= image.min() < 0.2
    assert 0.9 < image.max() <= 1.0
    inner = image[12:-12, 12:-12, 0] < 0.5
    rows, columns = np.nonzero(inner)
    assert inner.mean() > 0.02
    # Inside the frame, and reaching near to two of its sides.
    assert rows.min() > 2
    assert columns.min() > 2
    assert max(np.ptp(rows) / 216, np.ptp(columns) / 456) > 0.6


def test_another_text_is_another_picture() -> None:
    first, second = (sign_picture(text, 120, 240, BLACK) for text in ("left", "right"))
    assert np.array_equal(first, sign_picture("left", 120, 240, BLACK))
    assert not np.array_equal(first, second)


def test_a_sign_hangs_on_its_wall_and_keeps_its_words_in_a_mirrored_world(tmp_path: Path) -> None:
    sign = read(tmp_path, "sign", WORDS).object("one")
    assert sign is not None
    assert isinstance(sign.visual, Panel)
    assert (sign.category, sign.solid, sign.visual.text) == ("sign", False, WORDS)
    front = panel_quads(sign.visual)[0].image
    mirrored = load_world(str(tmp_path / "small.yaml"), mirror=True).object("one")
    assert mirrored is not None
    assert isinstance(mirrored.visual, Panel)
    assert np.array_equal(panel_quads(mirrored.visual)[0].image, front)


@pytest.mark.parametrize(
    ("category", "text"),
    [("sign", ""), ("sign", "  "), ("picture", WORDS), ("sign", "x" * (MOST_LETTERS + 1))],
)
def test_only_signs_say_something_and_not_too_much(
    tmp_path: Path, category: str, text: str
) -> None:
    with pytest.raises(ScenarioError, match="a sign says something in at most 160 letters"):
        read(tmp_path, category, text)
