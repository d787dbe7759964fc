import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from unilavira_drake.mapping.projection import (
    BEYOND,
    EMPTY_BOX,
    NO_DEPTH,
    OUTSIDE,
    project_box,
    project_point,
    project_to_pixel,
    project_to_world,
)
from unilavira_drake.messages import Intrinsics

LENS = Intrinsics(64, 48, 40.0, 41.0, 31.5, 23.5)
PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)


def rotation(a, b, c):
    def about(axis, angle):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        R = np.eye(3)
        R[i, i] = R[j, j] = math.cos(angle)
        R[i, j], R[j, i] = -math.sin(angle), math.sin(angle)
        return R

    return about(2, a) @ about(1, b) @ about(0, c)


def pose(angles, position):
    X_WC = np.eye(4)
    X_WC[:3, :3] = rotation(*angles)
    X_WC[:3, 3] = position
    return X_WC


def box_at(depth, box, max_range=10.0):
    return project_box(box, depth=depth, intrinsics=LENS, X_WC=np.eye(4), max_range=max_range)


def point_at(depth, point, max_range=10.0):
    return project_point(point, depth=depth, intrinsics=LENS, X_WC=np.eye(4), max_range=max_range)


@PROPERTY
@given(
    st.tuples(*[st.floats(-3.1, 3.1)] * 3),
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.tuples(st.floats(0, 63), st.floats(0, 47)),
    st.floats(0.1, 10),
)
def test_back_projection_inverts_projection(angles, position, pixel, depth):
    X_WC = pose(angles, position)
    p_W = project_to_world(pixel, depth, intrinsics=LENS, X_WC=X_WC)
    u, v, d = project_to_pixel(p_W, intrinsics=LENS, X_WC=X_WC)
    assert (u, v, d) == pytest.approx((*pixel, depth), abs=1e-6)


def test_a_point_behind_the_camera_has_no_pixel():
    u, v, d = project_to_pixel((0.0, 0.0, -2.0), intrinsics=LENS, X_WC=np.eye(4))
    assert math.isnan(u)
    assert math.isnan(v)
    assert d == -2.0


def test_a_box_on_a_wall_gives_the_wall_behind_its_centre():
    found = box_at(np.full((48, 64), 3.0, np.float32), (10, 10, 30, 20))
    assert found.pixel == (19.5, 14.5)
    expected = (3 * (19.5 - 31.5) / 40, 3 * (14.5 - 23.5) / 41, 3.0)
    assert found.p_WG == pytest.approx(expected)


def test_the_nearest_solid_surface_wins_over_what_shows_through():
    depth = np.full((48, 64), 6.0, np.float32)
    depth[10:40, 20:40:3] = 2.0  # slats of a chair: a third of the box
    found = box_at(depth, (20, 10, 40, 40))
    assert found.depth == pytest.approx(2.0)
    assert depth[int(found.pixel[1]), int(found.pixel[0])] == 2.0


def test_stray_near_readings_are_not_the_surface():
    depth = np.full((48, 64), 4.0, np.float32)
    depth[20, 30] = 0.3
    assert box_at(depth, (10, 10, 50, 40)).depth == pytest.approx(4.0)
    assert point_at(depth, (30, 20)).depth == pytest.approx(4.0)


def test_the_whole_box_is_searched_when_its_middle_has_no_depth():
    depth = np.full((48, 64), np.nan, np.float32)
    depth[10:30, 10:13] = 2.5
    assert box_at(depth, (10, 10, 50, 30)).depth == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("fill", "reason"),
    [(0.0, NO_DEPTH), (np.nan, NO_DEPTH), (np.inf, BEYOND), (65.5, BEYOND), (-np.inf, NO_DEPTH)],
)
def test_why_there_is_no_depth(fill, reason):
    depth = np.full((48, 64), fill, np.float32)
    assert box_at(depth, (10, 10, 30, 30)).reason == reason
    assert point_at(depth, (20, 20)).reason == reason


@pytest.mark.parametrize(
    ("box", "reason"),
    [
        ((10, 10, 10, 20), EMPTY_BOX),
        ((30, 10, 10, 20), EMPTY_BOX),
        ((-20, 0, -1, 10), OUTSIDE),
        ((64, 0, 80, 10), OUTSIDE),
        ((math.nan, 0, 20, 10), OUTSIDE),
        ((-math.inf, 0, 20, 10), OUTSIDE),
    ],
)
def test_unusable_boxes_are_named(box, reason):
    assert box_at(np.full((48, 64), 3.0, np.float32), box).reason == reason


@pytest.mark.parametrize("point", [(-1, 5), (5, 48), (math.nan, 3), (math.inf, 3)])
def test_points_outside_are_named(point):
    assert point_at(np.full((48, 64), 3.0, np.float32), point).reason == OUTSIDE


@PROPERTY
@given(
    hnp.arrays(np.float32, (12, 16), elements=st.floats(width=32)),
    st.tuples(*[st.floats(-20, 40)] * 4),
)
def test_any_depth_gives_a_point_or_a_reason(depth, box):
    lens = Intrinsics(16, 12, 10.0, 10.0, 7.5, 5.5)
    for found in (
        project_box(box, depth=depth, intrinsics=lens, X_WC=np.eye(4), max_range=5.0),
        project_point(box[:2], depth=depth, intrinsics=lens, X_WC=np.eye(4), max_range=5.0),
    ):
        assert (found.p_WG is None) == bool(found.reason)
        if found.p_WG is not None:
            assert np.all(np.isfinite(found.p_WG))
            assert 0 < found.depth <= 5.0
