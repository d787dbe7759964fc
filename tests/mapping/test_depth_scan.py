"""The kernels beside the same work in numpy, which the benchmark measures them against."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters, integrate
from unilavira_drake.messages import Intrinsics, OccupancyMap

SIDE = 512
FIRST = (-256, -256)


@pytest.fixture(scope="module")
def peers(benchmark_module):
    return benchmark_module("mapping_peers")


def images(kind, rng, depth):
    """The depth image of a hall, with what a sensor may add."""
    if kind == "noise":
        return (depth * rng.normal(1.0, 0.02, depth.shape)).astype(np.float32)
    if kind == "holes":
        values = np.array([0.0, np.nan, np.inf, -np.inf, -1.0, 1e-30, 1e30, 65.535], np.float32)
        holes = rng.random(depth.shape) < 0.3
        return np.where(holes, rng.choice(values, depth.shape), depth)
    if kind == "random":
        return rng.uniform(0.0, 9.0, depth.shape).astype(np.float32)
    return depth


@settings(
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    st.integers(0, 10**6),
    st.sampled_from(["hall", "noise", "holes", "random"]),
    st.sampled_from([1, 2, 3]),
    st.floats(-math.pi, math.pi),
    st.floats(-0.9, 0.9),
    st.floats(-1.4, 1.4),
    st.floats(-0.3, 1.9),
)
def test_numpy_gives_the_same_map_to_the_last_bit(
    look, ray_cast, peers, seed, kind, stride, yaw, pitch, roll, z
):
    rng = np.random.default_rng(seed)
    lens = Intrinsics(40, 30, 22.0, 26.0, rng.uniform(15, 25), rng.uniform(10, 20))
    parameters = MappingParameters(stride=stride, footprint_radius=0.0, free_step=7)
    known = rng.choice(np.array([-40, -4, 0, 9, 40], np.int8), (SIDE, SIDE))
    origin = (FIRST[1] * 0.05, FIRST[0] * 0.05)
    occupancy = OccupancyMap(version=1, origin=origin, log_odds=known)
    peer = peers.Splat(known.copy(), FIRST, parameters)
    x, y = rng.uniform(-0.9, 2.0, 2).tolist()
    X_WC = look(x, y, z=z, yaw=yaw, pitch=pitch)
    c, s = math.cos(roll), math.sin(roll)
    X_WC[:3, :3] = X_WC[:3, :3] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    boxes = ((2.0, 0.0, 0.7, 3.0, 0.8, 0.75), (0.2, -1.0, 0.0, 0.7, -0.5, 0.5))
    depth = images(kind, rng, ray_cast(X_WC, boxes, intrinsics=lens))
    view = DepthView(depth, lens, X_WC)
    named = {"position": (x, y), "floor_height": 0.0, "n": 1, "time": 0.0}
    occupancy = integrate(occupancy, [view], parameters=parameters, **named)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        peer.integrate(view, 0.0)
    np.testing.assert_array_equal(occupancy.log_odds, peer.log_odds)
