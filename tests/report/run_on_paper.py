"""A run that was never simulated: six steps with all that can go wrong, and hostile replies."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.memory.todo import apply_updates
from unilavira_drake.messages import (
    Candidate,
    Frame,
    Goal,
    Grounding,
    Intrinsics,
    LanguageAction,
    NavigationStatus,
    OccupancyMap,
    Outcome,
    Panorama,
    TodoList,
    TodoUpdate,
    VisionAction,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables
from unilavira_drake.recording.result import EpisodeResult, ModelResult, TaskResult
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.scenario_loading import dump_scenario, load_scenario

TASK = "Leave the <b>bedroom</b> & stop at the sofa."
HOSTILE = "<script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
COLORS = {"front": (40, 40, 200), "left": (30, 200, 30), "back": (200, 40, 40), "right": (0, 0, 0)}
"""Red, green, blue of each view: plain, so that a screenshot shows which one is drawn."""
LENS = Intrinsics(640, 480, 388.0, 388.0, 319.5, 239.5)


def jpeg(color: tuple[int, int, int]) -> bytes:
    image = np.full((480, 640, 3), color[::-1], np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


def pose(x: float, y: float, yaw: float) -> NDArray[np.float64]:
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    X_WB[:2, 3] = x, y
    return X_WB


class Pen:
    """Writes messages into a run folder, a tenth of a second apart."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._t = 0.0
        self._length = 0.0
        self.todo = TodoList()

    def say(self, system: str, event: str, message: object) -> None:
        self._t += 0.1
        self._folder.record(self._t, system, event, message)

    def look(self, n: int, first: int, x: float, y: float, outcome: Outcome) -> None:
        frames = tuple(
            Frame(view=view, jpeg=jpeg(color), intrinsics=LENS) for view, color in COLORS.items()
        )
        X_WB = pose(x, y, -1.57)
        self.say("observer", "panorama", Panorama(n, first, self._t, X_WB, frames, outcome))
        grid = np.zeros((64, 64), np.int8)
        grid[:40, :n] = -5
        grid[40, :] = 5
        self.say("mapper", "map", OccupancyMap(n, n, self._t, 0.1, (0.0, 4.0), grid))

    def ask(self, n: int, call: str, waypoint: int, replies: tuple[str, ...]) -> None:
        variables = LanguageVariables(task=TASK, current_waypoint=waypoint, todo=self.todo.items)
        for attempt, text in enumerate(replies):
            request = MllmRequest(
                n=n,
                attempt=attempt,
                call=call,
                variables=variables,
                feedback="the reply is <i>not JSON</i>" if attempt else "",
            )
            self.say("language", "model_request", request)
            self.say("language_link", "model_reply", MllmReply(n, attempt, text, latency=2.5))

    def ground(self, n: int, direction: str, *replies: str) -> None:
        for attempt, text in enumerate(replies):
            request = MllmRequest(
                role="vision",
                n=n,
                attempt=attempt,
                call="ground",
                variables=VisionVariables(task=TASK, direction=direction),
                feedback="box is turned round" if attempt else "",
            )
            self.say("vision", "model_request", request)
            self.say("vision_link", "model_reply", MllmReply(n, attempt, text))

    def act(self, action: LanguageAction) -> None:
        self.say("language", "language_action", action)
        self.todo = apply_updates(self.todo, action)
        self.say("todo_memory", "todo_list", self.todo)

    def drive(self, goal: Goal, start: tuple[float, float], reason: str = "") -> None:
        self.say("goal_selector", "goal", goal)
        if goal.p_WG is not None:
            self.say("planner", "navigation_status", NavigationStatus(goal.n, "moving"))
            before, whole = self._length, float(np.hypot(*np.subtract(goal.p_WG[:2], start)))
            for share in np.linspace(0.0, 1.0, 9):
                x, y = (1 - share) * np.array(start) + share * np.array(goal.p_WG[:2])
                self._length = before + share * whole
                metrics = EpisodeMetrics(self._t, x, y, 0.0, self._length, decisions=goal.n - 1)
                self.say("episode_monitor", "metrics", metrics)
        state = "failed" if reason else "arrived"
        self.say("planner", "navigation_status", NavigationStatus(goal.n, state, reason))


def add(content: str, index: int | None = None) -> TodoUpdate:
    return TodoUpdate("add", index, content)


def done(index: int, result: str) -> TodoUpdate:
    return TodoUpdate("update", index, status="completed", result=result)


REFINED, LEFT = (340.0, 150.0, 480.0, 310.0), (520.0, 30.0, 600.0, 90.0)
"""Boxes of the grounder in step 2: the one that was taken, and one that was not."""


def refined(vision: VisionAction) -> Grounding:
    return Grounding(
        vision.n,
        dataclasses.replace(vision, box=REFINED, confidence=0.9),
        doubt="low confidence",
        candidates=(Candidate(REFINED, 0.9), Candidate(LEFT, 0.6)),
        refined=True,
    )


def write_run(path: Path, *, result: bool = True, scenario: bool = True) -> Path:
    """Writes the run folder and returns it; it lacks ``map.png`` and ``timings.json``."""
    with RunFolder(path) as folder:
        if scenario:
            text = f"{{text: {json.dumps(TASK)}, goal: sofa_1, start: bedroom}}"
            folder.write("scenario.yaml", dump_scenario(load_scenario("flat", f"task: {text}")))
        pen = Pen(folder)
        _plan_and_turn(pen)
        _fail_twice(pen)
        _return_and_stop(pen)
        if result:
            told = EpisodeResult(
                scored=True,
                success=True,
                cause="stopped",
                task=TaskResult("vln", TASK, "", "sofa_1"),
                scenario="flat",
                robot="cobot_magic",
                model=ModelResult("rules", "rules", "ground_truth", "rules"),
            )
            folder.write("result.json", told.to_json())
    return path


def _plan_and_turn(pen: Pen) -> None:
    plan = tuple(map(add, ("Leave the bedroom", "Enter the hall", "Pass the bench")))
    pen.look(1, 1, 2.6, 7.4, Outcome())
    pen.ask(1, "plan_todo", 1, ('{"todo": []}',))
    pen.act(LanguageAction(1, "plan_todo", "stay", todo_updates=plan, reasoning_todo="a plan"))
    pen.drive(Goal(1, "stay"), (2.6, 7.4))
    pen.look(2, 1, 2.6, 7.4, Outcome())
    pen.ask(2, "decide", 1, (f"no JSON {HOSTILE}", '{"action": {}}'))
    updates = (done(1, "the corridor underfoot"), done(2, ""))
    pen.act(
        LanguageAction(
            2,
            "decide",
            "turn",
            "left",
            todo_updates=updates,
            reasoning_action=HOSTILE,
            scene="a bedroom",
        )
    )
    pen.ground(2, "left", "{}")
    box = (100.0, 120.0, 300.0, 330.0)
    vision = VisionAction(2, "left", box, None, f"door {HOSTILE}", 0.3)
    pen.say("vision", "vision_action", vision)
    pen.say("grounder", "grounding", refined(vision))
    goal = Goal(2, "go", p_WG=(2.2, 5.0, 0.0), pixel=(200.0, 225.0))
    pen.drive(goal, (2.6, 7.4))


def _fail_twice(pen: Pen) -> None:
    pen.look(3, 3, 2.2, 5.0, Outcome())
    pen.ask(3, "decide", 2, ("{}",))
    updates = (
        TodoUpdate("rewrite", 2, "Walk along the hall"),
        TodoUpdate("remove", 3),
        add("Stop at the sofa", 3),
    )
    pen.act(LanguageAction(3, "decide", "turn", "front", todo_updates=updates))
    pen.ground(3, "front", "bad", "worse")
    vision = VisionAction(3, "front", reason="no box", fallback=True)
    pen.say("vision", "vision_action", vision)
    pen.say("grounder", "grounding", Grounding(3, vision))
    pen.drive(Goal(3, "none", reason="no target: no box"), (2.2, 5.0), "no target: no box")
    pen.look(4, 3, 2.2, 5.0, Outcome("failed", "no target: no box"))
    pen.ask(4, "decide", 2, ("?", "??"))
    pen.act(LanguageAction(4, "decide", "none", reason="two unusable replies", fallback=True))
    pen.drive(Goal(4, "none", reason="no usable action"), (2.2, 5.0), "no usable action")


def _return_and_stop(pen: Pen) -> None:
    pen.look(5, 3, 2.2, 5.0, Outcome("failed", "no usable action"))
    pen.ask(5, "decide", 2, ("{}",))
    updates = (TodoUpdate("update", 1, status="pending", result="still inside"),)
    pen.act(LanguageAction(5, "decide", "backtrack", waypoint=1, todo_updates=updates))
    pen.drive(Goal(5, "go", p_WG=(2.6, 7.4, 0.0), heading=-1.57), (2.2, 5.0))
    pen.look(6, 6, 2.6, 7.4, Outcome())
    pen.ask(6, "double_check", 1, ("{}",))
    pen.act(LanguageAction(6, "double_check", "stop", confirmed=True, progress_analysis="seen"))
