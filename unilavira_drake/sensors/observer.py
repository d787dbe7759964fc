"""The observer: waits until a goal is done, then captures the next panorama."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, LeafSystem
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

LEVEL = math.cos(math.radians(3.0))
"""Least cosine of the base's tilt at a capture."""


@dataclass(frozen=True, eq=False)
class ObserverState(Message):
    """Published panorama and sweep, and the sweep's frames so far."""

    panorama: Panorama = Panorama()
    sweep: Sweep = Sweep()
    outcome: Outcome = Outcome()
    capturing: int = 0
    """Number of the panorama that is being captured; 0: none is."""
    heading: float = 0.0
    """World yaw of ``front`` in the running sweep."""
    stop: int = 0
    """Headings at which the sweep has captured so far."""
    frames: tuple[Frame, ...] = ()
    since: float = 0.0
    """When the robot began to turn to the view that is captured next."""
    rest_yaw: float = 0.0
    """Yaw of the base after the latest sweep."""


class Observer(Level):
    """Captures the views, one panorama for each language call.

    A robot with one camera turns in place for the four views, at rest.  A ring of cameras sees
    them at once, after turning to the demanded heading when there is one.  Views beyond the four,
    like ``down``, are captured once, with the last.

    Panorama n + 1 is made when navigation status n is terminal; it carries that status as its
    outcome.  A robot that has not moved since the last panorama (< 5 cm, < 3 degrees) gets the
    same frames under the new number.  Images are rendered only at the captures.

    .. pydrake_system::

        name: Observer
        input_ports:
        - (view).color_image
        - (view).depth_image
        - (view).label_image
        - (view).X_BC
        - pose_estimate
        - twist
        - navigation_status
        output_ports:
        - panorama
        - sweep

    Args:
        intrinsics: of every camera.
        period: polling period, seconds.
        views: the cameras, ``front`` among them; with ``left`` they are a ring.
        sweep_direction: ``left`` or ``right``, the side to which the robot turns to look around.
        heading_tolerance: a view is captured within this error of its heading, radians ...
        rest_rate: ... and below this yaw rate (rad/s) ...
        rest_speed: ... and speed (m/s), and level within 3 degrees ...
        view_deadline: ... or after this many seconds, at whatever heading was reached; the
            frame's pose is the true geometry, so a blocked turn costs coverage, not truth.
        max_age: after a failure a panorama that is older is captured anew though the robot has not
            moved, seconds; for places where people walk.
    """

    def __init__(
        self,
        *,
        intrinsics: Intrinsics,
        period: float,
        views: Sequence[str] = ("front",),
        sweep_direction: str = "left",
        heading_tolerance: float = 0.02,
        rest_rate: float = 0.03,
        rest_speed: float = 0.03,
        view_deadline: float = 8.0,
        max_age: float = math.inf,
    ) -> None:
        super().__init__(ObserverState(), period=period)
        self._intrinsics = intrinsics
        ring = tuple(view for view in SWEEP_ORDERS["left"] if view in views)
        extra = tuple(view for view in views if view not in VIEW_YAW)
        # What is captured at each heading, as (view, its camera).
        self._stops: tuple[tuple[tuple[str, str], ...], ...]
        if len(ring) > 1:
            self._stops = (tuple((view, view) for view in ring + extra),)
        else:
            turns = SWEEP_ORDERS[sweep_direction]
            self._stops = tuple(((view, "front"),) for view in turns[:-1])
            last = ((turns[-1], "front"), *((view, view) for view in extra))
            self._stops = (*self._stops, last)
        self._heading_tolerance = heading_tolerance
        self._rest_rate = rest_rate
        self._rest_speed = rest_speed
        self._view_deadline = view_deadline
        self._max_age = max_age
        self._cameras = {view: _CameraPorts(self, view) for view in (*ring, *extra)}
        self._pose = pose_input(self, "pose_estimate")
        self._twist = vector_input(self, "twist", 6)
        self._status = message_input(self, "navigation_status", NavigationStatus())
        self.declare_output("panorama", lambda state: state.panorama, Panorama())
        self.declare_output("sweep", lambda state: state.sweep, Sweep())

    def step(self, context: Context, state: ObserverState) -> ObserverState:
        """Starts a sweep when a goal is done, captures the views, publishes the panorama."""
        if state.capturing:
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
        outcome = Outcome(status.state, status.reason, status.remaining, status.height)
        heading = yaw if status.heading is None else status.heading
        if state.panorama.n > 0 and _at_rest_place(state, X_WB, yaw, status.heading):
            age = context.get_time() - state.panorama.time
            if status.state != "failed" or age <= self._max_age:
                panorama = dataclasses.replace(state.panorama, n=n, outcome=outcome)
                return dataclasses.replace(state, panorama=panorama)
            # What was in the way may be gone; the four words keep their meaning.
            heading = state.panorama.yaw if status.heading is None else heading
        # A ring that faces anywhere need not turn.
        turns = len(self._stops) > 1 or status.heading is not None
        return dataclasses.replace(
            state,
            capturing=n,
            sweep=Sweep(n=n, active=turns, heading=heading),
            outcome=outcome,
            heading=heading,
            stop=0,
            frames=(),
            since=context.get_time(),
        )

    def _capture(self, context: Context, state: ObserverState) -> ObserverState:
        X_WB = pose_matrix(self._pose(context))
        yaw = math.atan2(X_WB[1, 0], X_WB[0, 0])
        twist = self._twist(context)
        time = context.get_time()
        speed = math.hypot(*twist[3:6].tolist())
        at_rest = abs(twist[2]) < self._rest_rate and speed < self._rest_speed
        # An aircraft that brakes is tilted, and so is what it sees.
        at_rest = at_rest and X_WB[2, 2] > LEVEL
        error = abs(math.remainder(yaw - state.sweep.heading, 2 * math.pi))
        on_heading = error < self._heading_tolerance or not state.sweep.active
        if not (at_rest and on_heading) and time - state.since < self._view_deadline:
            return state
        new = tuple(
            self._frame(context, view, camera, X_WB, time)
            for view, camera in self._stops[state.stop]
        )
        frames, stop = (*state.frames, *new), state.stop + 1
        if stop < len(self._stops):
            heading = state.heading + VIEW_YAW[self._stops[stop][0][0]]
            sweep = dataclasses.replace(state.sweep, heading=heading)
            return dataclasses.replace(state, frames=frames, stop=stop, sweep=sweep, since=time)
        n = state.capturing
        panorama = Panorama(
            n=n,
            first=n,
            time=time,
            # Views of a ring turn with the base, those of a sweep count from where it began.
            X_WB=_at_yaw(X_WB, state.heading if len(self._stops) > 1 else yaw),
            frames=frames,
            outcome=state.outcome,
        )
        return dataclasses.replace(
            state, capturing=0, panorama=panorama, sweep=Sweep(n=n), frames=(), rest_yaw=yaw
        )

    def _frame(
        self, context: Context, view: str, camera: str, X_WB: NDArray[np.float64], time: float
    ) -> Frame:
        ports = self._cameras[camera]
        color = rgb_of(pixels(ports.color(context)))
        return Frame(
            view=view,
            time=time,
            color=color,
            depth=read_only(pixels(ports.depth(context))[:, :, 0]),
            label=read_only(pixels(ports.label(context))[:, :, 0]),
            jpeg=encode_jpeg(color),
            intrinsics=self._intrinsics,
            X_WC=X_WB @ pose_matrix(ports.X_BC(context)),
        )


class _CameraPorts:
    """The input ports of one camera."""

    def __init__(self, observer: LeafSystem, view: str) -> None:
        self.color = image_input(observer, f"{view}.color_image", ImageRgba8U)
        self.depth = image_input(observer, f"{view}.depth_image", ImageDepth32F)
        self.label = image_input(observer, f"{view}.label_image", ImageLabel16I)
        self.X_BC = pose_input(observer, f"{view}.X_BC")


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
