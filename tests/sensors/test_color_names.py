import colorsys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.sensors.color_names import COLOR_WORDS, color_indices, color_table, color_word


@pytest.mark.parametrize(
    ("rgb", "word"),
    [
        ((1, 0, 0), "red"),
        ((1, 0.55, 0), "orange"),
        ((1, 1, 0), "yellow"),
        ((0, 0.5, 0), "green"),
        ((0, 1, 1), "cyan"),
        ((0, 0, 1), "blue"),
        ((0.5, 0, 0.5), "purple"),
        ((1, 0.75, 0.8), "pink"),
        ((0.55, 0.27, 0.07), "brown"),
        ((1, 1, 1), "white"),
        ((0.5, 0.5, 0.5), "gray"),
        ((0, 0, 0), "black"),
    ],
)
def test_focal_colours_have_their_names(rgb, word):
    assert color_word(rgb) == word


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_many_pixels_are_named_like_one(rgb):
    image = np.tile(np.array(rgb, np.uint8), (2, 3, 1))
    indices = color_indices(image)
    assert indices.shape == (2, 3)
    assert {COLOR_WORDS[i] for i in indices.ravel()} == {
        color_word(tuple(value / 255 for value in rgb))
    }


def test_hue_is_the_standard_librarys():
    random = np.random.default_rng(0)
    vivid = [tuple(colorsys.hsv_to_rgb(hue, 0.9, 0.9)) for hue in random.uniform(0, 1, 300)]
    limits = [(13, "red"), (42, "orange"), (70, "yellow"), (165, "green"), (200, "cyan")]
    limits += [(255, "blue"), (305, "purple"), (345, "pink"), (361, "red")]
    for rgb in vivid:
        hue = 360 * colorsys.rgb_to_hsv(*rgb)[0]
        if min(abs(hue - limit) for limit, _ in limits) > 1.0:
            assert color_word(rgb) == next(word for limit, word in limits if hue < limit)


def test_the_table_agrees_at_the_middle_of_each_cell():
    table = color_table()
    random = np.random.default_rng(0)
    cells = random.integers(0, 32, (500, 3))
    rgb = (cells * 8 + 4).astype(np.uint8)
    index = cells[:, 0] << 10 | cells[:, 1] << 5 | cells[:, 2]
    assert np.array_equal(table[index], color_indices(rgb))
    assert not table.flags.writeable
