"""Flights: straight distances, ways over and past what stands in the way, and OpenUAV's scores."""

import math

import numpy as np
import pytest

from unilavira_drake.errors import TaskError
from unilavira_drake.evaluation.air_goal import AirGoal, make_goal, path_type
from unilavira_drake.evaluation.goal_area import success_area
from unilavira_drake.evaluation.scoring import GoalField, score, shortest_path
from unilavira_drake.messages import Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.tasks import success_rule
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import Box, LabelEntry, Room, World, WorldObject

HOME = success_rule("aerial_vln")
RELEASED = success_rule("aerial_vln", "uni_lavira")
HOUSE = Box((100.0, 50.0, 5.0), (10.0, 20.0, 10.0))
WALL = Box((50.0, 50.0, 15.0), (4.0, 80.0, 30.0))
WORLD = World(
    name="yard",
    rooms=(Room("yard", "yard", (0.0, 0.0, 200.0, 100.0), floor="grass"),),
    objects=(
        WorldObject("house_1", "house", "red", "yard", (HOUSE,)),
        WorldObject("wall_1", "wall", "gray", "yard", (WALL,)),
    ),
    labels={1: LabelEntry("house", "house_1"), 2: LabelEntry("wall", "wall_1")},
    outdoors=True,
)
START = (10.0, 50.0, 5.0)


def goal(text="house_1", rule=HOME):
    found = make_goal(text, WORLD, rule, radius=0.5)
    assert isinstance(found, AirGoal)
    return found


def ended(x, y, z, *, cause="stopped", path=120.0, nearest=None):
    return EpisodeMetrics(x=x, y=y, z=z, cause=cause, path_length=path, min_goal_distance=nearest)


def scored(metrics, rule=HOME, text="house_1"):
    return score(goal(text, rule), metrics, START, Panorama(), rule)


def test_the_distance_is_straight_to_the_nearest_point_of_a_thing():
    assert goal().distance(80.0, 50.0, 5.0) == pytest.approx(15.0)
    assert goal().distance(100.0, 50.0, 30.0) == pytest.approx(20.0)
    assert goal().distance(89.0, 64.0, 13.0) == pytest.approx(math.sqrt(36 + 16 + 9))
    assert goal().distance(100.0, 50.0, 2.0) == 0.0


def test_the_released_code_measures_to_one_point():
    assert goal(rule=RELEASED).distance(80.0, 50.0, 5.0) == pytest.approx(20.0)


def test_points_and_districts_are_goals_too():
    assert goal("30,40,12").distance(30.0, 43.0, 16.0) == pytest.approx(5.0)
    assert goal("30,40").distance(30.0, 43.0, 4.0) == pytest.approx(5.0)
    assert goal("yard").distance(20.0, 20.0, 7.0) == pytest.approx(7.0)
    assert goal("30,40|house_1").distances(30.0, 40.0, 3.0)[0] == pytest.approx(3.0)
    with pytest.raises(TaskError, match="did you mean"):
        goal("hose_1")


def test_the_way_leads_over_or_past_what_is_between():
    straight = goal().distance(*START)
    assert straight == pytest.approx(85.0)
    way = shortest_path(goal(), *START)
    # Around the wall's end at y = 10 and over its top at z = 30, past its inflated edges.
    past = math.dist((10, 50), (47, 9)) + 6.0 + math.dist((53, 9), (95, 40))
    over = math.hypot(38, 26) + 6.0 + math.hypot(41, 21)
    assert straight < way <= min(past, over) + 3.0
    assert way >= math.hypot(38, 25) + 4.0 + math.hypot(43, 20) - 2.0


def test_a_free_way_is_straight():
    assert shortest_path(goal("150,50,5"), 120.0, 50.0, 5.0) == pytest.approx(30.0, abs=0.6)


@pytest.mark.parametrize(
    ("x", "cause", "success"),
    [(76.0, "stopped", True), (75.0, "stopped", True), (74.9, "stopped", False)],
)
def test_a_stop_within_twenty_metres_succeeds(x, cause, success):
    result = scored(ended(x, 50.0, 5.0, cause=cause))
    assert result.success is success
    assert result.navigation_error_m == pytest.approx(95.0 - x)


def test_height_counts():
    assert scored(ended(95.0, 50.0, 29.9)).success is True
    assert scored(ended(95.0, 50.0, 30.1)).success is False


def test_passing_by_is_an_oracle_success():
    result = scored(ended(10.0, 50.0, 5.0, cause="decision_budget", nearest=19.0))
    assert result.success is False
    assert result.oracle_success is True
    assert scored(ended(10.0, 50.0, 5.0, nearest=21.0)).oracle_success is False


def test_spl_does_not_ask_for_the_last_twenty_metres():
    way = shortest_path(goal(), *START)
    flown = scored(ended(90.0, 50.0, 5.0, path=150.0))
    assert flown.spl == pytest.approx((way - 20.0) / 150.0)
    assert flown.shortest_path_m == pytest.approx(way)
    assert scored(ended(90.0, 50.0, 5.0, path=way - 20.0)).spl == 1.0
    assert scored(ended(10.0, 50.0, 5.0)).spl == 0.0


def test_a_start_within_twenty_metres_has_no_spl():
    near = goal("30,50,5")
    result = score(near, ended(20.0, 50.0, 5.0), (20.0, 50.0, 5.0), Panorama(), HOME)
    assert result.success is True
    assert result.spl is None
    assert result.notes


def test_easy_ends_at_two_hundred_and_fifty_metres():
    assert (path_type(250.0), path_type(250.1)) == ("easy", "hard")
    assert scored(ended(90.0, 50.0, 5.0)).path_type == "easy"
    assert goal().path_type(300.0) == "hard"
    assert goal().path_type(math.inf) is None


def test_the_area_of_success_is_what_lies_within_twenty_metres():
    (outline,) = success_area(goal(), HOME)
    assert outline.min(axis=0) == pytest.approx([75.0, 20.0])
    assert outline.max(axis=0) == pytest.approx([125.0, 80.0])
    distances = [goal().distance(x, y, 5.0) for x, y in outline]
    assert np.allclose(distances, 20.0, atol=0.3)


def test_robots_on_the_ground_are_scored_over_the_floor():
    ground = make_goal("house_1", WORLD, success_rule("vln"), radius=0.5)
    assert type(ground) is GoalField
    assert ground.fields[0].space.resolution == 0.25
    assert ground.distance(105.0 + 20.0, 50.0) == pytest.approx(19.5, abs=0.6)


def test_in_a_house_each_floor_has_its_own_goals():
    house = load_world("two_storey")
    both = make_goal("toilet_1|kitchen", house, HOME, radius=0.3)
    for elevation, name in ((2.8, "toilet_1"), (0.0, "kitchen")):
        alone = make_goal(name, house, HOME, radius=0.3)
        here = both.on(elevation)
        assert [target.text for target in here.targets] == [name]
        assert here.places == alone.places == alone.on(elevation).places
        assert here.distance(2.0, 2.0, 1.2) == alone.distance(2.0, 2.0, 1.2)
        assert len(success_area(here, HOME)) == 1
        assert success_area(alone.on(2.8 - elevation), HOME) == ()
