"""Goals and scores in a plain room, against closed forms."""

import math

import numpy as np
import pytest

from unilavira_drake.errors import TaskError
from unilavira_drake.evaluation.free_space import (
    centers,
    free_space,
    path_distance,
    quick_distance,
)
from unilavira_drake.evaluation.goal import footprint, resolve_goal
from unilavira_drake.evaluation.scoring import make_goal_field, score, shortest_path
from unilavira_drake.messages import Frame, Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.planning.geodesic import GeodesicField
from unilavira_drake.tasks import SuccessRule, success_rule
from unilavira_drake.worlds.world import Box, LabelEntry, Room, World, WorldObject

RADIUS = 0.30
LABEL = 7


def box(x, y, size_x, size_y):
    return Box(center=(x, y, 0.5), size=(size_x, size_y, 1.0))


def two_rooms(*, mirrored=False):
    """Rooms of 6 x 4 m side by side, a 1 m door between them at y = 2, a table in the right one."""
    sign = -1.0 if mirrored else 1.0
    walls = [box(6, sign * 0.75, 0.1, 1.5), box(6, sign * 3.25, 0.1, 1.5)]
    y_min, y_max = (-4.0, 0.0) if mirrored else (0.0, 4.0)
    return World(
        name="two_rooms",
        rooms=(
            Room("left", "living room", (0.0, y_min, 6.0, y_max)),
            Room("right", "kitchen", (6.0, y_min, 12.0, y_max)),
        ),
        objects=(
            WorldObject("table_1", "table", "red", "right", (box(10, sign * 2, 1, 1),)),
            WorldObject("door_1", "door", "", "left|right", (box(6, sign * 1.45, 0.1, 0.1),)),
        ),
        walls=tuple(walls),
        labels={LABEL: LabelEntry("table", "table_1"), 8: LabelEntry("door", "door_1")},
        mirrored=mirrored,
    )


WORLD = two_rooms()
TABLE = make_goal_field("table_1", WORLD, radius=RADIUS)


def panorama(pixels, label=LABEL):
    image = np.zeros((20, 20), np.int16)
    image.ravel()[:pixels] = label
    return Panorama(n=5, frames=(Frame(view="left"), Frame(view="front", label=image)))


def ended(x, y, *, cause="stopped", path=8.0, nearest=None):
    return EpisodeMetrics(x=x, y=y, cause=cause, path_length=path, min_goal_distance=nearest)


def test_names_resolve_to_instances_rooms_kinds_and_points():
    assert resolve_goal("table_1", WORLD)[0].label == LABEL
    assert resolve_goal("kitchen", WORLD)[0].rooms == ("right",)
    assert resolve_goal(" left | 7.0,1.0,0.5 ", WORLD)[1].point == (7.0, 1.0)
    assert resolve_goal("door_1", WORLD)[0].rooms == ("left", "right")
    assert resolve_goal("living_room", WORLD)[0].rooms == ("left",)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("tabel_1", "'table_1'"),
        ("kitchn", "did you mean"),
        ("", "empty part"),
        ("left|", "empty part"),
        ("1.0,x", "X,Y"),
        ("1,2,3,4", "X,Y"),
        ("nan,1", "X,Y"),
        ("40,1", "outside"),
    ],
)
def test_what_does_not_resolve_is_named_with_a_remedy(text, hint):
    with pytest.raises(TaskError, match="goal") as error:
        resolve_goal(text, WORLD)
    assert hint in str(error.value)


def test_a_mirrored_world_mirrors_the_points_of_a_goal():
    mirrored = two_rooms(mirrored=True)
    assert resolve_goal("7.0,1.0", mirrored)[0].point == (7.0, -1.0)
    there = make_goal_field("7.02,1.02", mirrored, radius=RADIUS).distance(2.0, -2.0)
    here = make_goal_field("7.02,1.02", WORLD, radius=RADIUS).distance(2.0, 2.0)
    assert there == pytest.approx(here, rel=1e-5)


def test_free_space_is_the_room_shrunk_by_the_radius():
    room = World(rooms=(Room("hall", "hall", (0.0, 0.0, 3.0, 2.0)),), walls=(box(0, 1, 0.1, 2),))
    space = free_space(room, radius=RADIUS)
    points = centers(space, np.argwhere(space.free))
    assert points[:, 0].min() == pytest.approx(0.375)
    assert len(points) == 40 * (60 - 7)


def test_pockets_that_cannot_be_reached_are_not_free():
    pocket = World(
        rooms=(Room("hall", "hall", (0.0, 0.0, 6.0, 2.0)),), walls=(box(4.5, 1.0, 0.1, 2.0),)
    )
    space = free_space(pocket, radius=RADIUS)
    assert centers(space, np.argwhere(space.free))[:, 0].max() < 4.5


def test_a_world_without_floor_is_refused():
    full = World(name="full", rooms=(Room("hall", "", (0, 0, 2, 2)),), walls=(box(1, 1, 2, 2),))
    with pytest.raises(TaskError, match="full"):
        free_space(full, radius=RADIUS)


def test_the_footprint_of_a_table_is_a_ring_around_it():
    space = TABLE.fields[0].space
    points = centers(space, footprint(TABLE.targets[0], WORLD, space))
    gaps = np.hypot(
        np.maximum(abs(points[:, 0] - 10) - 0.5, 0), np.maximum(abs(points[:, 1] - 2) - 0.5, 0)
    )
    assert gaps.min() >= RADIUS
    assert gaps.max() <= RADIUS + 0.05 + 0.15
    angles = np.arctan2(points[:, 1] - 2, points[:, 0] - 10)
    assert len(np.unique(np.floor((angles + math.pi) / 0.5))) == 13


def test_the_footprint_keeps_to_the_room_of_the_thing():
    shelf = WorldObject("shelf_1", "shelf", "", "right", (box(6.15, 3.5, 0.2, 0.6),))
    world = World(rooms=WORLD.rooms, walls=WORLD.walls, objects=(shelf,))
    space = free_space(world, radius=RADIUS)
    points = centers(space, footprint(resolve_goal("shelf_1", world)[0], world, space))
    assert points[:, 0].min() > 6.0


def test_a_thing_without_floor_around_it_is_no_goal():
    lamp = WorldObject("lamp_1", "lamp", "", "right", (box(11.9, 2.0, 0.1, 0.1),))
    crates = WorldObject("crates", "crate", "", "right", (box(10.5, 2.0, 2.9, 4.0),))
    world = World(rooms=WORLD.rooms, walls=WORLD.walls, objects=(lamp, crates))
    with pytest.raises(TaskError, match="lamp_1"):
        make_goal_field("lamp_1", world, radius=RADIUS)


def test_distances_in_the_open_are_straight_lines():
    field = make_goal_field("1.0,1.0", WORLD, radius=RADIUS)
    for x, y in ((1.0, 3.0), (4.0, 1.0), (3.0, 3.0), (1.2, 1.1)):
        straight = math.hypot(x - 1, y - 1)
        assert field.distances(x, y) == pytest.approx((straight,), abs=0.06)
        assert field.distance(x, y) == pytest.approx(straight, rel=0.04, abs=0.07)


def test_distances_go_through_the_door():
    field = make_goal_field("8.0,3.5", WORLD, radius=RADIUS)
    # A taut string around the jamb, whose two corners (5.95 and 6.05, 2.5) are rounded.
    away = math.hypot(1.95, 1.0)
    tangent = math.sqrt(away**2 - RADIUS**2)
    wrapped = math.atan2(1.95, 1.0) + math.acos(RADIUS / away)
    taut = 2 * (tangent + RADIUS * (math.pi - wrapped)) + 0.1
    assert field.distances(4.0, 3.5) == pytest.approx((taut,), rel=0.012)
    assert field.distance(4.0, 3.5) == pytest.approx(taut, rel=0.04)


def test_beside_free_floor_the_straight_way_is_added():
    space = free_space(WORLD, radius=RADIUS)
    field = GeodesicField.to_cells(space, np.array([[40, 40]]))
    straight = math.dist((5.80, 0.5), (2.025, 2.025))
    for distance in (path_distance, quick_distance):
        assert distance(field, 5.80, 0.5) == pytest.approx(straight, rel=0.03)
        assert math.isinf(distance(field, 40.0, 2.0))
        assert math.isinf(distance(field, -40.0, -2.0))
        assert math.isinf(distance(field, math.nan, 2.0))


def test_alternatives_count_by_the_nearest():
    field = make_goal_field("table_1|1.0,2.0", WORLD, radius=RADIUS)
    assert field.distance(1.5, 2.0) == pytest.approx(0.5, abs=0.06)
    assert field.distance(9.0, 2.0) < 0.3
    verdict = score(field, ended(1.5, 2.0), (3.0, 2.0), Panorama())
    assert verdict.success
    assert verdict.goal_seen is None


@pytest.mark.parametrize("start", [(10.0, 2.0), (6.0, 1.0), (30.0, 2.0), (-1.0, -1.0)])
def test_a_start_inside_an_obstacle_is_refused(start):
    with pytest.raises(TaskError, match="start"):
        shortest_path(TABLE, *start)


def test_success_needs_the_stop_the_distance_the_room_and_the_view():
    def success(x, y, *, cause="stopped", pixels=60):
        return score(TABLE, ended(x, y, cause=cause), (2.0, 2.0), panorama(pixels)).success

    assert success(9.0, 2.0)
    assert success(7.85, 2.0)
    assert not success(7.5, 2.0)
    assert not success(9.0, 2.0, cause="time_budget")
    assert not success(9.0, 2.0, pixels=59)
    near_the_door = make_goal_field("7.0,2.0", WORLD, radius=RADIUS)
    assert not score(near_the_door, ended(5.8, 2.0), (2.0, 2.0), Panorama()).success
    assert score(near_the_door, ended(6.2, 2.0), (2.0, 2.0), Panorama()).success


def test_the_figures_of_a_straight_run():
    shortest = shortest_path(TABLE, 2.0, 2.0)
    assert shortest == pytest.approx(10 - 0.5 - RADIUS - 0.15 - 2.0, abs=0.1)
    verdict = score(TABLE, ended(8.0, 2.0, path=10.0, nearest=0.4), (2.0, 2.0), panorama(400))
    assert verdict.success
    assert verdict.success_3m
    assert verdict.navigation_error_m == pytest.approx(1.1, abs=0.1)
    assert verdict.spl == pytest.approx(shortest / 10.0)
    assert verdict.oracle_success
    assert verdict.same_room
    assert verdict.goal_seen
    assert verdict.notes == ()


def test_three_metres_stand_beside():
    verdict = score(TABLE, ended(6.5, 2.0, nearest=2.6), (2.0, 2.0), panorama(400))
    assert (verdict.success, verdict.success_3m, verdict.oracle_success) == (False, True, False)
    assert verdict.spl == 0.0


def test_a_start_at_the_goal_has_no_spl():
    field = make_goal_field("right", WORLD, radius=RADIUS)
    verdict = score(field, ended(9.0, 1.0, path=0.0), (8.0, 1.0), Panorama())
    assert verdict.success
    assert verdict.spl is None
    assert "spl" in verdict.notes[0]


def test_an_unscored_task_has_no_verdict():
    verdict = score(None, ended(9.0, 1.0, path=3.0), (2.0, 2.0), Panorama())
    assert (verdict.success, verdict.navigation_error_m, verdict.spl) == (None, None, None)
    assert verdict.path_length_m == 3.0


def test_a_rule_without_room_and_view_asks_for_the_distance_alone():
    near_the_door = make_goal_field("7.0,2.0", WORLD, radius=RADIUS)
    habitat = success_rule("vln", "habitat")

    def success(x, y, rule, goal=TABLE, cause="stopped"):
        return score(goal, ended(x, y, cause=cause), (2.0, 2.0), panorama(0), rule).success

    assert success(7.0, 2.0, habitat)
    assert not success(7.0, 2.0, success_rule("vln"))
    assert not success(7.0, 2.0, habitat, cause="decision_budget")
    assert success(5.8, 2.0, habitat, near_the_door)
    assert not success(5.8, 2.0, success_rule("vln"), near_the_door)


def test_the_radius_of_the_rule_is_that_of_success_and_of_oracle_success():
    field = make_goal_field("1.0,1.0", WORLD, radius=RADIUS)
    away = field.distances(3.0, 1.0)[0]
    for strict in (True, False):
        rule = SuccessRule("exact", away, strict=strict, in_room=False, seen=False)
        for x, y, near in ((3.0, 1.0, not strict), (2.9, 1.0, True), (3.1, 1.0, False)):
            verdict = score(field, ended(x, y, nearest=9.0), (5.0, 1.0), Panorama(), rule)
            assert (verdict.success, verdict.oracle_success) == (near, near)
