"""The recorder: shows every message of the ring to a listener."""

from __future__ import annotations

from pydrake.systems.framework import Context, EventStatus, LeafSystem

from unilavira_drake.messages import (
    Goal,
    Grounding,
    LanguageAction,
    NavigationStatus,
    OccupancyMap,
    Panorama,
    TodoList,
    VisionAction,
    VoxelMap,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.ports import message_input
from unilavira_drake.recording.message_log import Listener

PORTS = {
    "panorama": ("observer", "panorama", Panorama()),
    "language_request": ("language", "model_request", MllmRequest()),
    "language_reply": ("language_link", "model_reply", MllmReply()),
    "language_action": ("language", "language_action", LanguageAction()),
    "todo_list": ("todo_memory", "todo_list", TodoList()),
    "vision_request": ("vision", "model_request", MllmRequest()),
    "vision_reply": ("vision_link", "model_reply", MllmReply()),
    "vision_action": ("vision", "vision_action", VisionAction()),
    "map": ("mapper", "map", OccupancyMap()),
    "goal": ("goal_selector", "goal", Goal()),
    "navigation_status": ("planner", "navigation_status", NavigationStatus()),
    "metrics": ("episode_monitor", "metrics", EpisodeMetrics()),
}
"""Input port -> the system and event that a transcript names, and the port's type."""

GROUNDER_PORTS = {"grounding": ("grounder", "grounding", Grounding())}
"""The same for what only an agent with an auxiliary grounder says."""


FLIGHT_PORTS = {"map": ("mapper", "map", VoxelMap())}
"""What an aircraft has in the place of those above."""


class Recorder(LeafSystem):
    """Hands what stands on its ports to a listener, between two ticks of the ring.

    It keeps nothing: a ``MessageLog`` as the listener tells the new messages from the old.

    .. pydrake_system::

        name: Recorder
        input_ports:
        - panorama (optional, like all below)
        - language_request
        - language_reply
        - language_action
        - todo_list
        - vision_request
        - vision_reply
        - vision_action
        - map
        - goal
        - navigation_status
        - metrics
        - grounding (only for an agent with a grounder)

    Args:
        listener: called with (simulated seconds, system, event, message).
        period: the tick of the ring, seconds; the ports are read half a tick after it.
        grounder: whether the agent has an auxiliary grounder.
        in_flight: whether the map is one of voxels.
    """

    def __init__(
        self, listener: Listener, *, period: float, grounder: bool = False, in_flight: bool = False
    ) -> None:
        super().__init__()
        self._listener = listener
        ports = PORTS | (FLIGHT_PORTS if in_flight else {}) | (GROUNDER_PORTS if grounder else {})
        self._readers = tuple(
            (system, event, message_input(self, port, default))
            for port, (system, event, default) in ports.items()
        )
        self.DeclarePeriodicPublishEvent(period, period / 2, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        now = context.get_time()
        for system, event, reader in self._readers:
            message = reader.optional(context)
            if message is not None:
                self._listener(now, system, event, message)
        return EventStatus.Succeeded()
