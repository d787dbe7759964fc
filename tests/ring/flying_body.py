"""A dummy aircraft around the real agent: it sees five depth views of boxes and flies straight."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from dummy_levels import ScriptedModel
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, Diagram
from pydrake.systems.primitives import ConstantValueSource
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.agent import ModelChoice, make_agent
from unilavira_drake.memory.config import MemoryConfig
from unilavira_drake.messages import (
    DIRECTIONS,
    DOWN,
    ON_THE_WAY,
    VIEW_YAW,
    Frame,
    Goal,
    Intrinsics,
    Message,
    NavigationStatus,
    Outcome,
    Panorama,
)
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.latency import ConstantLatency
from unilavira_drake.ports import Level, message_input
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.wiring import Wiring

SIDE = 32
LENS = Intrinsics(SIDE, SIDE, SIDE / 2, SIDE / 2, (SIDE - 1) / 2, (SIDE - 1) / 2)
RANGE = 60.0
BOXES = (
    ((-200.0, -200.0, -1.0), (200.0, 200.0, 0.0)),
    ((30.0, -6.0, 0.0), (40.0, 6.0, 30.0)),
)
"""The ground and a tower."""
START = (0.0, 0.0, 10.0)


def camera(view: str, position: tuple[float, float, float], yaw: float) -> np.ndarray:
    """Returns X_WC of a view; the top of the down view's picture is to the front."""
    heading = yaw + VIEW_YAW.get(view, 0.0)
    c, s = math.cos(heading), math.sin(heading)
    forward = np.array([0.0, 0.0, -1.0]) if view == DOWN else np.array([c, s, 0.0])
    right = np.array([s, -c, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    X_WC[:3, 3] = position
    return X_WC


def depth_image(X_WC: np.ndarray) -> np.ndarray:
    """Returns (H, W) float32 metres along the axis, inf beyond the range."""
    u, v = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    rays_C = np.stack(((u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones_like(u)), -1)
    rays = rays_C @ X_WC[:3, :3].T
    rays = np.where(np.abs(rays) < 1e-9, 1e-9, rays)
    best = np.full((SIDE, SIDE), np.inf)
    for low, high in BOXES:
        a, b = (np.array(low) - X_WC[:3, 3]) / rays, (np.array(high) - X_WC[:3, 3]) / rays
        near, far = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        best = np.where((near <= far) & (near > 0.0), np.minimum(best, near), best)
    return np.where(best <= RANGE, best, np.inf).astype(np.float32)


def panorama(
    n: int, position: tuple[float, float, float], yaw: float, outcome: Outcome
) -> Panorama:
    """Returns the five views from a place."""
    frames = []
    for view in (*DIRECTIONS, DOWN):
        X_WC = camera(view, position, yaw)
        frames.append(Frame(view, 0.0, depth=depth_image(X_WC), jpeg=view.encode(),
                            intrinsics=LENS, X_WC=X_WC))  # fmt: skip
    c, s = math.cos(yaw), math.sin(yaw)
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[c, -s], [s, c]]
    X_WB[:3, 3] = position
    return Panorama(n=n, first=n, X_WB=X_WB, frames=tuple(frames), outcome=outcome)


@dataclass(frozen=True, eq=False)
class AircraftState(Message):
    """A point in the air, how its goal goes, and what it saw last."""

    position: tuple[float, float, float] = START
    yaw: float = 0.0
    status: NavigationStatus = NavigationStatus()
    panorama: Panorama = Panorama()


class Aircraft(Level):
    """Station, observer and navigation in one: flies 5 m/s straight to goals."""

    def __init__(self, period: float = 0.1) -> None:
        super().__init__(AircraftState(), period=period)
        self._step_length = 5.0 * period
        self._goal = message_input(self, "goal", Goal())
        self.declare_output("panorama", lambda s: s.panorama, Panorama())
        self.DeclareAbstractOutputPort(
            "front.color_image",
            lambda: Value[ImageRgba8U](ImageRgba8U(8, 6)),
            self._show,
            prerequisites_of_calc=self._state_tickets,
        )
        self.DeclareAbstractOutputPort(
            "pose_estimate",
            lambda: Value[RigidTransform](),
            self._pose,
            prerequisites_of_calc=self._state_tickets,
        )
        self.DeclareVectorOutputPort("twist", BasicVector(6), lambda context, output: None)

    def _show(self, context: Context, output: AbstractValue) -> None:
        image = ImageRgba8U(8, 6)
        place = [round(value) % 256 for value in self.state(context).position]
        image.mutable_data[:] = np.random.default_rng(place).integers(0, 256, (6, 8, 4))
        output.set_value(image)

    def _pose(self, context: Context, output: AbstractValue) -> None:
        body = self.state(context)
        output.set_value(RigidTransform(RotationMatrix.MakeZRotation(body.yaw), body.position))

    def step(self, context: Context, state: AircraftState) -> AircraftState:
        """Looks around when a goal is done, else flies on."""
        status = state.status
        if status.terminal and status.n == state.panorama.n:
            seen = panorama(
                status.n + 1, state.position, state.yaw,
                Outcome(status.state, status.reason, status.remaining, status.height),
            )  # fmt: skip
            return dataclasses.replace(state, panorama=seen)
        goal = self._goal(context)
        if goal.n <= (status.n if status.terminal else status.n - 1):
            return state
        if goal.kind != "go":
            end = "arrived" if goal.kind == "stay" else "failed"
            return dataclasses.replace(state, status=NavigationStatus(goal.n, end, goal.reason))
        assert goal.p_WG is not None
        away = math.dist(goal.p_WG, state.position)
        if away < 0.05:
            reason = ON_THE_WAY if goal.partial else ""
            status = NavigationStatus(goal.n, "arrived", reason, goal.heading)
            return dataclasses.replace(state, status=status)
        share = min(1.0, self._step_length / away)
        x, y, z = (a + share * (b - a) for a, b in zip(state.position, goal.p_WG, strict=True))
        return dataclasses.replace(
            state, position=(x, y, z), status=NavigationStatus(goal.n, "moving")
        )


def make_flight_ring(language: ScriptedModel, vision: ScriptedModel, task: str) -> Diagram:
    """Returns the real agent around a dummy aircraft."""
    wiring = Wiring()
    spec = TaskSpec("aerial_vln", task)
    wiring.add("task", lambda: ConstantValueSource(AbstractValue.Make(spec)))
    wiring.add("body", Aircraft)
    wiring.add(
        "agent",
        lambda: make_agent(
            language_model=ModelChoice(Broker(language), ConstantLatency(0.0)),
            vision_model=ModelChoice(Broker(vision), ConstantLatency(0.0)),
            memory=MemoryConfig(),
            ablation="full",
            tick=0.1,
            seed=0,
            can_climb=False,
            max_range=RANGE,
            free_distance=lambda frame: float(min(frame.depth[SIDE // 2, SIDE // 2], RANGE)),
            detector=lambda frame: ViewEvidence(frame.view),
        ),
    )
    wiring.connect("task", "y0", "agent", "task")
    for port in ("panorama", "front.color_image", "pose_estimate"):
        wiring.connect("body", port, "agent")
    wiring.connect("agent", "goal", "body")
    return wiring.build("ring")
