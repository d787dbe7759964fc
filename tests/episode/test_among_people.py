"""An episode among people who cross the robot's way: it reaches its goal and touches nobody."""

from __future__ import annotations

from unilavira_drake import load_scenario, run_episode


def test_the_refrigerator_is_reached_without_a_touch() -> None:
    result = run_episode(load_scenario("apartment_people", "task: {text: '@fridge'}"))
    assert (result.cause, result.success) == ("stopped", True)
    metrics = result.metrics
    assert (metrics.person_contacts, metrics.collisions) == (0, 0)
    assert metrics.person_min_distance_m is not None
    # They did cross its way.
    assert 0.1 < metrics.person_min_distance_m < 1.0
