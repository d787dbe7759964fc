"""The observer: waits until a goal is done, then captures the next panorama."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I, ImageRgba8U

from unilavira_drake.messages import (
    SWEEP_ORDERS,
    VIEW_YAW,
    Frame,
    Intrinsics,
    Message,
    NavigationStatus,
    Outcome,
    Panorama,
    Sweep,
    read_only,
)
from unilavira_drake.ports import (
    Level,
    image_input,
    message_input,
    pixels,
    pose_input,
    pose_matrix,
    vector_input,
)
from unilavira_drake.sensors.encoding import encode_jpeg, rgb_of


@dataclass(frozen=True, eq=False)
class ObserverState(Message):
    """Published panorama and sweep, and the sweep's frames so far."""

    panorama: Panorama = Panorama()
    sweep: Sweep = Sweep()
    outcome: Outcome = Outcome()
    heading: float = 0.0
    """World yaw of ``front`` in the running sweep."""
    frames: tuple[Frame, ...] = ()
    since: float = 0.0
    """When the robot began to turn to the view that is captured next."""
    rest_yaw: float = 0.0
    """Yaw of the base after the latest sweep."""


class Observer(Level):
    """Captures the four views by turning in place, one panorama for each language call.

    Panorama n + 1 is made when navigation status n is terminal; it carries that status as its
    outcome.  A robot that has not moved since the last panorama (< 5 cm, < 3 degrees) gets the
    same frames under the new number.  Images are rendered only at the captures.

    .. pydrake_system::

        name: Observer
        input_ports:
        - front.color_image
        - front.depth_image
        - front.label_image
        - front.X_BC
        - pose_estimate
        - twist
        - navigation_status
        output_ports:
        - panorama
        - sweep

    Args:
        intrinsics: of the front camera.
        period: polling period, seconds.
        sweep_direction: ``left`` or ``right``, the side to which the robot turns to look around.
        heading_tolerance: a view is captured within this error of its heading, radians ...
        rest_rate: ... and below this yaw rate (rad/s) and speed (m/s) ...
        view_deadline: ... or after this many seconds, at whatever heading was reached; the
            frame's pose is the true geometry, so a blocked turn costs coverage, not truth.
    """

    def __init__(
        self,
        *,
        intrinsics: Intrinsics,
        period: float,
        sweep_direction: str = "left",
        heading_tolerance: float = 0.02,
        rest_rate: float = 0.03,
        view_deadline: float = 8.0,
    ) -> None:
        super().__init__(ObserverState(), period=period)
        self._intrinsics = intrinsics
        self._order = SWEEP_ORDERS[sweep_direction]
        self._heading_tolerance = heading_tolerance
        self._rest_rate = rest_rate
        self._view_deadline = view_deadline
        self._color = image_input(self, "front.color_image", ImageRgba8U)
        self._depth = image_input(self, "front.depth_image", ImageDepth32F)
        self._label = image_input(self, "front.label_image", ImageLabel16I)
        self._X_BC = pose_input(self, "front.X_BC")
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        self._status = message_input(self, "navigation_status", NavigationStatus())
        self.declare_output("panorama", lambda state: state.panorama, Panorama())
        self.declare_output("sweep", lambda state: state.sweep, Sweep())

    def step(self, context: Context, state: ObserverState) -> ObserverState:
        """Starts a sweep when a goal is done, captures the views, publishes the panorama."""
        if state.sweep.active:
            return self._capture(context, state)
        status = self._status(context)
        if status.n != state.panorama.n or not status.terminal:
            return state
        return self._begin(context, state, status)

    def _begin(
        self, context: Context, state: ObserverState, status: NavigationStatus
    ) -> ObserverState:
        X_WB = pose_matrix(self._pose(context))
        yaw = math.atan2(X_WB[1, 0], X_WB[0, 0])
        n = status.n + 1
        outcome = Outcome(status.state, status.reason, status.remaining)
        heading = yaw if status.heading is None else status.heading
        if state.panorama.n > 0 and _at_rest_place(state, X_WB, yaw, status.heading):
            panorama = dataclasses.replace(state.panorama, n=n, outcome=outcome)
            return dataclasses.replace(state, panorama=panorama)
        return dataclasses.replace(
            state,
            sweep=Sweep(n=n, active=True, heading=heading),
            outcome=outcome,
            heading=heading,
            frames=(),
            since=context.get_time(),
        )

    def _capture(self, context: Context, state: ObserverState) -> ObserverState:
        X_WB = pose_matrix(self._pose(context))
        yaw = math.atan2(X_WB[1, 0], X_WB[0, 0])
        twist = self._twist(context)
        time = context.get_time()
        at_rest = abs(twist[2]) < self._rest_rate and np.hypot(*twist[3:5]) < self._rest_rate
        on_heading = (
            abs(math.remainder(yaw - state.sweep.heading, 2 * math.pi)) < self._heading_tolerance
        )
        if not (at_rest and on_heading) and time - state.since < self._view_deadline:
            return state
        view = self._order[len(state.frames)]
        frames = (*state.frames, self._frame(context, view, X_WB, time))
        if len(frames) < len(self._order):
            heading = state.heading + VIEW_YAW[self._order[len(frames)]]
            sweep = dataclasses.replace(state.sweep, heading=heading)
            return dataclasses.replace(state, frames=frames, sweep=sweep, since=time)
        front = _at_yaw(X_WB, state.heading)
        n = state.sweep.n
        panorama = Panorama(
            n=n, first=n, time=time, X_WB=front, frames=frames, outcome=state.outcome
        )
        return dataclasses.replace(
            state, panorama=panorama, sweep=Sweep(n=n), frames=(), rest_yaw=yaw
        )

    def _frame(self, context: Context, view: str, X_WB: NDArray[np.float64], time: float) -> Frame:
        color = rgb_of(pixels(self._color(context)))
        return Frame(
            view=view,
            time=time,
            color=color,
            depth=read_only(pixels(self._depth(context))[:, :, 0]),
            label=read_only(pixels(self._label(context))[:, :, 0]),
            jpeg=encode_jpeg(color),
            intrinsics=self._intrinsics,
            X_WC=X_WB @ pose_matrix(self._X_BC(context)),
        )


def _at_rest_place(
    state: ObserverState, X_WB: NDArray[np.float64], yaw: float, heading: float | None
) -> bool:
    moved = float(np.linalg.norm(X_WB[:3, 3] - state.panorama.X_WB[:3, 3]))
    turned = abs(math.remainder(yaw - state.rest_yaw, 2 * math.pi))
    if heading is None:
        heading = state.panorama.yaw
    other_front = abs(math.remainder(heading - state.panorama.yaw, 2 * math.pi))
    return moved < 0.05 and max(turned, other_front) < math.radians(3.0)


def _at_yaw(X_WB: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    X = np.array(X_WB)
    c, s = math.cos(yaw), math.sin(yaw)
    X[:3, :3] = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    return X
