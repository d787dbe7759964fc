"""A circuit breaker: an endpoint that keeps failing is left alone for a while.

The calls of an outage would otherwise all wait for their own time-outs and then fall upon the
endpoint together when it is back.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Breaker:
    """Opens after some failures in a row; then lets one call through at a time to see.

    Args:
        failures: how many failures in a row open it.
        cooling: seconds between two probes while it is open.
        clock: seconds that never run backwards.
    """

    def __init__(
        self,
        *,
        failures: int = 5,
        cooling: float = 30.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._limit = failures
        self._cooling = cooling
        self._clock = clock
        self._lock = threading.Lock()
        self._failures = 0
        self._next_probe = 0.0
        self._last = ""

    def admit(self) -> float:
        """Returns 0 if the endpoint may be asked now, else the seconds until the next probe.

        The caller that is let through while the breaker is open is the probe; the others wait
        for its result, or for the next one's turn if it never tells.
        """
        with self._lock:
            if self._failures < self._limit:
                return 0.0
            now = self._clock()
            if now < self._next_probe:
                return self._next_probe - now
            self._next_probe = now + self._cooling
            return 0.0

    def answered(self) -> None:
        """Notes that the endpoint is there, whatever it said."""
        with self._lock:
            self._failures = 0

    def failed(self, reason: str) -> None:
        """Notes that no usable answer came."""
        with self._lock:
            self._failures += 1
            self._last = reason
            self._next_probe = self._clock() + self._cooling

    @property
    def state(self) -> str:
        """What it knows, in words, for an error's message."""
        with self._lock:
            return f"{self._failures} failures in a row, the last: {self._last}"


_lock = threading.Lock()
_breakers: dict[tuple[str, str], Breaker] = {}


def breaker_of(base_url: str, model: str) -> Breaker:
    """Returns the one breaker of this process for an endpoint."""
    with _lock:
        return _breakers.setdefault((base_url, model), Breaker())
