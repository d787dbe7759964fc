from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from unilavira_drake.recording.polylines import arc_length, beside, dashes, stretch, without

STRAIGHT = np.array([[t, float(t), 0.0] for t in range(11)])
"""One metre a second along x."""
EMPTY = np.zeros((0, 3))


def test_a_stretch_ends_where_it_is_cut() -> None:
    np.testing.assert_allclose(
        stretch(STRAIGHT, 1.5, 3.5), [[1.5, 1.5, 0], [2, 2, 0], [3, 3, 0], [3.5, 3.5, 0]]
    )
    np.testing.assert_allclose(stretch(STRAIGHT, -math.inf, math.inf), STRAIGHT)
    assert len(stretch(STRAIGHT, 20.0, 30.0)) == 0
    assert len(stretch(EMPTY, 0.0, 1.0)) == 0


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_what_is_cut_out_and_what_is_left_are_the_whole(a: float, b: float) -> None:
    begin, end = min(a, b), max(a, b)
    left = without(STRAIGHT, ((begin, end),))
    total = sum(arc_length(piece)[-1] for piece in left)
    assert total + (end - begin) == pytest.approx(10.0, abs=1e-9)


def test_nothing_is_left_before_a_cut_at_the_beginning() -> None:
    (left,) = without(STRAIGHT, ((0.0, 4.0),))
    np.testing.assert_array_equal(left, STRAIGHT[4:])


def test_a_lane_is_to_the_left_and_joins_the_ends() -> None:
    lane = beside(STRAIGHT, 0.2)
    np.testing.assert_allclose(lane[[0, -1]], STRAIGHT[[0, -1]])
    np.testing.assert_allclose(lane[2:-2, 2], 0.2)
    standing = np.array([[0.0, 1, 1], [1.0, 1, 1], [2.0, 1, 1]])
    np.testing.assert_allclose(beside(standing, 0.2), standing[:1])
    assert len(beside(EMPTY, 0.2)) == 0


@pytest.mark.parametrize("way", [STRAIGHT, STRAIGHT[::3] * [1.0, 1.0, 0.0]])
def test_dashes_cover_their_share(way: NDArray[np.float64]) -> None:
    pieces = dashes(way, 0.3, 0.2)
    lengths = [arc_length(piece)[-1] for piece in pieces]
    assert lengths[:-1] == pytest.approx([0.3] * (len(pieces) - 1))
    assert sum(lengths) == pytest.approx(0.6 * arc_length(way)[-1], abs=0.3)
    assert pieces[1][0, 1] == pytest.approx(0.5)
    assert dashes(EMPTY, 0.3, 0.2) == ()
