"""Means over tasks and paired differences, each with an interval of 95 %.

Episodes of one task are alike, whatever their seeds, so tasks are what is counted: an interval
says what other tasks of this kind would bring, and more seeds of the same tasks do not narrow it
beyond that.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from unilavira_drake.messages import Message

CONFIDENCE = 0.95
RESAMPLES = 9999


@dataclass(frozen=True)
class Estimate(Message):
    """A mean with its interval; NaN where there is too little to tell."""

    mean: float = math.nan
    low: float = math.nan
    high: float = math.nan
    tasks: int = 0
    episodes: int = 0


def success_rate(successes: Mapping[Hashable, Sequence[bool]]) -> Estimate:
    """Returns the mean over tasks of the share of successes, with Jeffreys' interval.

    The interval is that of as many trials as there are tasks: it holds at 0 and at 1, and is wide
    enough whatever the seeds of a task have in common (Brown, Cai, DasGupta, "Interval Estimation
    for a Binomial Proportion", 2001).

    Args:
        successes: task -> one value for each of its episodes; tasks without any are left out.
    """
    shares = [float(np.mean(values)) for values in successes.values() if len(values)]
    episodes = sum(len(values) for values in successes.values())
    count, good = len(shares), math.fsum(shares)
    if not count:
        return Estimate()
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = stats.beta.ppf((tail, 1.0 - tail), good + 0.5, count - good + 0.5)
    # By convention the interval reaches the end when all or none succeed.
    low, high = (0.0 if good == 0 else float(low)), (1.0 if good == count else float(high))
    return Estimate(good / count, low, high, count, episodes)


def paired_difference(
    pairs: Mapping[Hashable, Sequence[tuple[float, float]]], *, seed: int = 0
) -> Estimate:
    """Returns the mean of first minus second, with a bootstrap interval over tasks.

    Tasks are drawn with all their pairs (Efron's percentiles; a cluster bootstrap).  With fewer
    than two tasks there is no interval.

    Args:
        pairs: task -> (first, second) for each pair of episodes that differ in nothing else.
        seed: of the resampling.
    """
    differences = np.array(
        [
            np.mean([first - second for first, second in values])
            for values in pairs.values()
            if values
        ]
    )
    episodes = sum(len(values) for values in pairs.values())
    if not len(differences):
        return Estimate()
    mean = float(differences.mean())
    if len(differences) < 2:
        return Estimate(mean, tasks=1, episodes=episodes)
    interval = stats.bootstrap(
        (differences,),
        np.mean,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        method="percentile",
        random_state=np.random.default_rng(seed),
    ).confidence_interval
    return Estimate(mean, float(interval.low), float(interval.high), len(differences), episodes)
