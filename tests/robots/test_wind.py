"""Gusts against the statistics of their process; drag against its formula."""

import numpy as np
from pydrake.systems.analysis import Simulator
from simulated_quadrotor import hovering

from unilavira_drake import load_scenario
from unilavira_drake.robots.gusts import next_gust, normal
from unilavira_drake.robots.wind import Wind, WindModel
from unilavira_drake.station import make_navigation_station


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


def test_a_mirrored_world_has_mirrored_gusts():
    ends = []
    for mirrored in (False, True):
        model = WindModel(speed=1.0, gusts=1.0, seed=3, mirrored=mirrored)
        wind = Wind(model=model, linear_drag=0.2, quadratic_drag=0.1, period=0.01)
        context = wind.CreateDefaultContext()
        wind.GetInputPort("body_state").FixValue(context, np.zeros(13))
        for k in range(50):
            context.SetTime(0.01 * k)
            context.SetDiscreteState(wind.EvalUniquePeriodicDiscreteUpdate(context))
        ends.append(wind.GetOutputPort("wind").Eval(context))
    np.testing.assert_array_equal(ends[0] * [1, -1, 1], ends[1])
    assert ends[0][1] != 0.0


def test_a_clone_of_a_station_in_gusts_meets_the_same_gusts():
    small = "robot: !Quadrotor {image_width: 96, image_height: 72}\n"
    station = make_navigation_station(load_scenario("flat", small + "flight: {wind: {gusts: 0.8}}"))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    x, y, _ = station.GetOutputPort("cheat_X_WB").Eval(context).translation()
    setpoint = np.array([x, y, 1.2, 0.0, 0.0, 0.0, 0.0])
    station.GetInputPort("base_command").FixValue(context, setpoint)
    simulator.AdvanceTo(2.0)
    clone = Simulator(station, context.Clone())
    ends = []
    for one in (simulator, clone):
        one.AdvanceTo(3.0)
        pose = station.GetOutputPort("cheat_X_WB").Eval(one.get_context())
        ends.append(pose.GetAsMatrix34())
    np.testing.assert_array_equal(*ends)
    assert np.abs(ends[0][:2, 3] - [x, y]).max() > 1e-4


def test_the_same_seed_has_the_same_gusts_and_another_others():
    flights = [hovering(wind=WindModel(gusts=1.0, seed=seed)) for seed in (1, 1, 2)]
    ends = [flight.fly(1.0)[-1] for flight in flights]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])
