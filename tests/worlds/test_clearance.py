import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.worlds.clearance import clearance, nearest_obstacle, obstacles
from unilavira_drake.worlds.world import Box, Room, World, WorldObject


def world_of(*boxes):
    things = tuple(WorldObject(name=f"box_{i}", boxes=(box,)) for i, box in enumerate(boxes))
    return World(rooms=(Room("hall", "hall", (-9.0, -9.0, 9.0, 9.0)),), objects=things)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    yaw=st.floats(-4, 4),
    length=st.floats(0.1, 3),
    width=st.floats(0.1, 3),
    x=st.floats(-4, 4),
    y=st.floats(-4, 4),
)
def test_clearance_equals_dense_sampling_of_the_outline(yaw, length, width, x, y):
    box = Box((0.5, -0.3, 0.5), (length, width, 1.0), yaw)
    found = float(clearance(world_of(box), np.array([[x, y]]))[0])
    s = np.linspace(-0.5, 0.5, 201)
    local = np.stack(np.meshgrid(s * length, s * width), -1).reshape(-1, 2)
    c, n = math.cos(yaw), math.sin(yaw)
    outline = local @ np.array([[c, n], [-n, c]]) + np.array([0.5, -0.3])
    brute = float(np.hypot(*(outline - [x, y]).T).min())
    assert found <= brute + 1e-9
    assert found >= brute - 0.02


def test_a_lintel_stops_no_robot():
    world = world_of(Box((0, 0, 2.3), (1, 1, 0.4)), Box((3, 0, 0.5), (1, 1, 1)))
    assert [name for name, _ in obstacles(world)] == ["box_1"]
    assert nearest_obstacle(world, 0.0, 0.0) == ("box_1", pytest.approx(2.5))
