"""The waypoint memory as a System."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.memory.pictures import VIEW_CHANGE, look_of
from unilavira_drake.memory.waypoints import (
    MemoryBounds,
    Sight,
    Watch,
    WaypointState,
    remember,
    with_picture,
)
from unilavira_drake.messages import (
    History,
    LanguageAction,
    Panorama,
    SecondChance,
    VisionAction,
    direction_of,
)
from unilavira_drake.ports import Level, image_input, message_input, pixels, pose_input
from unilavira_drake.sensors.encoding import encode_jpeg, rgb_of

NUMBERS_PER_WAYPOINT = 5
"""Id, x, y, z (metres) and heading (radians); an id of 0 marks a free slot."""

WATCH_TRAVEL = 0.25
"""The way is watched this often, metres: travel is summed in such steps, and a robot that turns in
place is not watched at all."""


class WaypointMemory(Level):
    """Keeps the waypoint buffer: history n and second chance n from panorama n and action n - 1.

    Its pictures of the past are the front view at each new waypoint and, while the robot drives
    to a new place, what it sees every ``keyframe_travel`` metres and after each 45 degrees of
    turning; the colour image is rendered only then.  A picture that looks like the latest one is
    not kept, and none is taken on a way back, which shows nothing new.

    .. pydrake_system::

        name: WaypointMemory
        input_ports:
        - panorama
        - language_action
        - vision_action
        - front.color_image
        - pose_estimate
        output_ports:
        - history
        - second_chance
        - waypoint_buffer

    Args:
        period: polling period, seconds.
        waypoints: size of the buffer; the oldest but the first is evicted.
        decisions: past decisions told in the history.
        keyframes: pictures of the past that stay in the history once there are so many; they
            are dropped in blocks of four, those from the way first.
        keyframe_travel: travel between two pictures on the way, metres.
        merge_distance: a panorama this close to a waypoint is at that waypoint, metres.
        picture_width: width of the pictures, pixels; None keeps the camera's.
    """

    def __init__(
        self,
        *,
        period: float,
        waypoints: int,
        decisions: int,
        keyframes: int,
        keyframe_travel: float,
        merge_distance: float,
        picture_width: int | None = 320,
    ) -> None:
        super().__init__(WaypointState(), period=period)
        self._bounds = MemoryBounds(waypoints, decisions, keyframes, merge_distance)
        self._keyframe_travel = keyframe_travel
        self._picture_width = picture_width
        self._panorama = message_input(self, "panorama", Panorama())
        self._action = message_input(self, "language_action", LanguageAction())
        self._vision = message_input(self, "vision_action", VisionAction())
        self._color = image_input(self, "front.color_image", ImageRgba8U)
        self._pose = pose_input(self, "pose_estimate")
        self.declare_output("history", lambda state: state.history, History())
        self.declare_output("second_chance", lambda state: state.second_chance, SecondChance())
        self.declare_vector_mirror(
            "waypoint_buffer", waypoints * NUMBERS_PER_WAYPOINT, self._buffer, 0.0
        )

    def step(self, context: Context, state: WaypointState) -> WaypointState:
        """Remembers a new panorama; between panoramas collects key frames."""
        panorama = self._panorama(context)
        if panorama.n == state.history.n:
            return self._watch(context, state)
        action = self._action(context)
        if action.n != panorama.n - 1:
            return state
        sight = Sight()
        if panorama.first == panorama.n:
            sight = self._sight(panorama.frame("front").color)
        return remember(state, panorama, action, self._vision(context), sight, self._bounds)

    def _watch(self, context: Context, state: WaypointState) -> WaypointState:
        if state.history.n == 0:
            return state
        X_WB = self._pose(context)
        x, y, _ = X_WB.translation()
        step = math.dist((x, y), state.watch.position)
        if step < WATCH_TRAVEL:
            return state
        rotation = X_WB.rotation().matrix()
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
        travelled = state.watch.travelled + step
        change = abs(math.remainder(yaw - state.watch.picture_yaw, 2 * math.pi))
        watch = Watch((float(x), float(y)), state.watch.picture_yaw, travelled)
        if travelled < self._keyframe_travel and change < VIEW_CHANGE:
            return dataclasses.replace(state, watch=watch)
        state = dataclasses.replace(state, watch=Watch(watch.position, yaw))
        action = self._action(context)
        if action.n != state.history.n or action.tool not in ("turn", "fly"):
            return state
        return with_picture(
            state,
            self._sight(rgb_of(pixels(self._color(context)))),
            n=action.n,
            waypoint=state.history.current,
            direction=action.direction or direction_of(math.radians(action.bearing)),
        )

    def _sight(self, color: NDArray[np.uint8]) -> Sight:
        return Sight(encode_jpeg(color, width=self._picture_width), look_of(color))

    def _buffer(self, state: WaypointState) -> NDArray[np.float64]:
        buffer = np.zeros((self._bounds.waypoints, NUMBERS_PER_WAYPOINT))
        for row, waypoint in zip(buffer, state.history.waypoints, strict=False):
            row[:] = (waypoint.id, *waypoint.position, waypoint.heading)
        return buffer.ravel()
