"""Episodes among people who cross the robot's way: it reaches its goal and touches nobody."""

from __future__ import annotations

import pytest

from unilavira_drake import load_scenario, run_episode


# With seed 2 somebody stands in the kitchen, beside the robot and out of its view.
@pytest.mark.parametrize("seed", [0, 2])
def test_the_refrigerator_is_reached_without_a_touch(seed: int) -> None:
    task = f"task: {{text: '@fridge'}}\nrandom_seed: {seed}"
    result = run_episode(load_scenario("apartment_people", task))
    assert (result.cause, result.success) == ("stopped", True)
    metrics = result.metrics
    assert (metrics.person_contacts, metrics.collisions) == (0, 0)
    assert metrics.person_min_distance_m is not None
    # They did cross its way.
    assert 0.05 < metrics.person_min_distance_m < 1.0
