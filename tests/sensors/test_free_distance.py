import math

import numpy as np
import pytest

from unilavira_drake.messages import Frame
from unilavira_drake.sensors.free_distance import axial_distance, free_distance
from unilavira_drake.sensors.rig import pinhole

HEIGHT = 1.0


def camera_pose(yaw=0.4, pitch=0.1745):
    c, s = math.cos(yaw), math.sin(yaw)
    forward = np.array([c * math.cos(pitch), s * math.cos(pitch), -math.sin(pitch)])
    right = np.array([s, -c, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    X_WC[:3, 3] = (3.0, -2.0, HEIGHT)
    return X_WC


def view(boxes, *, yaw=0.4, max_depth=10.0):
    """Depth of axis-aligned boxes (in the frame of the view's heading) above a floor at z = 0,
    by casting every ray against every box."""
    k = pinhole(160, 120, 79.0)
    X_WC = camera_pose(yaw)
    c, s = math.cos(yaw), math.sin(yaw)
    heading = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    v, u = np.indices((k.height, k.width))
    rays = np.stack(((u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u, float)), -1)
    rays = rays @ (heading @ X_WC[:3, :3]).T
    origin = np.array([0.0, 0.0, HEIGHT])
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0, -HEIGHT / rays[..., 2], np.inf)
        for low, high in boxes:
            near = (np.array(low) - origin) / rays
            far = (np.array(high) - origin) / rays
            enter = np.minimum(near, far).max(-1)
            leave = np.maximum(near, far).min(-1)
            hit = (enter <= leave) & (enter > 0)
            depth = np.where(hit, np.minimum(depth, enter), depth)
    depth = np.where(depth > max_depth, np.inf, depth).astype(np.float32)
    return Frame(
        depth=depth,
        color=np.zeros((k.height, k.width, 3), np.uint8),
        label=np.zeros((k.height, k.width), np.int16),
        intrinsics=k,
        X_WC=X_WC,
    )


def free(frame):
    return free_distance(frame, min_height=0.1, max_height=1.4)


def test_an_empty_floor_is_free_to_the_end():
    assert free(view([])) == 10.0


@pytest.mark.parametrize("distance", [1.5, 2.37, 4.0, 7.5])
@pytest.mark.parametrize("yaw", [0.0, 0.4, 3.0, -2.0])
def test_a_wall_ahead_is_found_where_it_stands(distance, yaw):
    wall = ((distance, -5.0, 0.0), (distance + 0.1, 5.0, 2.6))
    assert free(view([wall], yaw=yaw)) == pytest.approx(distance, abs=0.02)


def test_things_beside_the_corridor_are_not_in_the_way():
    left = ((1.5, 0.35, 0.0), (3.0, 1.0, 1.0))
    right = ((1.5, -1.0, 0.0), (3.0, -0.35, 1.0))
    assert free(view([left, right])) == 10.0
    post = ((2.0, 0.2, 0.0), (2.2, 0.4, 1.0))
    assert free(view([left, right, post])) == pytest.approx(2.0, abs=0.02)


def test_lintels_and_thresholds_are_not_in_the_way():
    lintel = ((2.0, -1.0, 1.5), (2.1, 1.0, 2.6))
    threshold = ((2.0, -1.0, 0.0), (2.1, 1.0, 0.08))
    assert free(view([lintel, threshold])) == 10.0


def test_single_wrong_pixels_are_no_obstacle():
    frame = view([])
    depth = np.array(frame.depth)
    depth[50, 80] = 1.0
    depth[0, :] = 0.0
    assert free(Frame(depth=depth, intrinsics=frame.intrinsics, X_WC=frame.X_WC)) == 10.0


def test_a_camera_that_looks_straight_down_says_nothing_is_ahead():
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.diag([1.0, -1.0, -1.0])
    assert free(Frame(X_WC=X_WC)) == 10.0


@pytest.mark.parametrize("width", [160, 640])
@pytest.mark.parametrize("distance", [0.8, 7.0, 12.0, 39.0])
def test_along_an_aircrafts_axis_a_wall_is_as_far_as_it_is(width, distance):
    k = pinhole(width, width * 3 // 4, 90.0)
    frame = Frame(depth=np.full((k.height, k.width), distance, np.float32), intrinsics=k)
    assert axial_distance(frame, max_range=40.0) == pytest.approx(distance, abs=0.011)


def test_beside_the_axis_nothing_is_in_an_aircrafts_way():
    k = pinhole(160, 120, 90.0)
    depth = np.full((k.height, k.width), np.inf, np.float32)
    depth[:, 90:] = 5.0  # from 0.65 m to the right of the axis on
    depth[0, :] = 0.0
    frame = Frame(depth=depth, intrinsics=k)
    assert axial_distance(frame, max_range=40.0) == 40.0
    depth[:, 80:] = 5.0
    assert axial_distance(Frame(depth=depth, intrinsics=k), max_range=40.0) == pytest.approx(5.0)
