import itertools
import math

import numpy as np
import pytest

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.planning.navigation_grid import make_navigation_grid
from unilavira_drake.planning.plan import PlanningParameters, make_plan

PARAMETERS = PlanningParameters()


def two_rooms(mirror=False, door=True):
    """10 m x 4 m, a wall at x = 5 with a door of 1 m at y in [0.5, 1.5]."""
    log_odds = np.full((80, 200), -20, np.int8)
    log_odds[[0, 1, -2, -1]] = 20
    log_odds[:, [0, 1, -2, -1, 99, 100]] = 20
    if door:
        log_odds[10:30, 99:101] = -20
    origin = (0.0, 0.0)
    if mirror:
        log_odds, origin = log_odds[::-1], (0.0, -4.0)
    return OccupancyMap(n=1, version=1, origin=origin, log_odds=log_odds)


def plan(occupancy, position, target, **named):
    return make_plan(
        occupancy,
        position=position,
        target=target,
        viewpoint=position,
        parameters=PARAMETERS,
        **named,
    )


def nearest_obstacle(occupancy, p_WP):
    obstacles = np.argwhere(occupancy.log_odds > 0)[:, ::-1] * 0.05 + occupancy.origin + 0.025
    t = np.linspace(0, 1, 200)[:, None]
    samples = np.concatenate([a + t * (b - a) for a, b in itertools.pairwise(p_WP)])
    return min(np.hypot(*(samples - p).T).min() for p in obstacles)


def test_the_way_leads_through_the_door_with_clearance():
    occupancy = two_rooms()
    found = plan(occupancy, (2.0, 3.0), (8.0, 3.0))
    assert found.reason == ""
    np.testing.assert_array_equal(found.p_WP[0], (2.0, 3.0))
    assert math.dist(found.goal, (8.0, 3.0)) < 0.04
    assert nearest_obstacle(occupancy, found.p_WP) >= PARAMETERS.radius
    through = [math.dist((2, 3), (5, 1.0)) + math.dist((5, 1.0), (8, 3))]
    assert math.dist((2, 3), (8, 3)) < found.length < 1.12 * through[0]
    crossing = np.interp(5.0, found.p_WP[:, 0], found.p_WP[:, 1])
    assert crossing == pytest.approx(1.0, abs=0.1)  # the middle of the door


def test_a_mirrored_map_gives_the_mirrored_path():
    here = plan(two_rooms(), (2.01, 3.02), (8.01, 3.02))
    there = plan(two_rooms(mirror=True), (2.01, -3.02), (8.01, -3.02))
    np.testing.assert_allclose(there.p_WP * (1, -1), here.p_WP, atol=1e-9)


def test_a_known_goal_is_kept_and_a_lost_one_is_snapped_again():
    occupancy = two_rooms()
    kept = plan(occupancy, (2.0, 3.0), (8.0, 3.0), goal=(7.525, 2.525))
    assert kept.goal == pytest.approx((7.525, 2.525))
    again = plan(occupancy, (2.0, 3.0), (8.0, 3.0), goal=(5.0, 3.0))
    assert math.dist(again.goal, (8.0, 3.0)) < 0.04


def test_a_closed_room_is_unreachable():
    assert plan(two_rooms(door=False), (2.0, 3.0), (8.0, 2.0)).reason == "unreachable"


def test_a_robot_at_the_wall_drives_out():
    found = plan(two_rooms(), (2.0, 0.3), (2.0, 2.0))
    assert found.reason == ""
    assert np.all(np.diff(found.p_WP[:, 1]) >= 0)
    inside_wall = plan(two_rooms(), (2.0, 0.08), (2.0, 2.0))
    assert inside_wall.reason == ""


def test_an_empty_map_is_driven_through():
    found = plan(OccupancyMap(), (0.0, 0.0), (3.0, 1.0))
    assert found.reason == ""
    assert found.length == pytest.approx(math.hypot(3, 1), abs=0.1)


def test_targets_outside_the_closed_map_are_refused():
    outside = plan(two_rooms(), (2.0, 3.0), (2.0, 8.0))
    assert outside.reason == "no free space within 1.5 m"  # none that is known or reachable
    lost = plan(two_rooms(), (2.0, 3.0), (1e9, 3.0), goal=(1e9, 3.0))
    assert lost.reason == "no free space within 1.5 m"


def test_slowness_keeps_to_the_middle_of_a_corridor():
    log_odds = np.full((32, 160), -20, np.int8)
    log_odds[[0, 1, -2, -1]] = 20
    occupancy = OccupancyMap(n=1, version=1, log_odds=log_odds)
    found = plan(occupancy, (0.6, 0.5), (7.4, 1.1))
    grid = make_navigation_grid(
        occupancy,
        position=(0.6, 0.5),
        targets=((7.4, 1.1),),
        radius=PARAMETERS.radius,
        turning_radius=PARAMETERS.turning_radius,
    )
    assert np.isfinite(grid.slowness).all()
    middle = found.p_WP[(found.p_WP[:, 0] > 1.5) & (found.p_WP[:, 0] < 6.5)]
    assert len(middle) == 0 or np.all(np.abs(middle[:, 1] - 0.8) < 0.2)
