"""Hands each message on once, however often it is seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from unilavira_drake.messages.metrics import EpisodeMetrics

Listener = Callable[[float, str, str, Any], None]
"""Called with simulated seconds, system, event and message."""

METRICS_TRAVEL = 0.25
"""Metrics are new after this much travel, metres."""


class MessageLog:
    """Passes new messages to its listeners, in their order.

    A message is new when its (system, event, number, attempt, state) is; number 0 is a port's
    initial value.  So a map is new with each panorama in it.  Metrics are new after some travel,
    at a collision and at the end.  So polling again changes nothing, nor does a cloned Context
    that replays what was already seen.
    """

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self._listeners = listeners
        self._seen: set[tuple[Any, ...]] = set()
        self._latest: dict[tuple[str, str], Any] = {}

    def __call__(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes what stands on a port at a time, simulated seconds."""
        # Nearly always nothing is new, ten times a second for each port.
        if self._latest.get((system, event)) is message:
            return
        self._latest[system, event] = message
        key = (system, event, _identity(message))
        if key in self._seen:
            return
        self._seen.add(key)
        if getattr(message, "n", 1) == 0:
            return
        for listener in self._listeners:
            listener(t, system, event, message)


def _identity(message: Any) -> tuple[Any, ...]:
    if isinstance(message, EpisodeMetrics):
        travel = int(message.path_length / METRICS_TRAVEL)
        return travel, message.collisions, message.cause
    state = getattr(message, "state", "")
    # A map's ``state`` is a method.
    return message.n, getattr(message, "attempt", 0), state if isinstance(state, str) else ""
