"""The pose estimate: exact by default, else wrong as configured, from a seed, in the Context."""

import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from unilavira_drake.robots.localization_config import PoseEstimateConfig
from unilavira_drake.robots.pose_estimator import PoseEstimator
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.station import make_navigation_station

TRUTH = RigidTransform(RollPitchYaw(0.0, 0.0, 0.7), [1.0, 2.0, 0.0])


class Bench:
    """An estimator of a base that stands still at ``TRUTH`` or moves by its twist alone."""

    def __init__(self, *, seed=0, speed=0.0, **config):
        self.estimator = PoseEstimator(config=PoseEstimateConfig(**config), seed=seed)
        self.simulator = Simulator(self.estimator)
        self.context = self.simulator.get_mutable_context()
        self.estimator.GetInputPort("X_WB").FixValue(self.context, Value[RigidTransform](TRUTH))
        self.estimator.GetInputPort("twist").FixValue(self.context, [0, 0, 0, speed, 0, 0])

    def error(self, time=None):
        if time is not None:
            self.simulator.AdvanceTo(time)
        X = self.estimator.GetOutputPort("pose_estimate").Eval(self.context)
        dx, dy, dz = X.translation() - TRUTH.translation()
        rotation = X.rotation().multiply(TRUTH.rotation().inverse())
        roll, pitch, yaw = RollPitchYaw(rotation).vector()
        assert (dz, roll, pitch) == pytest.approx((0, 0, 0), abs=1e-12)
        return np.array([dx, dy, yaw])


def test_noise_has_its_size_and_is_drawn_each_period():
    bench = Bench(position_noise=0.02, yaw_noise_degrees=1.0)
    errors = np.array([bench.error(0.05 * k + 0.01) for k in range(400)])
    assert errors.std(axis=0) == pytest.approx([0.02, 0.02, math.radians(1.0)], rel=0.15)
    assert abs(errors.mean(axis=0)).max() < 0.004
    assert (bench.error() == bench.error(bench.context.get_time() + 0.02)).all()


def test_drift_grows_with_the_time_of_motion_as_a_random_walk():
    ends = []
    for seed in range(40):
        bench = Bench(seed=seed, speed=0.3, position_drift=0.02, yaw_drift_degrees=2.0, period=3.0)
        ends.append(bench.error(1800.5))
    assert np.std(ends, axis=0) == pytest.approx([0.02, 0.02, math.radians(2.0)], rel=0.35)
    assert not Bench(position_drift=0.02).error(50.0).any()


def test_the_seed_says_all_and_a_clone_goes_on_alike():
    def run(seed):
        return Bench(seed=seed, speed=0.3, position_drift=1.0, position_noise=0.1)

    assert (run(3).error(2.0) == run(3).error(2.0)).all()
    assert not (run(3).error(2.0) == run(4).error(2.0)).all()
    bench = run(3)
    bench.error(1.0)
    twin = Simulator(bench.estimator, bench.context.Clone())
    twin.AdvanceTo(2.0)
    other = bench.estimator.GetOutputPort("pose_estimate").Eval(twin.get_context())
    error = bench.error(2.0)
    assert (other.translation()[:2] - TRUTH.translation()[:2] == error[:2]).all()


def test_a_recalibration_ends_the_drift():
    bench = Bench(speed=0.3, position_drift=5.0)
    assert abs(bench.error(5.0)).max() > 0.01
    count = bench.estimator.GetInputPort("recalibrations")
    count.FixValue(bench.context, [1.0])
    assert not bench.error(5.04).any()
    assert bench.error(8.0).any()


def test_the_station_tells_belief_and_truth_apart():
    overlay = "{pose_estimate: {position_noise: 0.1}, robot: {image_width: 64, image_height: 48}}"
    station = make_navigation_station(load_scenario("flat", overlay))
    simulator = Simulator(station)
    station.GetInputPort("base_command").FixValue(simulator.get_mutable_context(), np.zeros(3))
    simulator.AdvanceTo(0.2)
    believed, true = (
        station.GetOutputPort(name).Eval(simulator.get_context()).translation()
        for name in ("pose_estimate", "cheat_X_WB")
    )
    assert 0.0 < np.hypot(*(believed - true)[:2]) < 0.6
    plain = make_navigation_station(load_scenario("flat"))
    assert not plain.HasInputPort("recalibrations")
