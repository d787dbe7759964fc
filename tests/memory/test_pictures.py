"""Which pictures of the past are kept and shown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.memory.pictures import (
    LEAST_OF_LEG,
    SAME_LOOK,
    look_difference,
    look_of,
    of_failed_leg,
    shown,
)
from unilavira_drake.messages import KeyPicture


def pictures(count: int) -> tuple[KeyPicture, ...]:
    return tuple(KeyPicture(number=i + 1) for i in range(count))


def test_a_look_is_small_and_tells_a_shift_from_another_view() -> None:
    rng = np.random.default_rng(0)
    wide = np.kron(rng.integers(0, 256, (12, 20, 3)), np.ones((40, 40, 1))).astype(np.uint8)
    view, shifted = wide[:, :640], wide[:, 8:648]
    assert len(look_of(view)) == 32 * 24
    assert look_difference(look_of(view), look_of(view)) == 0.0
    assert look_difference(look_of(view), look_of(shifted)) < SAME_LOOK
    assert look_difference(look_of(view), look_of(wide[:, 160:])) > SAME_LOOK
    assert look_difference(look_of(view), look_of(view)[::-1]) > SAME_LOOK


def test_a_look_differs_by_grey_levels_and_from_nothing_at_all() -> None:
    dark, light = (look_of(np.full((48, 64, 3), level, np.uint8)) for level in (40, 100))
    assert look_difference(dark, light) == pytest.approx(60.0)
    assert look_difference(dark, b"") == 255.0


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 200), st.integers(0, 40))
def test_views_at_waypoints_alone_are_dropped_oldest_first_in_blocks(count: int, keep: int) -> None:
    window = shown(pictures(count), keep)
    assert window == pictures(count)[count - len(window) :]
    assert min(count, keep) <= len(window) <= keep + 3
    assert (count - len(window)) % 4 == 0


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(st.booleans(), max_size=60), st.integers(0, 12))
def test_a_prompt_begins_as_the_one_before_and_keeps_places_longer(
    on_the_way: list[bool], keep: int
) -> None:
    all_of_them = tuple(
        KeyPicture(number=i + 1, direction="left" if way else "")
        for i, way in enumerate(on_the_way)
    )
    before: tuple[KeyPicture, ...] = ()
    for count in range(1, len(all_of_them) + 1):
        window = shown(all_of_them[:count], keep)
        assert min(count, keep) <= len(window) <= keep + 3
        gone = [p for p in (*before, all_of_them[count - 1]) if p not in window]
        assert len(gone) in (0, 4)
        assert [p for p in (*before, all_of_them[count - 1]) if p in window] == list(window)
        if any(not p.direction for p in gone):
            assert not any(p.direction for p in window)
        before = window


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 30), st.integers(0, 30), st.integers(0, 30))
def test_four_pictures_of_a_failed_leg_are_shown_if_it_has_them(
    before: int, length: int, visible: int
) -> None:
    everything = pictures(before + length)
    leg, window = everything[before:], everything[max(0, len(everything) - visible) :]
    chosen = of_failed_leg(leg, window)
    assert set(chosen) <= set(leg)
    assert list(chosen) == sorted(chosen, key=lambda picture: picture.number)
    assert len(set(chosen)) == len(chosen)
    assert set(chosen) >= set(leg) & set(window)
    assert len(chosen) == max(min(length, LEAST_OF_LEG), len(set(leg) & set(window)))
