"""Gusts against the statistics of their process; drag against its formula."""

import numpy as np
from simulated_quadrotor import hovering

from unilavira_drake.robots.gusts import next_gust, normal
from unilavira_drake.robots.wind import Wind, WindModel


def test_the_numbers_are_normal_and_independent():
    numbers = np.array([normal(5, k) for k in range(20000)])
    assert abs(numbers.mean()) < 0.03
    assert abs(numbers.std() - 1.0) < 0.03
    assert abs((numbers**4).mean() - 3.0) < 0.2
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 0.03
    other = np.array([normal(6, k) for k in range(20000)])
    assert abs(np.corrcoef(numbers, other)[0, 1]) < 0.03


def test_gusts_have_their_strength_and_correlation_time():
    gust, rows = np.zeros(3), []
    for count in range(40000):
        gust = next_gust(gust, 1, count, 0.1, 2.0, 1.0)
        rows.append(gust)
    rows = np.array(rows[100:])
    np.testing.assert_allclose(rows.std(axis=0), [2.0, 2.0, 1.0], rtol=0.06)
    apart = [np.corrcoef(rows[:-10, axis], rows[10:, axis])[0, 1] for axis in range(3)]
    np.testing.assert_allclose(apart, np.exp(-1.0), atol=0.06)


def test_the_force_is_the_drag_of_the_relative_air():
    wind = Wind(model=WindModel(speed=3.0), linear_drag=0.2, quadratic_drag=0.1, period=0.01)
    context = wind.CreateDefaultContext()
    state = np.zeros(13)
    state[0], state[10:] = 1.0, [-1.0, 3.0, 0.0]
    wind.GetInputPort("body_state").FixValue(context, state)
    force = wind.EvalUniquePeriodicDiscreteUpdate(context).value(0)
    against = np.array([4.0, -3.0, 0.0])
    np.testing.assert_allclose(force, [0, 0, 0, *((0.2 + 0.1 * 5.0) * against)])


def test_a_clone_meets_the_same_gusts_and_another_seed_others():
    flights = [hovering(wind=WindModel(gusts=1.0, seed=seed)) for seed in (1, 1, 2)]
    ends = [flight.fly(1.0)[-1] for flight in flights]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])
