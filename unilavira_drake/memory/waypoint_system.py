"""The waypoint memory as a System."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.memory.waypoints import MemoryBounds, WaypointState, remember
from unilavira_drake.messages import (
    History,
    LanguageAction,
    Panorama,
    SecondChance,
    VisionAction,
)
from unilavira_drake.ports import Level, image_input, message_input, pixels, pose_input
from unilavira_drake.sensors.encoding import encode_jpeg, rgb_of

NUMBERS_PER_WAYPOINT = 5
"""Id, x, y, z (metres) and heading (radians); an id of 0 marks a free slot."""

THUMBNAIL_WIDTH = 320


class WaypointMemory(Level):
    """Keeps the waypoint buffer: history n and second chance n from panorama n and action n - 1.

    While the robot drives it takes an egocentric key frame every ``keyframe_travel`` metres; the
    colour image is rendered only then.

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
        keyframes: most frames of one leg.
        keyframe_travel: travel between two key frames, metres.
        merge_distance: a panorama this close to a waypoint is at that waypoint, metres.
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
    ) -> None:
        super().__init__(WaypointState(), period=period)
        self._bounds = MemoryBounds(waypoints, decisions, keyframes, merge_distance)
        self._keyframe_travel = keyframe_travel
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
        thumbnail = b""
        if panorama.first == panorama.n:
            thumbnail = encode_jpeg(panorama.frame("front").color, width=THUMBNAIL_WIDTH)
        return remember(state, panorama, action, self._vision(context), thumbnail, self._bounds)

    def _watch(self, context: Context, state: WaypointState) -> WaypointState:
        if state.history.n == 0:
            return state
        x, y, _ = self._pose(context).translation()
        if math.dist((x, y), state.last_frame_position) < self._keyframe_travel:
            return state
        jpeg = encode_jpeg(rgb_of(pixels(self._color(context))), width=THUMBNAIL_WIDTH)
        return dataclasses.replace(
            state, frames=(*state.frames, jpeg), last_frame_position=(float(x), float(y))
        )

    def _buffer(self, state: WaypointState) -> NDArray[np.float64]:
        buffer = np.zeros((self._bounds.waypoints, NUMBERS_PER_WAYPOINT))
        for row, waypoint in zip(buffer, state.history.waypoints, strict=False):
            row[:] = (waypoint.id, *waypoint.position, waypoint.heading)
        return buffer.ravel()
