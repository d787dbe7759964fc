"""Intervals over tasks, against closed forms and simulated truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from unilavira_drake.evaluation.statistics import Estimate, paired_difference, success_rate


def test_the_interval_of_a_share_is_that_of_its_tasks_whatever_their_seeds() -> None:
    # Jeffreys' interval for 5 of 10, from the tables of Brown, Cai and DasGupta (2001).
    one = success_rate({task: [task < 5] for task in range(10)})
    assert (one.mean, one.tasks, one.episodes) == (0.5, 10, 10)
    assert (one.low, one.high) == pytest.approx((0.224, 0.776), abs=5e-4)
    five = success_rate({task: [task < 5] * 5 for task in range(10)})
    assert (five.low, five.high, five.episodes) == (one.low, one.high, 50)


def test_all_and_none_have_an_interval_too() -> None:
    every = success_rate({"a": [True], "b": [True, True]})
    assert (every.mean, every.high) == (1.0, 1.0)
    assert 0.2 < every.low < 0.9
    none = success_rate({"a": [False], "b": [False], "empty": []})
    assert (none.mean, none.low, none.tasks) == (0.0, 0.0, 2)
    assert none.high == pytest.approx(1.0 - every.low)


def test_the_mean_weighs_tasks_not_episodes() -> None:
    assert success_rate({"often": [True] * 9, "once": [False]}).mean == 0.5


def test_nothing_gives_nothing() -> None:
    for estimate in (success_rate({}), paired_difference({})):
        assert estimate.tasks == estimate.episodes == 0
        assert math.isnan(estimate.mean)
    alone = paired_difference({"a": [(1, 0), (1, 1)]})
    assert (alone.mean, alone.tasks, alone.episodes) == (0.5, 1, 2)
    assert math.isnan(alone.low)


def test_equal_pairs_differ_by_exactly_nothing() -> None:
    pairs = {task: [(1.0, 1.0), (0.0, 0.0)] for task in range(6)}
    assert paired_difference(pairs) == Estimate(0.0, 0.0, 0.0, 6, 12)


def test_the_bootstrap_holds_the_true_difference_about_as_often_as_it_says() -> None:
    random = np.random.default_rng(5)
    held = 0
    for trial in range(100):
        pairs = {
            task: [(float(random.random() < 0.8), float(random.random() < 0.5))]
            for task in range(24)
        }
        estimate = paired_difference(pairs, seed=trial)
        held += estimate.low <= 0.3 <= estimate.high
    assert 88 <= held <= 99


def test_tasks_are_drawn_with_all_their_pairs() -> None:
    # Ten times the episodes of the same four tasks tell nothing more about other tasks.
    few = {task: [(1.0, float(task % 2))] for task in range(4)}
    many = {task: values * 10 for task, values in few.items()}
    one, ten = paired_difference(few), paired_difference(many)
    assert (one.low, one.high, one.mean) == (ten.low, ten.high, ten.mean)
    assert ten.episodes == 40
    swapped = {task: [(b, a) for a, b in values] for task, values in few.items()}
    back = paired_difference(swapped)
    assert (back.low, back.mean, back.high) == pytest.approx((-one.high, -one.mean, -one.low))
