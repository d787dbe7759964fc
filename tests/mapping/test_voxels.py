import copy
import itertools
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mapping.occupancy import DepthView
from unilavira_drake.mapping.voxels import VoxelParameters, integrate_voxels
from unilavira_drake.mapping.voxels_carving import FREE_STEP, HIT_DEPTH, HIT_STEP
from unilavira_drake.messages import Intrinsics, VoxelMap

LENS = Intrinsics(12, 9, 8.0, 8.0, 5.3, 4.1)
HALL = (-1.0, -1.5, 4.0, 3.0)


def attitude(rng):
    """A random rotation."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def looked(voxels, *views, n=0, time=0.0, **named):
    parameters = VoxelParameters(**{"resolution": 0.2, "max_range": 6.0, "stride": 1, **named})
    return integrate_voxels(voxels, views, parameters=parameters, n=n, time=time)


def readings(view, parameters):
    """The ray, the depth up to which it counts and the depth of the hit of each sample."""
    lens, stride = view.intrinsics, parameters.stride
    ray, sight, hit = {}, {}, {}
    for a, v in enumerate(range(stride // 2, view.depth.shape[0], stride)):
        for b, u in enumerate(range(stride // 2, view.depth.shape[1], stride)):
            beam = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
            far = parameters.max_range / np.linalg.norm(beam)
            d = float(view.depth[v, u])
            sky = parameters.far_is_free and d == math.inf
            if sky or 0.0 < d < parameters.saturation:
                ray[a, b] = view.X_WC[:3, :3] @ beam / parameters.resolution
                sight[a, b] = min(d, far)
                if d <= far:
                    hit[a, b] = d
    return ray, sight, hit


def by_hand(view, parameters):
    """What one image says, ray by ray and border by border: {voxel: step}."""
    p = view.X_WC[:3, 3] / parameters.resolution
    ray, sight, hit = readings(view, parameters)
    found = {}
    for (a, b), direction in ray.items():
        near = [(a + i, b + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        end = min(sight[key] for key in near if key in sight)
        borders = [0.0]
        for axis in range(3):
            low, high = sorted((p[axis], p[axis] + end * direction[axis]))
            planes = np.arange(math.ceil(low), math.floor(high) + 1)
            borders += list((planes - p[axis]) / direction[axis])
        for t0, t1 in itertools.pairwise(sorted(t for t in borders if t <= end)):
            if t1 - t0 > 1e-9:
                voxel = np.floor(p + 0.5 * (t0 + t1) * direction)
                found[tuple(int(x) for x in voxel)] = FREE_STEP
    for key, d in hit.items():
        push = HIT_DEPTH / np.linalg.norm(ray[key])
        found[tuple(int(x) for x in np.floor(p + (d + push) * ray[key]))] = HIT_STEP
    return found


def entries(voxels):
    return {
        tuple(int(x) for x in np.array(key) * 32 + index): int(tile[tuple(index)])
        for key, tile in voxels.tiles.items()
        for index in np.argwhere(tile)
    }


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32), stride=st.integers(1, 3), far_is_free=st.booleans())
def test_an_image_is_carved_as_by_hand(seed, stride, far_is_free):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.3, 8.0, (9, 12)).astype(np.float32)
    for value in (0.0, np.nan, np.inf, -1.0):
        depth[rng.random(depth.shape) < 0.05] = value
    X_WC = np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = attitude(rng), rng.uniform(-20, 20, 3)
    view = DepthView(depth, LENS, X_WC)
    named = {"stride": stride, "far_is_free": far_is_free, "saturation": 7.0}
    voxels = looked(VoxelMap(), view, **named)
    parameters = VoxelParameters(resolution=0.2, max_range=6.0, **named)
    assert entries(voxels) == by_hand(view, parameters)


def test_a_hall_with_a_box_is_where_it_is(look, ray_cast, intrinsics):
    box = (2.0, -0.4, 0.0, 2.6, 0.4, 1.2)
    voxels = VoxelMap()
    for yaw in np.arange(0.0, 6.28, 0.5):
        X_WC = look(0.5, 0.5, 1.1, yaw)
        view = DepthView(ray_cast(X_WC, (box,)), intrinsics, X_WC)
        voxels = looked(voxels, view)
    cells = entries(voxels)
    occupied = np.array([voxel for voxel, value in cells.items() if value > 0])
    low, high = occupied * 0.2, occupied * 0.2 + 0.2
    # Every occupied voxel touches a surface.
    walls = np.array([(-1.0, -1.5, 0.0), (4.0, 3.0, 2.6)])
    on_wall = ((low <= walls[:, None] + 1e-3) & (high >= walls[:, None] - 1e-3)).any(axis=(0, 2))
    on_box = ((low <= np.array(box[3:]) + 1e-3) & (high >= np.array(box[:3]) - 1e-3)).all(axis=1)
    assert (on_wall | on_box).all()
    for point in ((1.9, 0.0, 0.9), (0.5, 0.5, 1.1), (3.5, 2.5, 1.3), (0.5, -1.3, 1.1)):
        assert voxels.state(point) == "free"
    for point in ((2.05, 0.0, 0.9), (4.05, 1.0, 1.1), (0.5, 3.05, 1.1), (-1.05, 0.5, 1.1)):
        assert voxels.state(point) == "occupied"
    for point in ((2.3, 0.0, 0.5), (9.0, 0.0, 1.0), (3.0, 0.0, 0.5)):
        assert voxels.state(point) == "unknown"


def test_what_moved_away_is_forgotten_and_what_came_is_known(look, ray_cast, intrinsics):
    box = (2.0, -0.5, 0.0, 2.6, 0.5, 1.6)
    X_WC = look(0.0, 0.0)
    with_box = DepthView(ray_cast(X_WC, (box,)), intrinsics, X_WC)
    without = DepthView(ray_cast(X_WC, ()), intrinsics, X_WC)
    voxels = VoxelMap()
    for _ in range(20):
        voxels = looked(voxels, with_box)
    place = (2.1, 0.1, 0.9)
    assert voxels.state(place) == "occupied"
    voxels = looked(voxels, *[without] * 7)
    assert voxels.state(place) == "free"
    assert voxels.state((4.1, 0.1, 0.9)) == "occupied"
    for _ in range(20):
        voxels = looked(voxels, without)
    voxels = looked(voxels, *[with_box] * 3)
    assert voxels.state(place) == "occupied"


def test_a_floor_that_is_looked_along_is_not_carved_away(look, ray_cast, intrinsics):
    views = []
    for x in np.arange(0.0, 3.0, 0.25):
        X_WC = look(x, 0.6, 0.9)
        depth = ray_cast(X_WC, (), hall=(-1.0, -6.0, 30.0, 6.0), ceiling=9.0)
        views.append(DepthView(depth, intrinsics, X_WC))
    voxels = looked(VoxelMap(), *views, *views[-1:] * 9, max_range=12.0, stride=4)
    floor = voxels.window((18, -3, -1), (60, 3, 0))
    assert (floor > 0).mean() > 0.5
    assert (floor < 0).mean() < 0.02


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 6.0, 65.5])
def test_readings_that_are_none_say_nothing(value, look):
    depth = np.full((9, 12), value, np.float32)
    view = DepthView(depth, LENS, look(0, 0))
    voxels = looked(VoxelMap(), view, saturation=6.0)
    assert (voxels.version, len(voxels.tiles), voxels.rejected) == (1, 0, ())


def test_beyond_the_range_rays_only_free(look):
    view = DepthView(np.full((9, 12), 50.0, np.float32), LENS, look(0, 0))
    cells = entries(looked(VoxelMap(), view))
    assert cells
    assert set(cells.values()) == {FREE_STEP}
    corners = (np.array(list(cells)) + (np.array(list(cells)) < 0)) * 0.2
    assert np.linalg.norm(corners - (0, 0, 0.88), axis=1).max() <= 6.0 + 0.2


def test_maps_share_every_tile_that_did_not_change(look, ray_cast, intrinsics):
    X_WC = look(0.0, 0.0)
    view = DepthView(ray_cast(X_WC, ()), intrinsics, X_WC)
    first = looked(VoxelMap(), view)
    before = {key: tile.copy() for key, tile in first.tiles.items()}
    away = look(400.0, -300.0, 50.0)
    second = looked(first, DepthView(view.depth, intrinsics, away), n=4, time=2.5)
    assert (second.n, second.version, second.time) == (4, 2, 2.5)
    assert len(second.tiles) > len(first.tiles)
    assert all(second.tiles[key] is tile for key, tile in first.tiles.items())
    third = second
    for _ in range(8):
        third = looked(third, view)
    assert all((first.tiles[key] == tile).all() for key, tile in before.items())
    # Once every log-odds is at its limit nothing is copied any more.
    fourth = looked(third, view)
    assert all(fourth.tiles[key] is tile for key, tile in third.tiles.items())
    assert copy.deepcopy(fourth) is fourth
    with pytest.raises(ValueError, match="read-only"):
        fourth.tiles[0, 0, 0][0, 0, 0] = 1
    again = pickle.loads(pickle.dumps(fourth))
    assert entries(again) == entries(fourth)


def test_a_window_is_the_dense_map(look, ray_cast, intrinsics):
    X_WC = look(0.0, 0.0)
    voxels = looked(VoxelMap(), DepthView(ray_cast(X_WC, ()), intrinsics, X_WC))
    low, high = (-7, -40, -3), (36, 9, 15)
    window = voxels.window(low, high)
    assert window.shape == (43, 49, 18)
    cells = {tuple(int(x) for x in i + low): int(window[tuple(i)]) for i in np.argwhere(window)}
    inside = {
        voxel: value
        for voxel, value in entries(voxels).items()
        if all(a <= x < b for a, x, b in zip(low, voxel, high, strict=True))
    }
    assert cells == inside
    voxel = next(iter(cells))
    assert voxels.log_odds(voxel) == cells[voxel]
    assert voxels.voxel(voxels.center(voxel)) == voxel
    assert voxels.window((0, 0, 0), (0, 5, 5)).size == 0


def faulty(look):
    depth = np.ones((9, 12), np.float32)
    good = look(0, 0)
    bent = good.copy()
    bent[0, 0] += 0.1
    far = good.copy()
    far[0, 3] = 1e7
    yield DepthView(depth[0], LENS, good), "floats"
    yield DepthView(depth.astype(np.uint16), LENS, good), "floats"
    yield DepthView(depth[:0], LENS, good), "floats"
    yield DepthView(depth[:5], LENS, good), "12 x 5"
    yield DepthView(depth, Intrinsics(12, 9, 0.0, 8.0, 6.0, 4.0), good), "intrinsics"
    yield DepthView(depth, Intrinsics(12, 9, math.nan, 8.0, 6.0, 4.0), good), "intrinsics"
    yield DepthView(depth, LENS, good * math.nan), "finite"
    yield DepthView(depth, LENS, good[:3]), "finite"
    yield DepthView(depth, LENS, bent), "not a rotation"
    yield DepthView(depth, LENS, far), "origin"


def test_views_that_make_no_sense_are_left_out_and_named(look):
    good = DepthView(np.ones((9, 12), np.float32), LENS, look(0, 0))
    for view, words in faulty(look):
        voxels = looked(VoxelMap(), good, view)
        assert len(voxels.rejected) == 1
        assert "view 1: " in voxels.rejected[0]
        assert words in voxels.rejected[0]
        assert entries(voxels) == entries(looked(VoxelMap(), good))


@pytest.mark.parametrize(
    "named",
    [{"resolution": 0.0}, {"max_range": 1e9}, {"stride": 0}, {"saturation": math.nan}],
)
def test_parameters_that_make_no_sense_are_refused(named):
    with pytest.raises(ValueError, match=r"must be"):
        VoxelParameters(**named)


def test_maps_that_make_no_sense_are_refused(look):
    with pytest.raises(ValueError, match="resolution"):
        VoxelMap(resolution=math.nan)
    with pytest.raises(ValueError, match="32 x 32 x 32"):
        VoxelMap(tiles={(0, 0, 0): np.zeros((3, 3, 3), np.int8)})
    with pytest.raises(ValueError, match=r"0\.5 m"):
        looked(VoxelMap(version=1, resolution=0.5))


@pytest.mark.parametrize("blind", [0.0, np.nan, np.inf, -1.0])
def test_the_time_of_a_map_is_that_at_which_something_was_seen(blind):
    seen = DepthView(np.full((9, 12), 2.0, np.float32), LENS, np.eye(4))
    first = looked(VoxelMap(), seen, time=3.0)
    dead = DepthView(np.full((9, 12), blind, np.float32), LENS, np.eye(4))
    lost = DepthView(seen.depth, LENS, np.full((4, 4), np.nan))
    for views in ((), (dead,), (lost,), (dead, lost)):
        later = looked(first, *views, n=2, time=9.0)
        assert (later.time, later.n, later.version) == (3.0, 2, 2)
        assert later.tiles == first.tiles
    assert looked(first, dead, seen, time=9.0).time == 9.0
    sky = DepthView(np.full((9, 12), np.inf, np.float32), LENS, np.eye(4))
    assert looked(first, sky, far_is_free=True, time=9.0).time == 9.0
