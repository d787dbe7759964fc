import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from rendered_stairs import frames

from unilavira_drake.errors import PortTypeError
from unilavira_drake.mapping.goal_selector import NO_STAIRS, GoalSelector
from unilavira_drake.mapping.projection import project_to_pixel
from unilavira_drake.messages import (
    Frame,
    Goal,
    History,
    Intrinsics,
    LanguageAction,
    Panorama,
    VisionAction,
    Waypoint,
)
from unilavira_drake.worlds.load import load_world

LENS = Intrinsics(64, 48, 40.0, 40.0, 31.5, 23.5)


def frame(view, fill):
    X_WC = np.eye(4)
    yaw = {"front": 0.0, "left": math.pi / 2}[view]
    c, s = math.cos(yaw), math.sin(yaw)
    X_WC[:3, :3] = [[s, 0, c], [-c, 0, s], [0, -1, 0]]
    X_WC[:3, 3] = (1.0, 2.0, 0.88)
    return Frame(view=view, depth=np.full((48, 64), fill), intrinsics=LENS, X_WC=X_WC)


PANORAMA = Panorama(n=4, first=4, frames=(frame("front", 3.0), frame("left", np.inf)))
HISTORY = History(n=4, current=2, waypoints=(Waypoint(id=1, position=(5, 6, 0), heading=0.7),))


def goal_of(action, vision=None, history=HISTORY, panorama=PANORAMA):
    selector = GoalSelector()
    context = selector.CreateDefaultContext()
    inputs = {
        "language_action": action,
        "vision_action": vision or VisionAction(),
        "history": history,
        "panorama": panorama,
    }
    for name, value in inputs.items():
        selector.GetInputPort(name).FixValue(context, AbstractValue.Make(value))
    return selector.GetOutputPort("goal").Eval(context)


def turn(direction="front"):
    return LanguageAction(n=4, call="decide", tool="turn", direction=direction)


@pytest.mark.parametrize(
    ("action", "goal"),
    [
        (LanguageAction(), Goal(0)),
        (LanguageAction(n=3, tool="stay"), Goal(0)),
        (LanguageAction(n=5, tool="stay"), Goal(0)),
        (LanguageAction(n=4, tool="stop"), Goal(0)),
        (LanguageAction(n=4, tool="stay"), Goal(4, "stay")),
        (LanguageAction(n=4, tool="double_check"), Goal(4, "stay")),
        (LanguageAction(n=4, tool="go_stair", stair="up"), Goal(0)),
        (LanguageAction(n=4, tool="none", reason="bad"), Goal(4, "none", reason="bad")),
        (LanguageAction(n=4, tool="none"), Goal(4, "none", reason="no usable action")),
        (
            LanguageAction(n=4, tool="backtrack", waypoint=1),
            Goal(4, "go", p_WG=(5, 6, 0), heading=0.7),
        ),
        (
            LanguageAction(n=4, tool="backtrack", waypoint=9),
            Goal(4, "none", reason="unknown waypoint 9"),
        ),
        (
            LanguageAction(n=4, tool="backtrack"),
            Goal(4, "none", reason="unknown waypoint None"),
        ),
    ],
)
def test_one_goal_for_each_action(action, goal):
    assert goal_of(action) == goal


def test_a_backtrack_waits_for_the_history():
    action = LanguageAction(n=4, tool="backtrack", waypoint=1)
    assert goal_of(action, history=History(n=3)) == Goal(0)


@pytest.mark.parametrize("n", [0, 3, 5])
def test_a_turn_waits_for_its_vision_action(n):
    vision = VisionAction(n=n, direction="front", box=(20, 20, 40, 30))
    assert goal_of(turn(), vision) == Goal(0)


def test_a_box_becomes_a_point_of_the_world():
    vision = VisionAction(n=4, direction="front", box=(22, 14, 42, 34))
    goal = goal_of(turn(), vision)
    assert (goal.n, goal.kind, goal.heading) == (4, "go", None)
    assert goal.p_WG == pytest.approx((4.0, 2.0, 0.88))


def test_a_point_becomes_a_point_of_the_world():
    goal = goal_of(turn(), VisionAction(n=4, direction="front", point=(51.5, 43.5)))
    assert goal.p_WG == pytest.approx((4.0, 2.0 - 1.5, 0.88 - 1.5))
    assert goal.pixel == (51.5, 43.5)


def test_a_goal_names_the_pixel_that_stands_for_its_box():
    goal = goal_of(turn(), VisionAction(n=4, direction="front", box=(11, 21, 33, 43)))
    assert goal.pixel == (21.5, 31.5)
    x, y, _ = project_to_pixel(goal.p_WG, intrinsics=LENS, X_WC=PANORAMA.frame("front").X_WC)
    assert (x, y) == pytest.approx(goal.pixel)


@pytest.mark.parametrize(
    ("vision", "reason"),
    [
        (VisionAction(n=4, direction="front", reason="no fridge"), "no target: no fridge"),
        (VisionAction(n=4, direction="front"), "no target: nothing was selected"),
        (
            VisionAction(n=4, direction="left", box=(1, 1, 9, 9)),
            "no target: beyond range",
        ),
        (
            VisionAction(n=4, direction="front", box=(70, 1, 90, 9)),
            "no target: outside the image",
        ),
        (
            VisionAction(n=4, direction="back", box=(1, 1, 9, 9)),
            "no target: there is no view 'back'",
        ),
    ],
)
def test_why_there_is_no_goal(vision, reason):
    assert goal_of(turn(), vision) == Goal(4, "none", reason=reason)


def test_the_goal_depends_on_the_messages_alone():
    selector = GoalSelector()
    context = selector.CreateDefaultContext()
    calls = []
    for name, value in {
        "language_action": LanguageAction(n=4, tool="stay"),
        "vision_action": VisionAction(),
        "history": HISTORY,
        "panorama": PANORAMA,
    }.items():
        selector.GetInputPort(name).FixValue(context, AbstractValue.Make(value))
    port = selector.GetOutputPort("goal")
    for time in (0.0, 1.0, 2.0):
        context.SetTime(time)
        calls.append(port.Eval(context))
    assert all(goal is calls[0] for goal in calls)
    assert selector.HasAnyDirectFeedthrough()


def test_another_message_type_is_named():
    selector = GoalSelector()
    context = selector.CreateDefaultContext()
    for name in ("language_action", "vision_action", "history", "panorama"):
        selector.GetInputPort(name).FixValue(context, AbstractValue.Make(History()))
    with pytest.raises(PortTypeError, match=r"language_action.*LanguageAction.*History"):
        selector.GetOutputPort("goal").Eval(context)


def test_stairs_that_are_not_seen_are_told() -> None:
    action = LanguageAction(n=4, tool="go_stair", stair="down")
    for vision, words in (
        (VisionAction(n=4, direction="front", reason="only a wall"), "only a wall"),
        (VisionAction(n=4, direction="front", point=(30.0, 20.0)), "no steps that fall away"),
        (VisionAction(n=4, direction="right", point=(30.0, 20.0)), "there is no view 'right'"),
    ):
        goal = goal_of(action, vision)
        assert goal.kind == "none"
        assert goal.reason.startswith(NO_STAIRS)
        assert words in goal.reason


def test_stairs_begin_where_the_steps_do() -> None:
    stairs = load_world("two_storey").stairs[0]
    (view,) = frames(load_world("two_storey"), [(6.6, 0.8, 0.0, math.pi / 2)], 1.0)
    seen = Panorama(n=4, first=4, frames=(view,))
    action = LanguageAction(n=4, tool="go_stair", stair="up")
    goal = goal_of(
        action, VisionAction(n=4, direction="front", point=(240.0, 140.0)), panorama=seen
    )
    assert goal.kind == "climb"
    assert math.dist(goal.p_WG, (*stairs.foot, 0.0)) < 0.1
    assert goal.heading == pytest.approx(stairs.heading, abs=0.03)


def test_nobody_backtracks_over_stairs() -> None:
    above = History(n=4, current=2, waypoints=(Waypoint(id=1, position=(5, 6, 2.8)),))
    goal = goal_of(LanguageAction(n=4, tool="backtrack", waypoint=1), history=above)
    assert (goal.kind, "another floor" in goal.reason) == ("none", True)
