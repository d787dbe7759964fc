"""Gaps without room to turn: found where there is no other way, and passed straight."""

import dataclasses as dc
import math

import flight_worlds as worlds
import numpy as np
import pytest

from unilavira_drake.messages import Path, VoxelMap
from unilavira_drake.planning.visibility import FlightParameters, make_flight_plan
from unilavira_drake.planning.visibility_gaps import free_beside
from unilavira_drake.planning.visibility_narrow import (
    make_plan,
    near_a_gap,
    out_of_gaps,
    way_is_blocked,
)
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space

RESOLUTION, RADIUS, NARROW = 0.05, 0.30, 0.23
TURNING = 0.27
"""Half the diagonal of the aircraft, metres."""
PARAMETERS = FlightParameters(
    clearance=Clearance(RADIUS, 0.35, 0.25),
    min_altitude=0.4,
    max_altitude=1.9,
    climb_angle=0.5 * math.pi,
    descend_angle=0.5 * math.pi,
    snap_distance=0.5,
    narrow_radius=NARROW,
)
HALF, THICKNESS = 2.4, 0.15


def rooms(angle, doors, resolution=RESOLUTION):
    """A map of a square parted by walls at an angle; each door: place across, along, and width.

    A voxel is occupied whose centre is in a wall or below the floor.
    """
    tiles = math.ceil(4.0 / resolution / 32)
    at = (np.arange(-32 * tiles, 32 * tiles) + 0.5) * resolution
    x, y = np.meshgrid(at, at, indexing="ij")
    u, v = x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)
    solid = (np.abs(u) > HALF) | (np.abs(v) > HALF)
    for across, along, width in doors:
        solid |= (np.abs(u - across) < THICKNESS / 2) & (np.abs(v - along) > width / 2)
    full = np.repeat(np.where(solid, 20, -20)[:, :, None], 64, axis=2).astype(np.int8)
    full[:, :, 31] = 20
    blocks = {}
    for a, b, c in np.ndindex(2 * tiles, 2 * tiles, 2):
        cut = tuple(slice(32 * k, 32 * k + 32) for k in (a, b, c))
        blocks[a - tiles, b - tiles, c - 1] = full[cut].copy()
    return VoxelMap(n=1, version=1, resolution=resolution, tiles=blocks)


def turned(angle, points):
    """Points of the walls' frame in the world."""
    points = np.array(points, float)
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def space_of(voxels):
    return update_space(FlightSpace(clearance=PARAMETERS.clearance), voxels)


def planned(space, start, goal, parameters=PARAMETERS):
    places = (tuple(start), tuple(goal), tuple(start), None)
    return make_plan(space, FlightSpace(), places=places, parameters=parameters)[0]


def corners_are_free(plan, angle, doors):
    """Whether a square of the aircraft's size, nose ahead, is out of the walls all along."""
    for k in plan.narrow:
        a, b = turned(-angle, plan.p_WP[k : k + 2])
        step = (b - a) / np.linalg.norm(b - a)
        side = np.array([-step[1], step[0], 0.0])
        for point in worlds.along(np.array([a, b]), 0.01):
            for p, q in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                u, v, _ = point + 0.19 * (p * step + q * side)
                if any(abs(u - x) < THICKNESS / 2 and abs(v - y) > w / 2 for x, y, w in doors):
                    return False
    return True


@pytest.mark.parametrize("degrees", [0, 90, 180, 12, 30, 45, 67])
@pytest.mark.parametrize("along", [0.013, -0.88, 1.21])
def test_a_door_of_any_direction_is_passed_straight_in_its_middle(degrees, along):
    angle, doors = math.radians(degrees), [(0.0, along, 0.513)]
    space = space_of(rooms(angle, doors))
    start, goal = turned(angle, [(-1.6, 1.5, 1.2), (1.7, -1.2, 0.9)])
    plan = planned(space, start, goal)
    assert (plan.reason, plan.elsewhere, len(plan.narrow)) == ("", False, 1)
    np.testing.assert_allclose(plan.p_WP[[0, -1]], [start, goal], atol=1e-9)
    a, b = turned(-angle, plan.p_WP[plan.narrow[0] : plan.narrow[0] + 2])
    assert a[0] < -0.3
    assert b[0] > 0.3
    assert a[2] == b[2]
    assert abs(math.atan2(b[1] - a[1], b[0] - a[0])) < math.radians(16)
    middle = a + (b - a) * (-a[0] / (b[0] - a[0]))
    assert abs(middle[1] - along) < 0.03
    assert corners_are_free(plan, angle, doors)
    # Everywhere else there is room to turn.
    for k in range(len(plan.p_WP) - 1):
        if k not in plan.narrow:
            points = turned(-angle, worlds.along(plan.p_WP[k : k + 2]))
            off = np.maximum(np.abs(points[:, 0]) - THICKNESS / 2, 0.0)
            beside = np.maximum(doors[0][2] / 2 - np.abs(points[:, 1] - along), 0.0)
            assert np.hypot(off, beside).min() > TURNING


def test_two_gaps_one_after_the_other():
    doors = [(-0.8, 0.6, 0.52), (0.8, -0.9, 0.55)]
    plan = planned(space_of(rooms(0.0, doors)), (-1.8, 0.0, 1.0), (1.8, 0.0, 1.0))
    assert (plan.reason, len(plan.narrow)) == ("", 2)
    for k, (across, along, _) in zip(plan.narrow, doors, strict=True):
        a, b = plan.p_WP[k : k + 2]
        assert a[0] < across < b[0]
        assert abs(a[1] - along) < 0.03
    assert corners_are_free(plan, 0.0, doors)


@pytest.mark.parametrize("degrees", [0, 30, 180])
@pytest.mark.parametrize("across", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("off", [-0.03, 0.03])
def test_who_is_in_a_gap_leaves_it_straight_towards_the_goal(degrees, across, off):
    angle, doors = math.radians(degrees), [(0.0, 0.013, 0.513)]
    space = space_of(rooms(angle, doors))
    start, ahead, behind = turned(
        angle, [(across, 0.013 + off, 1.2), (1.7, -1.2, 1.2), (-1.7, 1.2, 1.0)]
    )
    for goal, way in ((ahead, 1), (behind, -1)):
        plan = planned(space, start, goal)
        assert (plan.reason, plan.elsewhere, plan.narrow) == ("", False, (0,))
        np.testing.assert_allclose(plan.p_WP[[0, -1]], [start, goal], atol=1e-9)
        out = turned(-angle, plan.p_WP[1:2])[0] * way
        assert 0.3 < out[0] < 0.8
        assert abs(out[1] - way * 0.013) < 0.06
        assert (np.diff(turned(-angle, plan.p_WP)[:, 0]) * way > 0).all()


def test_who_is_between_two_gaps_of_which_one_is_behind_leaves_forwards():
    doors = [(-0.8, 0.0, 0.52), (0.8, -0.9, 0.55)]
    plan = planned(space_of(rooms(0.0, doors)), (-0.8, 0.0, 1.0), (1.8, 0.0, 1.0))
    assert (plan.reason, len(plan.narrow), plan.narrow[0]) == ("", 2, 0)
    assert (np.diff(plan.p_WP[:, 0]) > -1e-9).all()


def test_who_is_near_a_wall_or_on_the_floor_is_in_no_gap():
    space = space_of(rooms(0.0, [(0.0, 0.0, 0.8)]))
    for start in ((-1.5, 2.2, 1.0), (-0.2, 1.5, 1.0), (-1.5, 1.0, 0.2), (-0.1, 0.2, 1.0)):
        plan, goal = planned(space, start, (1.5, 1.0, 1.4)), (1.5, 1.0, 1.4)
        usual = make_flight_plan(
            space, position=start, target=goal, viewpoint=start, parameters=PARAMETERS
        )
        np.testing.assert_array_equal(plan.p_WP, usual.p_WP)
        assert (plan.reason, plan.narrow) == ("", ())


def test_a_way_with_room_to_turn_is_the_same_as_without_gaps():
    space = space_of(rooms(0.0, [(0.0, 0.0, 0.8)]))
    start, goal = (-1.5, 1.2, 1.0), (1.5, 1.0, 1.4)
    plan = planned(space, start, goal)
    usual = make_flight_plan(
        space, position=start, target=goal, viewpoint=start, parameters=PARAMETERS
    )
    np.testing.assert_array_equal(plan.p_WP, usual.p_WP)
    assert plan.narrow == ()


@pytest.mark.parametrize("width", [0.0, 0.3, 0.4])
def test_what_is_too_narrow_is_no_gap(width):
    plan = planned(space_of(rooms(0.0, [(0.0, 0.5, width)])), (-1.5, 0.0, 1.0), (1.5, 0.0, 1.0))
    assert plan.reason == "unreachable"


def test_where_one_gap_is_too_narrow_another_one_is_taken():
    """The search keeps less free than a gap needs, and comes to the nearer one first."""
    voxels = rooms(0.0, [(0.0, 0.0, 0.44)])
    wide = rooms(0.0, [(0.0, -1.6, 0.52)])
    tiles = {key: np.minimum(tile, wide.tiles[key]) for key, tile in voxels.tiles.items()}
    both = VoxelMap(n=1, version=1, resolution=RESOLUTION, tiles=tiles)
    plan = planned(space_of(both), (-1.5, 0.1, 1.0), (1.5, 0.1, 1.0))
    assert (plan.reason, len(plan.narrow)) == ("", 1)
    assert abs(plan.p_WP[plan.narrow[0]][1] + 1.6) < 0.03


def test_coarse_voxels_show_no_gaps():
    """Two voxels wide, of which nobody knows where in them its sides are."""
    space = space_of(rooms(0.0, [(0.125, 0.25, 0.5)], 0.25))
    assert planned(space, (-1.2, 0.25, 1.0), (1.4, 0.25, 1.0)).reason == "unreachable"


def test_who_flies_through_no_gaps_ends_where_it_gets():
    space = space_of(rooms(0.0, [(0.0, 0.0, 0.513)]))
    usual = FlightParameters(
        clearance=PARAMETERS.clearance,
        min_altitude=0.4,
        max_altitude=1.9,
        climb_angle=0.5 * math.pi,
        descend_angle=0.5 * math.pi,
        snap_distance=1.5,
    )
    plan = planned(space, (-1.5, 0.0, 1.0), (0.6, 0.0, 1.0), usual)
    assert (plan.reason, plan.elsewhere, plan.narrow) == ("", True, ())
    assert plan.p_WP[-1][0] < -0.3


def test_what_is_free_beside_a_line_is_that_of_the_voxels_seen_as_discs():
    rng = np.random.default_rng(3)
    for _ in range(20):
        cells = np.unique(rng.integers(0, 32, (4, 2)), axis=0)
        tile = np.full((32, 32, 32), -20, np.int8)
        tile[cells[:, 0], cells[:, 1], 20] = 20
        voxels = VoxelMap(n=1, version=1, resolution=0.1, tiles={(0, 0, 0): tile})
        a, b = (np.array([*rng.uniform(0.5, 2.7, 2), 2.0]) for _ in range(2))
        direction = (b - a)[:2] / np.linalg.norm((b - a)[:2])
        expected = 1.0
        for cell in cells:
            off = (cell + 0.5) * 0.1 - a[:2]
            along = off @ direction
            if -0.05 < along < np.linalg.norm(b - a) + 0.05:
                across = abs(direction[0] * off[1] - direction[1] * off[0])
                expected = min(expected, max(across - 0.05, 0.0))
        assert free_beside(space_of(voxels), a, b) == pytest.approx(expected, abs=1e-9)


def test_a_path_through_a_gap_is_blocked_by_what_is_in_the_gap_or_on_the_way_to_it():
    doors = [(0.0, 0.0, 0.513)]
    voxels = rooms(0.0, doors)
    space = space_of(voxels)
    plan = planned(space, (-1.6, 1.2, 1.0), (1.6, 1.2, 1.0))
    path = Path(1, 0, plan.p_WP, narrow=plan.narrow)
    at_start, in_gap = (-1.6, 1.2, 1.0), (0.02, 0.01, 1.0)

    def blocked(place, position):
        tiles = {key: tile.copy() for key, tile in voxels.tiles.items()}
        cell = [math.floor(value / RESOLUTION) for value in place]
        tiles[tuple(c // 32 for c in cell)][tuple(c % 32 for c in cell)] = 20
        later = update_space(space, VoxelMap(n=1, version=2, resolution=RESOLUTION, tiles=tiles))
        return way_is_blocked(later, path, position=position, narrow_radius=NARROW)

    assert not way_is_blocked(space, path, position=at_start, narrow_radius=NARROW)
    assert not blocked((-1.6, -1.5, 1.0), at_start)
    assert blocked((0.0, 0.1, 1.0), at_start)
    on_the_way = 0.5 * (plan.p_WP[0] + plan.p_WP[1])
    assert blocked(on_the_way, at_start)
    assert not blocked(on_the_way, in_gap)


def test_near_and_in_a_gap():
    p_WP = np.array([[-3.0, 1, 1], [-0.5, 0, 1], [0.5, 0, 1], [2.0, 1, 1]])
    path = Path(1, 0, p_WP, narrow=(1,))
    expected = {(-3.0, 1.0): (0, 0), (-0.9, 0.15): (0, 1), (0.0, 0.03): (1, 1), (1.0, 0.3): (0, 0)}
    for (x, y), (inside, near) in expected.items():
        assert out_of_gaps(path, (x, y, 1.0)) == (not inside)
        assert near_a_gap(path, (x, y, 1.0)) == bool(near)
    assert not near_a_gap(Path(1, 0, p_WP), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("across", [0.2, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6])
def test_a_goal_just_behind_a_gap_is_not_overshot(across):
    space = space_of(rooms(0.0, [(0.0, 0.013, 0.513)]))
    plan = planned(space, (-1.6, 1.5, 1.2), (across, 0.013, 1.2))
    assert (plan.reason, plan.elsewhere, len(plan.narrow)) == ("", False, 1)
    end = plan.p_WP[-1]
    assert np.abs(end - [across, 0.013, 1.2]).max() < (0.03 if across >= 0.3 else 0.15)
    assert plan.p_WP[:, 0].max() < max(end[0], 0.35) + 0.026
    # It may arrive there, wherever its estimate puts it.
    path = Path(1, 0, plan.p_WP, narrow=plan.narrow)
    noisy = end + np.random.default_rng(0).normal(0.0, 0.02, (200, 3))
    assert np.mean([out_of_gaps(path, tuple(point)) for point in noisy]) > 0.95
    assert not out_of_gaps(path, (0.1, 0.0, 1.2))


def test_a_narrow_segment_is_one_of_the_path():
    p_WP = np.array([[0.0, 0, 1], [1, 0, 1], [2, 0, 1]])
    assert Path(1, 0, p_WP, narrow=(0, 1)).narrow == (0, 1)
    for k in (-1, 2):
        with pytest.raises(ValueError, match=f"narrow segment {k} "):
            Path(1, 0, p_WP, narrow=(k,))


def test_no_gaps_are_looked_for_that_are_as_wide_as_it_takes_to_turn():
    space = space_of(rooms(0.0, [(0.0, 0.0, 0.3)]))
    places = ((-1.5, 0.0, 1.0), (1.5, 0.0, 1.0), (-1.5, 0.0, 1.0), None)
    for radius, looked in ((NARROW, True), (RADIUS, False)):
        parameters = dc.replace(PARAMETERS, narrow_radius=radius)
        plan, tight = make_plan(space, FlightSpace(), places=places, parameters=parameters)
        assert (plan.reason, bool(tight.voxels.tiles)) == ("unreachable", looked)
