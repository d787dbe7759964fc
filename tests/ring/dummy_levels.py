"""Dummy station, navigation and models around the real agent and observer."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, Diagram, System
from pydrake.systems.primitives import ConstantValueSource
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I, ImageRgba8U

from unilavira_drake.agent import ModelChoice, make_agent
from unilavira_drake.memory.config import MemoryConfig
from unilavira_drake.messages import (
    Goal,
    Intrinsics,
    Message,
    NavigationStatus,
    Sweep,
)
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.latency import ConstantLatency
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.ports import Level, message_input
from unilavira_drake.sensors.observer import Observer
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.wiring import Wiring

INTRINSICS = Intrinsics(8, 6, 4.0, 4.0, 3.5, 2.5)
WALL_DISTANCE = 2.0


@dataclass(frozen=True)
class BodyState(Message):
    """A point robot and how its goal goes."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    status: NavigationStatus = NavigationStatus()


class Body(Level):
    """Station and navigation in one: drives 1 m/s straight to goals, turns at once.

    ``failures`` maps a number to the reason for which its goal fails.
    """

    def __init__(self, failures: Mapping[int, str], period: float = 0.1) -> None:
        super().__init__(BodyState(), period=period)
        self._failures = dict(failures)
        self._step_length = period
        self._goal = message_input(self, "goal", Goal())
        self._sweep = message_input(self, "sweep", Sweep())
        self.declare_output("navigation_status", lambda s: s.status, NavigationStatus())
        self.DeclareAbstractOutputPort(
            "front.color_image",
            lambda: Value[ImageRgba8U](ImageRgba8U(8, 6)),
            self._show,
            prerequisites_of_calc=self._state_tickets,
        )
        depth = ImageDepth32F(8, 6)
        depth.mutable_data[:] = WALL_DISTANCE
        self._image_port("front.depth_image", depth)
        self._image_port("front.label_image", ImageLabel16I(8, 6))
        camera = RigidTransform(
            RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])),
            [0.0, 0.0, 1.0],
        )
        self._pose_port("front.X_BC", lambda state: camera)
        self._pose_port(
            "pose_estimate",
            lambda s: RigidTransform(RotationMatrix.MakeZRotation(s.yaw), [s.x, s.y, 0.0]),
        )
        self.DeclareVectorOutputPort("twist", BasicVector(6), lambda context, output: None)

    def _image_port(self, name: str, image: Any) -> None:
        self.DeclareAbstractOutputPort(
            name,
            lambda: Value[type(image)](image),
            lambda context, output: output.set_value(image),
            prerequisites_of_calc={self.nothing_ticket()},
        )

    def _show(self, context: Context, output: AbstractValue) -> None:
        # Each square metre and each direction looks different.
        body = self.state(context)
        place = [round(body.x) % 256, round(body.y) % 256, round(2 * body.yaw) % 256]
        image = ImageRgba8U(8, 6)
        image.mutable_data[:] = np.random.default_rng(place).integers(0, 256, (6, 8, 4))
        output.set_value(image)

    def _pose_port(self, name: str, view: Any) -> None:
        self.DeclareAbstractOutputPort(
            name,
            lambda: Value[RigidTransform](),
            lambda context, output: output.set_value(view(self.state(context))),
            prerequisites_of_calc=self._state_tickets,
        )

    def step(self, context: Context, state: BodyState) -> BodyState:
        """Turns with the sweep, follows the goal."""
        sweep = self._sweep(context)
        if sweep.active and sweep.n > state.status.n:
            return dataclasses.replace(state, yaw=sweep.heading)
        goal = self._goal(context)
        if goal.n <= (state.status.n if state.status.terminal else state.status.n - 1):
            return state
        if goal.kind != "go":
            end = "arrived" if goal.kind == "stay" else "failed"
            return dataclasses.replace(state, status=NavigationStatus(goal.n, end, goal.reason))
        if goal.n in self._failures:
            reason = self._failures[goal.n]
            return dataclasses.replace(state, status=NavigationStatus(goal.n, "failed", reason))
        assert goal.p_WG is not None
        dx, dy = goal.p_WG[0] - state.x, goal.p_WG[1] - state.y
        distance = math.hypot(dx, dy)
        if distance < 0.05:
            status = NavigationStatus(goal.n, "arrived", "", goal.heading)
            return dataclasses.replace(state, status=status)
        share = min(1.0, self._step_length / distance)
        return BodyState(
            state.x + share * dx,
            state.y + share * dy,
            math.atan2(dy, dx),
            NavigationStatus(goal.n, "moving"),
        )


@dataclass
class ScriptedModel:
    """Replies by number, or by (number, attempt); remembers what it was shown."""

    replies: Mapping[Any, str]
    default: str = ""
    requests: list[MllmRequest] = field(default_factory=list)
    name: str = "scripted"
    perception: str = "images"
    reasoning: str = "rules"
    description: str = "a script for tests"
    box_space: str = "pixels"
    deadline: float = 60.0

    def complete(self, request: MllmRequest) -> Completion:
        """Returns the scripted reply."""
        self.requests.append(request)
        key = (request.n, request.attempt)
        text = self.replies.get(key, self.replies.get(request.n, self.default))
        return Completion(text)

    def close(self) -> None:
        """Does nothing."""

    def request(self, n: int, attempt: int = 0) -> MllmRequest:
        """Returns what was asked under this number."""
        return next(r for r in self.requests if (r.n, r.attempt) == (n, attempt))


def decide(tool: str, updates: list[dict[str, Any]] | None = None, **argument: Any) -> str:
    """Returns the reply of a ``decide`` call."""
    return json.dumps(
        {
            "progress_analysis": "",
            "reasoning_todo": "",
            "todo_updates": updates or [],
            "reasoning_action": "",
            "action": {"tool": tool, **argument},
            "scene": "a test",
        }
    )


def plan(*items: str) -> str:
    """Returns the reply of a ``plan_todo`` call."""
    return json.dumps({"reasoning": "", "todo": list(items)})


def verdict(confirmed: bool, reason: str = "") -> str:
    """Returns the reply of a ``double_check`` call."""
    return json.dumps({"reasoning": "", "confirmed": confirmed, "reason": reason})


def select(u: float = 4.0, v: float = 3.0) -> str:
    """Returns the reply of a vision call."""
    return json.dumps(
        {"target_desc": "a wall", "box": None, "point": [u, v], "confidence": 1.0, "reason": ""}
    )


def make_ring(
    language: ScriptedModel,
    vision: ScriptedModel,
    *,
    failures: Mapping[int, str] | None = None,
    ablation: str = "full",
    family: str = "vln",
    latency: float = 0.0,
    replace: Mapping[str, System] | None = None,
    observer_period: float = 0.1,
    body_period: float = 0.1,
) -> Diagram:
    """Returns the real agent and observer around a dummy body."""
    wiring = Wiring()
    own = dict(replace or {})
    task = TaskSpec(family, "Go to the wall.")
    wiring.add("task", lambda: ConstantValueSource(AbstractValue.Make(task)))
    wiring.add("body", lambda: Body(failures or {}, period=body_period))
    wiring.add("observer", lambda: Observer(intrinsics=INTRINSICS, period=observer_period))
    wiring.add(
        "agent",
        lambda: make_agent(
            language_model=ModelChoice(Broker(language), ConstantLatency(latency)),
            vision_model=ModelChoice(Broker(vision), ConstantLatency(latency / 8)),
            memory=MemoryConfig(),
            ablation=ablation,
            tick=0.1,
            seed=0,
            can_climb=True,
            max_range=10.0,
            free_distance=lambda frame: WALL_DISTANCE,
            detector=lambda frame: ViewEvidence(frame.view),
            replace=own,
        ),
    )
    wiring.connect("task", "y0", "agent", "task")
    for port in ("color_image", "depth_image", "label_image", "X_BC"):
        wiring.connect("body", f"front.{port}", "observer")
    for port in ("pose_estimate", "twist", "navigation_status"):
        wiring.connect("body", port, "observer")
    wiring.connect("body", "front.color_image", "agent")
    wiring.connect("body", "pose_estimate", "agent")
    wiring.connect("observer", "panorama", "agent")
    wiring.connect("observer", "sweep", "body")
    wiring.connect("agent", "goal", "body")
    return wiring.build("ring")


def language_action(diagram: Diagram, context: Context) -> Any:
    """Returns the agent's present language action."""
    agent = diagram.GetSubsystemByName("agent")
    port = agent.GetOutputPort("language_action")
    return port.Eval(agent.GetMyContextFromRoot(context))


def run_until_stop(diagram: Diagram, limit: float = 2000.0) -> Simulator:
    """Advances until the agent stops or the limit (simulated seconds) is reached."""
    simulator = Simulator(diagram)
    while simulator.get_context().get_time() < limit:
        simulator.AdvanceTo(simulator.get_context().get_time() + 5.0)
        if language_action(diagram, simulator.get_context()).tool == "stop":
            break
    return simulator
