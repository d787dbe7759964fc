"""The colour grounder on synthetic pictures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from unilavira_drake.messages.grounding import Box
from unilavira_drake.sensors.color_names import color_word
from unilavira_drake.sensors.grounder_colors import color_candidates
from unilavira_drake.worlds.palette import PALETTE

WIDTH, HEIGHT = 160, 120
WHOLE: Box = (40.0, 30.0, 120.0, 90.0)
"""With its surroundings all of the view."""


def picture(*things: tuple[str, tuple[int, int, int, int]]) -> NDArray[np.uint8]:
    color = np.full((HEIGHT, WIDTH, 3), 235, np.uint8)
    for word, (u_min, v_min, u_max, v_max) in things:
        color[v_min:v_max, u_min:u_max] = np.array(PALETTE[word]) * 255
    return color


DEPTH = np.full((HEIGHT, WIDTH), 3.0, np.float32)


@pytest.mark.parametrize("word", [w for w in sorted(PALETTE) if w != "white"])
def test_a_thing_is_found_by_its_colour(word: str) -> None:
    assert color_word(PALETTE[word]) == word
    color = picture((word, (50, 40, 90, 70)))
    (found,) = color_candidates(color, DEPTH, f"the {word} sofa", WHOLE)
    assert found.box == pytest.approx((50, 40, 90, 70), abs=1)
    assert found.score == 1.0
    assert found.point is not None
    assert found.point[0] == pytest.approx(70, abs=20)
    assert found.point[1] == pytest.approx(55, abs=2)


@pytest.mark.parametrize("target", ["the sofa", "beige sofa", "sofa beside the red rug", ""])
def test_without_a_colour_of_its_own_nothing_is_found(target: str) -> None:
    assert color_candidates(picture(("red", (50, 40, 90, 70))), DEPTH, target, WHOLE) == []


def test_the_larger_of_two_scores_more() -> None:
    color = picture(("red", (20, 20, 60, 60)), ("red", (100, 20, 120, 60)))
    found = color_candidates(color, DEPTH, "red chair", WHOLE)
    assert sorted(c.score for c in found) == pytest.approx([0.5, 1.0], abs=0.05)


def test_only_the_surroundings_of_the_mark_are_searched() -> None:
    color = picture(("red", (5, 5, 25, 25)), ("red", (80, 60, 100, 80)))
    (found,) = color_candidates(color, DEPTH, "red chair", (85.0, 65.0, 105.0, 85.0))
    assert found.box == pytest.approx((80, 60, 100, 80), abs=1)
    (cut,) = color_candidates(color, DEPTH, "red chair", (94.0, 70.0, 106.0, 80.0))
    assert cut.box[0] == 88.0


def test_things_of_one_colour_are_told_apart_by_depth() -> None:
    color = picture(("blue", (30, 30, 110, 80)))
    depth = DEPTH.copy()
    depth[:, 70:] = 5.0
    found = color_candidates(color, depth, "blue armchair", WHOLE)
    assert sorted(round(c.box[0]) for c in found) == pytest.approx([30, 70], abs=1)


def test_sloping_depth_is_one_thing() -> None:
    rows = np.arange(HEIGHT, dtype=np.float32)[:, None]
    depth = np.repeat(200.0 / (rows + 20.0), WIDTH, axis=1)
    color = picture(("green", (30, 30, 110, 110)))
    assert len(color_candidates(color, depth.astype(np.float32), "green rug", WHOLE)) == 1


def test_a_wall_of_that_colour_is_background() -> None:
    assert color_candidates(picture(), DEPTH, "white door", WHOLE) == []
    nearer = DEPTH.copy()
    nearer[40:100, 60:100] = 2.0
    found = color_candidates(picture(), nearer, "white fridge", WHOLE)
    assert [c.box for c in found] == [pytest.approx((60, 40, 100, 100), abs=1)]


def test_specks_and_patterns_are_no_things() -> None:
    color = picture(("red", (20, 20, 27, 27)), ("red", (60, 40, 100, 80)))
    color[40:80:8, 60:100] = 235  # thin light stripes on the second
    (found,) = color_candidates(color, DEPTH, "red bag", WHOLE)
    assert found.box == pytest.approx((60, 40, 100, 80), abs=2)


@pytest.mark.parametrize("depth", [0.0, np.inf])
def test_pixels_without_a_depth_do_no_harm(depth: float) -> None:
    color = picture(("red", (60, 40, 100, 80)))
    (found,) = color_candidates(color, np.full_like(DEPTH, depth), "red bag", WHOLE)
    assert found.box == pytest.approx((60, 40, 100, 80), abs=1)


@pytest.mark.parametrize("box", [(0.0, 0.0, 1.0, 1.0), (-40.0, -40.0, -20.0, -20.0)])
def test_a_mark_at_the_edge_does_no_harm(box: Box) -> None:
    assert color_candidates(picture(("red", (0, 0, 40, 40))), DEPTH, "red bag", box) == []
