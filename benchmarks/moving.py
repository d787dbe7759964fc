"""How fast a simulation runs while the robot moves, told on a machine that others use, too."""

from __future__ import annotations

from collections.abc import Sequence

Stretch = tuple[float, float]
"""Simulated seconds in which the robot moved, and CPU seconds that they took."""


def speed(runs: Sequence[Sequence[Stretch]]) -> tuple[float, list[float]]:
    """Returns simulated seconds per CPU second, and those of each run by itself.

    A simulation repeats to the last bit.  So whatever two runs of one stretch differ by is what
    other processes took, of caches, memory and clock: the value is made of the least of each
    stretch, as ``timeit`` takes the least of its repetitions.

    Args:
        runs: of the same simulation.

    Raises:
        ValueError: if their simulated seconds differ.
    """
    simulated = {tuple(seconds for seconds, _ in run) for run in runs}
    if len(simulated) != 1:
        raise ValueError("the runs are not of one simulation")
    seconds = sum(simulated.pop())
    least = sum(min(cpu for _, cpu in stretch) for stretch in zip(*runs, strict=True))
    return seconds / least, [round(seconds / sum(cpu for _, cpu in run), 1) for run in runs]
