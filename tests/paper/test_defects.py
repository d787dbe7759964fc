"""Four defects that an agent of this kind is known for, each in a real episode that would show it.

Everything is the real thing but the two models, whose replies are a test's own.
"""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F
from scripted_episode import Script, ask_to_stop, gap, play, turn, verdict

from unilavira_drake.messages import OccupancyMap, Panorama
from unilavira_drake.messages.metrics import CAUSES
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.planning.system import BUDGET_BASE, FastMarchingPlanner
from unilavira_drake.ports import Level, image_input, message_input, pose_input

START = (2.0, 5.0)
HALL = (
    f"ablation: no_tdm\ntask: {{text: Go on., start: '{START[0]},{START[1]},0', goal: '4.8,5.0'}}\n"
)
"""The robot stands in the corridor and looks along it; without a list the first call decides."""


def test_the_first_decision_leads_to_where_its_target_is() -> None:
    """The very first choice is *front*, its target 2.8 m ahead on free floor.

    A planner whose map does not hold the first panorama yet finds no free floor anywhere, and the
    goal collapses onto the robot.
    """
    target = (4.8, 4.8)
    script = Script({1: turn("front"), 2: ask_to_stop(), 3: verdict(True)}, marks={1: target})
    played = play(script, HALL)
    goal = played.of("goal")[0]
    assert (goal.n, goal.kind) == (1, "go")
    assert gap(goal.p_WG, target) < 0.1
    kinds = [(kind, message.n) for _, kind, message in played.messages if hasattr(message, "n")]
    assert kinds.index(("map", 1)) < kinds.index(("navigation_status", 1))
    # Where it really went, not where it says that it went.
    assert gap(played.track()[0], START) < 0.1
    assert gap(played.position_at("panorama", 2), target) < 0.35
    assert played.result.metrics.path_length_m == pytest.approx(2.8, abs=0.4)
    assert script.told(2).outcome.startswith("arrived")
    assert played.result.success


class ClosedRoom(Level):
    """A mapper that knows a small closed room around the start, and free floor behind its walls."""

    def __init__(self) -> None:
        super().__init__(OccupancyMap(), period=0.1)
        self._panorama = message_input(self, "panorama", Panorama())
        image_input(self, "front.depth_image", ImageDepth32F)
        pose_input(self, "front.X_BC")
        pose_input(self, "pose_estimate")
        self.declare_output("map", lambda state: state, OccupancyMap())

    def step(self, context: Context, state: OccupancyMap) -> OccupancyMap:
        n = self._panorama(context).n
        if n == state.n:
            return state
        log_odds = np.full((80, 200), -20, np.int8)
        log_odds[[0, 1, -2, -1]] = 20
        log_odds[:, 56:60] = log_odds[:, 0:4] = 20
        return OccupancyMap(n=n, version=n, origin=(0.0, 3.0), log_odds=log_odds)


def test_a_goal_that_cannot_be_reached_is_reported_and_the_robot_is_sent_nowhere() -> None:
    """No other goal takes the place of one to which there is no way: the model is told."""
    script = Script({1: turn("front"), 2: ask_to_stop(), 3: verdict(True)}, marks={1: (4.8, 4.8)})
    played = play(script, HALL, replace={"mapper": ClosedRoom()})
    ended = [status for status in played.of("navigation_status") if status.n == 1]
    assert [(status.state, status.reason) for status in ended] == [("failed", "unreachable")]
    assert played.result.metrics.path_length_m < 0.01
    assert np.ptp(played.track(), axis=0).max() < 0.01
    told = script.told(2)
    assert told.outcome == "failed: unreachable"
    assert told.last_action == "at waypoint 1: turn front to 'floor 1': failed: unreachable"
    assert told.failed_edges == ("waypoint 1, front: failed: unreachable",)
    assert 'did not succeed: "failed: unreachable"' in compose_prompt(script.asked(2)).text
    # The robot has not moved: the views are those of before, and no place was added.
    assert [note.id for note in told.waypoints] == [1]
    assert script.asked(2).images[-4:] == script.asked(1).images[-4:]


def test_a_leg_that_takes_too_long_stays_in_the_history() -> None:
    """A leg that is given up on its way keeps its decision, and the places at both of its ends."""
    impatient = FastMarchingPlanner(turning_radius=0.52, travel_factor=0.0)
    far = (START[0] + BUDGET_BASE + 3.0, START[1])
    script = Script(
        {1: turn("front"), 2: ask_to_stop(), 3: verdict(False, "not there yet"), 4: ask_to_stop(),
         5: verdict(True)},
        marks={1: far},
    )  # fmt: skip
    played = play(script, HALL, replace={"planner": impatient})
    stopped_at = played.position_at("panorama", 2)
    assert gap(stopped_at, START) == pytest.approx(BUDGET_BASE, abs=0.5)
    assert gap(stopped_at, far) > 2.0
    for n in (2, 4):
        told = script.told(n)
        assert [note.id for note in told.waypoints] == [1, 2]
        assert told.current_waypoint == 2
        texts = [decision.text for decision in told.decisions]
        assert texts[0].startswith("at waypoint 1: turn front to 'floor 1': failed: travel budget")
        assert told.waypoints[0].tried[0].startswith("front: failed: travel budget")
        assert told.waypoints[0].offered
        text = compose_prompt(script.asked(n)).text
        assert "failed: travel budget" in text
    assert script.told(2).outcome == "failed: travel budget"


def test_whoever_asks_to_stop_again_and_again_is_never_stopped_for_that() -> None:
    """The robot stands at its goal, so that a stop for its persistence would be a success."""
    script = Script(
        otherwise={"decide": ask_to_stop(), "double_check": verdict(False, "no table in view")}
    )
    place = "task: {text: Stop at the table., start: '2.0,4.8,0', goal: '2.4,4.8'}\n"
    played = play(script, f"ablation: no_tdm\n{place}budgets: {{decisions: 6}}")
    calls = [request.call for request in script.requests]
    assert calls == ["decide", "double_check"] * 6
    assert played.result.cause == "decision_budget"
    assert played.result.cause in CAUSES
    assert played.result.success is False
    assert played.result.metrics.navigation_error_m is not None
    assert played.result.metrics.navigation_error_m < 1.0
    assert all(action.tool != "stop" for action in played.of("language_action"))
    # Each rejection is fed back with its reason.
    for n in range(3, 13, 2):
        assert script.told(n).rejection == "no table in view"
        assert 'rejected: "no table in view"' in compose_prompt(script.asked(n)).text
