"""Giving up what is under way: waits end at once and connections are closed."""

from __future__ import annotations

import concurrent.futures
import threading
from concurrent.futures import Future
from typing import Any, TypeVar

from unilavira_drake.errors import MllmError

T = TypeVar("T")

_SLICE = 0.2
"""Wall-clock seconds after which the main thread notices an interrupt at the latest."""


class Cancelled(MllmError):
    """The model was closed before it replied."""


class Cancellation:
    """The switch of one model; once thrown it stays."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thrown = threading.Event()
        self._open: set[Future[Any]] = set()

    @property
    def thrown(self) -> bool:
        """Whether everything is to be given up."""
        return self._thrown.is_set()

    def throw(self) -> None:
        """Gives up everything that waits here, now and later."""
        with self._lock:
            self._thrown.set()
            under_way = list(self._open)
        for future in under_way:
            future.cancel()

    def pause(self, seconds: float) -> None:
        """Waits.

        Raises:
            MllmError: if the switch is thrown meanwhile.
        """
        if self._thrown.wait(max(seconds, 0.0)):
            raise Cancelled("the model was closed before it replied.")

    def result(self, future: Future[T]) -> T:
        """Returns what a future holds; cancels it if the wait ends in any other way.

        Raises:
            MllmError: if the switch is thrown meanwhile.
        """
        try:
            with self._lock:
                self._open.add(future)
            self.pause(0.0)
            return _patiently(future)
        except concurrent.futures.CancelledError:
            raise Cancelled("the model was closed before it replied.") from None
        finally:
            future.cancel()
            with self._lock:
                self._open.discard(future)


def _patiently(future: Future[T]) -> T:
    if threading.current_thread() is not threading.main_thread():
        return future.result()
    while True:
        # An interrupt that comes just before a wait is seen only after it.
        done, _ = concurrent.futures.wait([future], timeout=_SLICE)
        if done:
            return future.result()
