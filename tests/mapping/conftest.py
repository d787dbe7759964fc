"""A ray caster: exact depth images of a hall with boxes, the oracle of the mapping tests."""

import math

import numpy as np
import pytest

from unilavira_drake.messages import Intrinsics

INTRINSICS = Intrinsics(160, 120, 97.0, 97.0, 79.5, 59.5)


def camera_pose(x, y, z=0.88, yaw=0.0, pitch=0.0):
    """(4, 4) pose of a camera that looks along yaw, tilted down by pitch."""
    c, s = math.cos(yaw), math.sin(yaw)
    level = np.array([[s, 0.0, c], [-c, 0.0, s], [0.0, -1.0, 0.0]])
    cp, sp = math.cos(pitch), math.sin(pitch)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    X_WC = np.eye(4)
    X_WC[:3, :3] = level @ tilt
    X_WC[:3, 3] = (x, y, z)
    return X_WC


def cast(X_WC, boxes, hall=(-1.0, -1.5, 4.0, 3.0), ceiling=2.6, intrinsics=INTRINSICS):
    """(H, W) float32 depth of axis-aligned boxes (x0, y0, z0, x1, y1, z1) in a hall."""
    u, v = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
    x = (u - intrinsics.cx) / intrinsics.fx
    y = (v - intrinsics.cy) / intrinsics.fy
    rays = np.stack([x, y, np.ones_like(x)], -1) @ X_WC[:3, :3].T
    p = X_WC[:3, 3]
    rays = np.where(np.abs(rays) < 1e-12, 1e-12, rays)
    low = np.array([hall[0], hall[1], 0.0])
    high = np.array([hall[2], hall[3], ceiling])
    depth = np.maximum((low - p) / rays, (high - p) / rays).min(axis=-1)
    for box in boxes:
        a, b = (np.array(box[:3]) - p) / rays, (np.array(box[3:]) - p) / rays
        enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        hit = (enter < leave) & (enter > 0)
        depth = np.where(hit, np.minimum(depth, enter), depth)
    return depth.astype(np.float32)


@pytest.fixture
def intrinsics():
    return INTRINSICS


@pytest.fixture
def look():
    return camera_pose


@pytest.fixture
def ray_cast():
    return cast
