import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.planning.geodesic import GeodesicField, rasterize

PROPERTY = settings(derandomize=True, deadline=None, max_examples=50)


def oriented(x, y, width, height, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return [
        (x + c * a * width / 2 - s * b * height / 2, y + s * a * width / 2 + c * b * height / 2)
        for a, b in signs
    ]


@PROPERTY
@given(
    st.floats(-2, 2), st.floats(-2, 2), st.floats(0.05, 2), st.floats(0.05, 2), st.floats(-3.2, 3.2)
)  # fmt: skip
def test_inflation_is_the_distance_to_the_box(x, y, width, height, yaw):
    bounds = (-3.0, -2.5, 3.0, 2.5)
    corners = oriented(x, y, width, height, yaw)
    for order in (corners, corners[::-1]):
        space = rasterize([order], bounds=bounds, resolution=0.1, inflation=0.3)
        rows, columns = np.indices(space.free.shape)
        px = space.origin[0] + (columns + 0.5) * 0.1 - x
        py = space.origin[1] + (rows + 0.5) * 0.1 - y
        c, s = math.cos(yaw), math.sin(yaw)
        along, across = np.abs(c * px + s * py), np.abs(-s * px + c * py)
        exact = np.hypot(np.maximum(along - width / 2, 0), np.maximum(across - height / 2, 0))
        clear = np.abs(exact - 0.3) > 1e-9
        np.testing.assert_array_equal(space.free[clear], exact[clear] > 0.3)


def test_boxes_outside_the_grid_do_not_matter():
    boxes = [oriented(9, 9, 1, 1, 0.3), oriented(-9, 0, 1, 1, 0.0), oriented(0, 9, 1, 1, 0)]
    space = rasterize(boxes, bounds=(0, 0, 2, 1), resolution=0.05, inflation=0.2)
    assert space.free.all()
    assert space.free.shape == (20, 40)


def world_with_wall():
    """6 m x 4 m with a wall at x in [2.9, 3.1] that leaves y > 3 open, for a disc of 0.3 m."""
    wall = oriented(3.0, 1.5, 0.2, 3.0, 0.0)
    return rasterize([wall], bounds=(0, 0, 6, 4), resolution=0.05, inflation=0.3)


def test_distances_in_the_open_are_straight():
    space = world_with_wall()
    goal = space.cells_near([oriented(1.0, 1.0, 0.01, 0.01, 0.0)], 0.05)
    field = GeodesicField.to_cells(space, goal)
    for x, y in ((1.0, 3.0), (0.3, 0.3), (2.2, 1.8)):
        assert field.distance(x, y) == pytest.approx(math.dist((x, y), (1, 1)), abs=0.08)


def test_the_way_round_a_corner_has_the_closed_form_length():
    space = world_with_wall()
    field = GeodesicField.to_cells(space, space.cells_near([oriented(1, 1, 0.01, 0.01, 0)], 0.04))
    # A taut string from (1, 1) to (5, 1) around the wall's end inflated by a radius of 0.3 m.
    corner, radius = (2.9, 3.0), 0.3
    tangent = math.sqrt(math.dist((1, 1), corner) ** 2 - radius**2)
    turn = math.atan2(2.0, 1.9) + math.asin(radius / math.dist((1, 1), corner))
    exact = 2 * tangent + 2 * radius * turn + 0.2
    assert exact - 0.05 <= field.distance(5.0, 1.0) <= exact + 0.15
    points = field.path(5.0, 1.0)
    np.testing.assert_array_equal(points[0], (5.0, 1.0))
    assert points[:, 1].max() >= 3.25


def test_unreachable_and_outside_are_infinitely_far():
    wall = oriented(3.0, 2.0, 0.2, 4.0, 0.0)
    space = rasterize([wall], bounds=(0, 0, 6, 4), resolution=0.05, inflation=0.3)
    field = GeodesicField.to_cells(space, space.cells_near([oriented(1, 1, 0.1, 0.1, 0)], 0.1))
    assert math.isinf(field.distance(5.0, 1.0))
    assert math.isinf(field.distance(3.0, 1.0))
    assert math.isinf(field.distance(-1.0, 1.0))
    assert not space.is_free(3.0, 1.0)
    assert not space.is_free(7.0, 1.0)
    assert space.is_free(1.0, 1.0)
    empty = GeodesicField.to_cells(space, np.zeros((0, 2), np.int64))
    assert math.isinf(empty.distance(1.0, 1.0))


@PROPERTY
@given(st.integers(0, 2**31))
def test_distance_lies_between_the_straight_line_and_the_field(seed):
    rng = np.random.default_rng(seed)
    boxes = [oriented(*rng.uniform((0, 0, 0.1, 0.1, 0), (5, 4, 1.5, 1.0, 3))) for _ in range(6)]
    space = rasterize(boxes, bounds=(0, 0, 5, 4), resolution=0.05, inflation=0.2)
    goal = oriented(*rng.uniform((0, 0), (5, 4)), 0.01, 0.01, 0.0)
    cells = space.cells_near([goal], 0.1)
    field = GeodesicField.to_cells(space, cells)
    for x, y in rng.uniform((0, 0), (5, 4), (5, 2)):
        distance = field.distance(x, y)
        if math.isfinite(distance):
            column, row = (int(v) for v in space.point(x, y))
            assert distance >= math.dist((x, y), goal[0]) - 0.15
            assert distance <= field.times[row, column] * 0.05 * 1.02 + 0.08
        else:
            assert len(field.path(x, y)) == 0


def test_fields_are_frozen():
    space = world_with_wall()
    field = GeodesicField.to_cells(space, np.array([[20, 20]]))
    assert not space.free.flags.writeable
    assert not field.times.flags.writeable
