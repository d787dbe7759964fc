"""The agent in flight: five views, a view that cannot be grounded, directions instead, a stop."""

from __future__ import annotations

import json
import math

import pytest
from dummy_levels import ScriptedModel, language_action, plan, run_until_stop, select, verdict
from flying_body import BOXES, SIDE, START, make_flight_ring
from pydrake.systems.framework import Diagram

from unilavira_drake.messages import DIRECTIONS, DOWN
from unilavira_drake.mllm.prompt import compose_prompt

TASK = "Fly to the tower. The target is 40 m at 90 degrees to your left."
BLOCK = "REASON ON DIRECTIONS"


def decide(tool: str, **argument: object) -> str:
    return json.dumps(
        {
            "progress_analysis": "", "reasoning_todo": "", "todo_updates": [],
            "reasoning_action": "", "action": {"tool": tool, **argument}, "scene": "a street",
        }
    )  # fmt: skip


SCRIPT = {
    1: plan("fly to the tower"),
    2: decide("turn", direction="left", climb=None),  # vision finds nothing
    3: decide("fly", bearing=90.0, distance=12.0, climb=5.0),
    4: decide("turn", direction="front", climb=None),  # grounded: the tower
    5: decide("turn", direction="down", climb=None),
    6: decide("backtrack", waypoint=2),
    7: decide("turn", direction="down", climb=8.0),
    8: decide("fly", bearing=0.0, distance=5.0, climb=0.0),  # not offered: asked again
    (8, 1): decide("double_check"),
    9: verdict(True),
}
NOTHING = json.dumps(
    {"target_desc": "", "box": None, "point": None, "confidence": None, "reason": "only houses"}
)


@pytest.fixture(scope="module")
def flown() -> tuple[ScriptedModel, ScriptedModel, Diagram, object]:
    language = ScriptedModel(SCRIPT)
    middle = select(SIDE / 2, SIDE / 2)
    vision = ScriptedModel({2: NOTHING, 4: select(26.0, SIDE / 2), 7: middle}, default=middle)
    diagram = make_flight_ring(language, vision, TASK)
    simulator = run_until_stop(diagram)
    return language, vision, diagram, simulator


def test_the_episode_ends_with_the_stop(flown) -> None:
    language, _, diagram, simulator = flown
    assert language_action(diagram, simulator.get_context()).n == 9
    assert [r.call for r in language.requests if not r.attempt] == [
        "plan_todo", "decide", "decide", "decide", "decide", "decide", "recover", "decide",
        "double_check",
    ]  # fmt: skip
    assert "fly is offered only" in language.request(8, 1).feedback


def test_every_prompt_shows_five_views(flown) -> None:
    for request in flown[0].requests:
        assert [view.direction for view in request.variables.views] == [*DIRECTIONS, DOWN]
        text = compose_prompt(request).text
        assert "View down: free distance" in text
        assert "you look at five views" in text
        assert "four views" not in text
    directions = [request.variables.direction for request in flown[1].requests]
    assert directions == ["left", "front", "down", "down"]
    assert all(request.variables.in_flight for request in flown[1].requests)


def test_the_direction_block_is_there_exactly_when_grounding_failed(flown) -> None:
    for request in flown[0].requests:
        grounding_failed = request.variables.outcome.startswith("failed: no target")
        assert grounding_failed is (request.n == 3)
        assert (request.variables.bearings is not None) is grounding_failed
        text = compose_prompt(request).text
        assert (BLOCK in text) is grounding_failed
        assert ('{"tool": "fly"' in text) is grounding_failed


def test_the_block_tells_poses_the_stated_goal_and_free_distances(flown) -> None:
    request = flown[0].request(3)
    assert request.variables.bearings.now == (0.0, 0.0, 0.0, 0.0)
    assert request.variables.bearings.goal_distance == 40.0
    assert request.variables.bearings.goal_bearing == 90.0
    text = compose_prompt(request).text
    assert "the goal is 40.0 m from here along the ground, 90 degrees to the left" in text
    assert "front 30.0 m" in text
    assert "down 10.0 m" in text


def test_it_flies_by_numbers_and_then_by_what_vision_marked(flown) -> None:
    waypoints = {w.id: w for w in flown[0].requests[-1].variables.waypoints}
    assert len(waypoints) == 5
    last = {w.id: w for w in flown[0].request(4).variables.waypoints}
    assert last[1].distance == pytest.approx(12.0, abs=0.1)
    assert last[1].height == -5.0
    assert last[1].tried == (
        "left: failed: no target: only houses",
        "left: arrived at waypoint 2",
    )
    decisions = [d.text for d in flown[0].request(4).variables.decisions]
    assert "at waypoint 1: fly 12 m at 90 degrees to the left, 5 m up: arrived" in decisions


def test_a_way_straight_down_is_excluded_after_coming_back(flown) -> None:
    # Waypoint 2 was left by its front view, waypoint 3 by its down view.
    assert flown[0].request(7).variables.failed_direction == "front"
    tried = {w.id: w.tried for w in flown[0].request(7).variables.waypoints}
    assert tried[3] == ("down: arrived at waypoint 4",)


def test_the_aircraft_keeps_off_the_tower_and_the_ground(flown) -> None:
    _, _, diagram, simulator = flown
    body = diagram.GetSubsystemByName("body")
    state = body.state(body.GetMyContextFromRoot(simulator.get_context()))
    (x0, y0, _), (x1, y1, top) = BOXES[1]
    x, y, z = state.position
    inside = x0 < x < x1 and y0 < y < y1 and z < top
    assert not inside
    assert z == pytest.approx(START[2] + 5.0 + 8.0, abs=0.1)
    assert math.isfinite(x)
