"""Where code of this kind departs from the paper's TODO list and second chances, ours does not.

One test for each point; what the paper says stands above it (sections III-C and III-D).
"""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from scripted_episode import Script, ask_to_stop, backtrack, gap, play, turn, verdict

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.language.variables import language_request
from unilavira_drake.memory.config import MemoryConfig
from unilavira_drake.memory.todo import apply_updates
from unilavira_drake.memory.waypoint_system import NUMBERS_PER_WAYPOINT, WaypointMemory
from unilavira_drake.memory.waypoints import MemoryBounds, Sight, WaypointState, remember
from unilavira_drake.messages import (
    DIRECTIONS,
    Frame,
    LanguageAction,
    Panorama,
    TodoItem,
    TodoList,
    VisionAction,
)
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.reply_schema import request_schema
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, WaypointNote
from unilavira_drake.tasks import TaskSpec


def test_row_fixed_size_buffer() -> None:
    """The paper: each place of a decision is stored in a fixed-size buffer.

    After 100 places neither the memory's state nor its prompt has grown, and the prompt says what
    had to go.
    """
    config = MemoryConfig()
    bounds = MemoryBounds(config.waypoints, config.decisions, config.keyframes, 0.5)
    state, requests = WaypointState(), []
    rng = np.random.default_rng(0)
    for n in range(1, 101):
        look = rng.integers(0, 256, 768, np.uint8).tobytes()
        X_WB = np.eye(4)
        X_WB[0, 3] = 2.0 * n
        frames = tuple(Frame(view=d, jpeg=f"{d} {n}".encode()) for d in DIRECTIONS)
        panorama = Panorama(n=n, first=n, X_WB=X_WB, frames=frames)
        action = LanguageAction(n - 1, "decide", "turn", "front") if n > 1 else LanguageAction()
        state = remember(state, panorama, action, VisionAction(), Sight(b"%d" % n, look), bounds)
        requests.append(
            language_request(
                call="decide", seed=0, task=TaskSpec("vln", "Go on."), panorama=panorama,
                history=state.history, second_chance=state.second_chance, todo=None,
                last_action=action, can_climb=False, free_distance=lambda frame: 1.0,
                detector=None,
            )
        )  # fmt: skip
    assert len(state.history.waypoints) == config.waypoints == 32
    assert len(state.second_chance.offers) == config.waypoints - 1
    assert len(state.history.edges) <= config.waypoints
    lengths = [len(compose_prompt(request).text) for request in requests]
    assert max(lengths[60:]) - min(lengths[60:]) < 300
    assert max(len(request.images) for request in requests) <= config.keyframes + 3 + 4
    text = compose_prompt(requests[-1]).text
    assert "There was no room to keep waypoints 2 to 69" in text
    assert "waypoint 1:" in text
    assert "waypoint 50:" not in text
    # In numbers it has the same size from the beginning.
    memory = WaypointMemory(
        period=0.1, waypoints=config.waypoints, decisions=8, keyframes=8, keyframe_travel=1.5,
        merge_distance=0.5,
    )  # fmt: skip
    port = memory.GetOutputPort("waypoint_buffer")
    assert port.size() == config.waypoints * NUMBERS_PER_WAYPOINT


def test_row_return_then_replan() -> None:
    """The paper: the robot is driven to the waypoint first, on the map as it is now; upon arrival
    the model is asked anew, and what it chooses is done from there.
    """
    start, there, elsewhere = (3.0, 4.8), (5.3, 4.8), (1.2, 4.8)
    script = Script(
        {1: turn("front"), 2: backtrack(1), 3: turn("back"), 4: ask_to_stop(), 5: verdict(True)},
        marks={1: there, 3: elsewhere},
    )
    task = "task: {text: Go on., start: '3.0,4.8,0', goal: '5.3,4.8'}"
    played = play(script, f"ablation: no_tdm\n{task}")
    assert [r.call for r in script.requests if r.role == "language"] == [
        "decide", "decide", "recover", "decide", "double_check",
    ]  # fmt: skip
    # Really there, really back.
    assert gap(played.position_at("panorama", 2), there) < 0.5
    assert gap(played.position_at("panorama", 3), start) < 0.4
    first, away, back = played.of("panorama")[:3]
    # Captured on arrival: new pictures of the old place, taken after the drive.
    assert (first.n, away.n, back.n, back.first) == (1, 2, 3, 3)
    assert min(frame.time for frame in back.frames) > max(frame.time for frame in away.frames)
    sent = {image.label: image.jpeg for image in script.asked(3).images}
    assert [sent[f"view {d}"] for d in DIRECTIONS] == [back.frame(d).jpeg for d in DIRECTIONS]
    assert math.remainder(back.yaw - first.yaw, 2 * math.pi) == pytest.approx(0.0, abs=0.1)
    # The new direction is looked at, and driven, from there.
    grounds = [r for r in script.requests if r.role == "vision"]
    assert [image.jpeg for image in grounds[-1].images] == [back.frame("back").jpeg]
    assert gap(played.position_at("panorama", 4), elsewhere) < 0.5
    # The map that it drove back on holds what was seen since.
    goals = {goal.n: goal for goal in played.of("goal")}
    assert gap(goals[2].p_WG, start) < 0.1
    kinds = [(kind, message.n) for _, kind, message in played.messages if hasattr(message, "n")]
    assert kinds.index(("map", 2)) < kinds.index(("navigation_status", 2))


OFFERED = LanguageVariables(
    todo=(TodoItem("leave the room", "completed", "door behind me"), TodoItem("find the table")),
    waypoints=(WaypointNote(1, offered=True), WaypointNote(2)),
    current_waypoint=2,
)
REPLY = {
    "progress_analysis": "", "reasoning_todo": "", "todo_updates": [], "reasoning_action": "",
    "scene": "",
}  # fmt: skip


def said(
    call: str, direction: str, *updates: dict[str, object], failed: str = ""
) -> LanguageAction:
    variables = dataclasses.replace(OFFERED, failed_direction=failed)
    action = {"tool": "turn", "direction": direction}
    reply = REPLY | {"todo_updates": list(updates), "action": action}
    return parse_language_reply(json.dumps(reply), MllmRequest(n=7, call=call, variables=variables))


@pytest.mark.parametrize("failed", DIRECTIONS)
def test_row_remaining_set(failed: str) -> None:
    """The paper: the new direction is chosen from the remaining set, the failed one excluded."""
    for direction in DIRECTIONS:
        if direction == failed:
            with pytest.raises(ReplyFormatError, match=f"{failed} is the direction that has just"):
                said("recover", direction, failed=failed)
        else:
            assert said("recover", direction, failed=failed).direction == direction
        # An ordinary decision may take any: by then something may have changed.
        assert said("decide", direction, failed="").direction == direction
    # A server that can be held to a form is held to the remaining set.
    variables = dataclasses.replace(OFFERED, failed_direction=failed)
    form = json.dumps(request_schema(MllmRequest(call="recover", variables=variables)))
    for direction in DIRECTIONS:
        assert (f'"{direction}"' in form) is (direction != failed)


def test_row_todo_updates_in_the_second_chance() -> None:
    """The paper: the second chance may emit updates that open a sub-goal again or reword it, and
    they stand before the action, which is conditioned on the list as it then is.
    """
    form = request_schema(MllmRequest(call="recover", variables=OFFERED))
    assert form is not None
    keys = list(form["properties"])
    assert keys == [
        "progress_analysis", "reasoning_todo", "todo_updates", "reasoning_action", "action",
        "scene",
    ]  # fmt: skip
    ops = {variant["properties"]["op"]["const"] for variant in _variants(form)}
    assert ops == {"update", "rewrite", "add", "remove"}
    action = said(
        "recover", "left",
        {"op": "update", "index": 1, "status": "pending", "result": ""},
        {"op": "rewrite", "index": 2, "content": "find the table, not in the kitchen"},
        failed="front",
    )  # fmt: skip
    assert OFFERED.todo is not None
    todo = apply_updates(TodoList(n=6, items=OFFERED.todo), action)
    assert todo.items == (
        TodoItem("leave the room"),
        TodoItem("find the table, not in the kitchen"),
    )
    assert todo.feedback == ()


def _variants(form: dict[str, object]) -> list[dict[str, dict[str, dict[str, str]]]]:
    """Returns the forms of an operation, wherever the schema keeps them."""
    found = []
    rest: list[object] = [form]
    while rest:
        node = rest.pop()
        if isinstance(node, dict):
            if "op" in node.get("properties", {}):
                found.append(node)
            rest += node.values()
        elif isinstance(node, list):
            rest += node
    return found
