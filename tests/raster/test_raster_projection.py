"""The pinhole: pixels and depths lead back to the points that were drawn."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from two_cameras import TwoCameras, core, instance, pose, shapes

from unilavira_drake.raster.culling import visible
from unilavira_drake.raster.hiding import TILE, farthest, hidden

ROOM = 4.0
"""Half edge of a cubic room, metres."""


def sides():
    for axis in range(3):
        for sign in (-1, 1):
            size, middle = [2 * ROOM + 1.0] * 3, [0.0] * 3
            size[axis], middle[axis] = 0.5, sign * (ROOM + 0.25)
            yield instance(Box(*size), RigidTransform(middle), f"{axis}{sign}", label=3)


def rays():
    """Returns (H, W, 3) directions in C, z = 1, through the middles of pixels."""
    info = core().intrinsics()
    u, v = np.meshgrid(np.arange(info.width()) + 0.5, np.arange(info.height()) + 0.5)
    x, y = (u - info.center_x()) / info.focal_x(), (v - info.center_y()) / info.focal_y()
    return np.stack((x, y, np.ones_like(x)), axis=-1)


CUBE = TwoCameras(shapes(*sides()), vtk=False)
INSIDE = st.floats(-3.5, 3.5)


@given(INSIDE, INSIDE, INSIDE, st.floats(-3.2, 3.2), st.floats(-1.5, 1.5))
@settings(derandomize=True, deadline=None, max_examples=25)
def test_every_pixel_leads_back_to_its_point(x, y, z, yaw, pitch):
    X_WC = pose(x, y, z, yaw, pitch)
    CUBE.look(X_WC)
    (depth,) = CUBE.ours("depth_image_32f")
    seen = np.isfinite(depth) & (depth > 0)
    p_C = (rays() * depth[..., None])[seen]
    p_W = p_C @ X_WC.rotation().matrix().T + X_WC.translation()
    beyond = np.abs(np.abs(p_W).max(axis=1) - ROOM)
    assert seen.mean() > 0.9
    assert beyond.max() < 1e-4


BOXES = st.lists(
    st.tuples(*[st.floats(-4, 4)] * 3, *[st.floats(0.05, 2.0)] * 3), min_size=1, max_size=12
)


@given(BOXES, st.integers(0, 2**31))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_no_box_is_called_hidden_or_outside_that_a_pixel_can_see(boxes, seed):
    rng = np.random.default_rng(seed)
    numbers = np.array(boxes)
    middles = numbers[:, :3] + (0, 0, 5.0)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes = turn[None] * numbers[:, None, 3:]
    width, height, focal = 70, 50, 40.0
    clip = np.array(
        [
            [2 * focal / width, 0, 0, 0],
            [0, 2 * focal / height, 0, 0],
            [0, 0, 1, -0.1],
            [0, 0, 1, 0],
        ]
    )
    depth = np.kron(rng.uniform(1, 9, (5, 7)), np.ones((10, 10))).astype(np.float32)
    planes = np.concatenate((clip[3] + clip[:3], clip[3] - clip[:3]))
    inside = visible(planes, middles, axes)
    behind = hidden(farthest(depth), (width, height), clip, middles, axes)
    # Points of each box, by brute force.
    share = rng.uniform(-1, 1, (400, 3))
    for index in range(len(boxes)):
        p = middles[index] + share @ axes[index].T
        p = p[p[:, 2] > 0.11]
        column = np.floor(p[:, 0] / p[:, 2] * focal + width / 2).astype(int)
        row = np.floor(p[:, 1] / p[:, 2] * focal + height / 2).astype(int)
        on = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        if on.any():
            assert inside[index]
            if (p[on, 2] < depth[row[on], column[on]]).any():
                assert not behind[index]


def test_a_box_behind_a_wall_is_hidden_and_one_beside_it_is_not():
    depth = np.full((4 * TILE, 6 * TILE), np.inf, np.float32)
    depth[:, : 3 * TILE] = 2.0
    clip = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 0]])
    middles = np.array([(-2.0, 0, 4.0), (2.0, 0, 4.0), (-0.5, 0, 1.0), (-0.1, 0, 0.0)])
    axes = np.broadcast_to(0.2 * np.eye(3), (4, 3, 3))
    found = hidden(farthest(depth), (6 * TILE, 4 * TILE), clip, middles, axes)
    assert found.tolist() == [True, False, False, False]
