"""Model calls outside the Context: a memo table of a pure function from request to reply.

Threads, futures and connections cannot be part of a Context.  A Context holds the request; the
broker holds, under the request's digest, the one call that answers it.  So a Context that was
cloned while a call was under way needs no second call, and both clones read the same reply.
"""

from __future__ import annotations

import collections
import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any

from unilavira_drake.errors import MllmError, MllmTimeout
from unilavira_drake.mllm.reply import Attempt, Completion, Mllm, Usage
from unilavira_drake.mllm.request import MllmRequest

CANCELLED = "cancelled"
"""Status of an attempt that was given up from outside."""
GRACE = 1.0
"""Wall-clock seconds beyond its deadline in which a backend may report its own timeout."""
_WAITING_SLICE = 0.2
"""Wall-clock seconds after which an interrupt is noticed at the latest."""
_CLOSING_TIME = 1.0
"""Wall-clock seconds that ``close`` waits for calls under way."""

AttemptListener = Callable[[MllmRequest, int, Attempt], None]
"""Called with a request, the number of the try at it (from 1), and how that try went."""


class _Call:
    """One request on its way: when it was asked for, when its call began, what came of it."""

    def __init__(self, request: MllmRequest, deadline: float) -> None:
        self.request = request
        self.future: Future[Completion] = Future()
        self.until = time.monotonic() + deadline
        self.began: float | None = None
        self.latency = 0.0

    @property
    def age(self) -> float:
        """Wall-clock seconds since the backend was called; microseconds are enough."""
        return 0.0 if self.began is None else round(time.monotonic() - self.began, 6)


class Broker:
    """Runs each request once in a daemon thread and remembers its reply or its error.

    A reply is given up when the backend's own ``deadline`` is over, and with a grace in which it
    may say so itself.  A missed deadline is remembered like any other answer, so that every
    reader sees the same.  Workers end when there is nothing to do; none outlives the process.

    Args:
        backend: the model; closed with the broker.
        max_workers: calls at the same time.
        grace: wall-clock seconds beyond the backend's deadline.
        on_attempt: called once for each attempt of each call when the call has ended, from a
            thread of the broker's; a backend that tells no attempts has made one.
    """

    def __init__(
        self,
        backend: Mllm,
        *,
        max_workers: int = 4,
        grace: float = GRACE,
        on_attempt: AttemptListener | None = None,
    ) -> None:
        self._backend = backend
        self._max_workers = max_workers
        self._grace = grace
        self._on_attempt = on_attempt
        self._lock = threading.Lock()
        self._known: dict[str, _Call] = {}
        self._waiting: collections.deque[_Call] = collections.deque()
        self._under_way: set[_Call] = set()
        self._workers: set[threading.Thread] = set()
        self._calls = 0
        self._closed = False

    @property
    def backend(self) -> Mllm:
        """The model behind this broker."""
        return self._backend

    @property
    def calls(self) -> int:
        """How many calls the backend has really got."""
        return self._calls

    def submit(self, request: MllmRequest) -> None:
        """Starts the call for a request, unless it was started before.

        Raises:
            MllmError: if the broker is closed and has never seen this request.
        """
        self._call(request)

    def done(self, request: MllmRequest) -> bool:
        """Whether :meth:`result` would return, or raise, at once."""
        call = self._call(request)
        return call.future.done() or time.monotonic() >= call.until

    def result(self, request: MllmRequest) -> Completion:
        """Returns the reply to a request with its latency, waiting for it if need be.

        Raises:
            MllmTimeout: if there is no reply before the deadline.
            MllmError: if the model could not be reached, answered with an error, or the broker
                was closed before the reply came.
            ReplyFormatError: if the model refused, or its reply was cut off.
        """
        call = self._call(request)
        while not call.future.done():
            remaining = call.until - time.monotonic()
            if remaining <= 0.0:
                # The worker may settle it in this very moment; the first word stands.
                limit = self._backend.deadline
                self._settle(call, MllmTimeout(f"no reply within {limit:g} s."), limit)
            # In slices: an interrupt that comes just before a wait is seen only after it.
            with contextlib.suppress(FutureTimeoutError):
                call.future.exception(timeout=min(max(remaining, 0.0), _WAITING_SLICE))
        return call.future.result()

    def latency(self, request: MllmRequest) -> float:
        """Returns the seconds that the model took for a request, by a reply or by an error.

        They are wall-clock seconds, or as recorded; 0 before :meth:`result`.
        """
        return self._call(request).latency

    def close(self) -> None:
        """Closes the backend, answers every open request with an error and ends the workers.

        A call that is inside the backend is given a second to return; after that its daemon
        thread is left behind, its late reply is ignored and it counts as ``cancelled``.
        """
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._waiting.clear()
            calls, workers = list(self._known.values()), list(self._workers)
        self._backend.close()
        for call in calls:
            error = MllmError("the model was closed before it replied.")
            self._settle(call, error, call.age)
        until = time.monotonic() + _CLOSING_TIME
        for worker in workers:
            worker.join(max(until - time.monotonic(), 0.0))
        for call in calls:
            name = self._backend.name
            self._report(call, (Attempt(name, CANCELLED, latency=call.age),))

    def _call(self, request: MllmRequest) -> _Call:
        digest = request.digest
        with self._lock:
            known = self._known.get(digest)
            if known is not None:
                return known
            if self._closed:
                raise MllmError("the model is closed.")
            call = _Call(request, self._backend.deadline + self._grace)
            self._known[digest] = call
            self._waiting.append(call)
            if len(self._workers) < self._max_workers:
                worker = threading.Thread(target=self._work, name="mllm-call", daemon=True)
                self._workers.add(worker)
                worker.start()
            return call

    def _work(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    self._workers.discard(threading.current_thread())
                    return
                call = self._waiting.popleft()
                if call.future.done():  # Its reader has given up; do not pay for the call.
                    continue
                self._calls += 1
                self._under_way.add(call)
            call.began = time.monotonic()
            try:
                outcome: Completion | BaseException = self._backend.complete(call.request)
            except BaseException as error:  # A bug is raised where the reply is read.
                outcome = error
            self._conclude(call, outcome)

    def _conclude(self, call: _Call, outcome: Completion | BaseException) -> None:
        told: Any = getattr(outcome, "latency", None)
        latency = call.age if told is None else float(told)
        attempts: Any = tuple(getattr(outcome, "attempts", ()))
        if isinstance(outcome, OSError):  # A mailbox or a cassette that cannot be read any more.
            outcome = MllmError(f"{self._backend.name}: {outcome}")
        if isinstance(outcome, Completion):
            status, usage, detail = "ok", outcome.usage, ""
        else:
            given_up = self._closed and isinstance(outcome, MllmError)
            status = CANCELLED if given_up else type(outcome).__name__
            usage, detail = Usage(), str(outcome)
        try:
            own = Attempt(self._backend.name, status, None, usage, latency, detail)
            self._report(call, attempts or (own,))
        except OSError as error:  # A full disk.
            outcome = MllmError(f"the ledger cannot be written: {error}")
        except BaseException as error:  # A bug is raised where the reply is read.
            outcome = error
        self._settle(call, outcome, latency)

    def _report(self, call: _Call, attempts: tuple[Attempt, ...]) -> None:
        with self._lock:
            if call not in self._under_way:
                return
            self._under_way.discard(call)
        if self._on_attempt is not None:
            for number, attempt in enumerate(attempts, start=1):
                self._on_attempt(call.request, number, attempt)

    def _settle(self, call: _Call, outcome: Completion | BaseException, latency: float) -> None:
        """Gives a call its reply or its error; the first word stands."""
        with self._lock:
            if call.future.done():
                return
            call.latency = latency
            if isinstance(outcome, Completion):
                call.future.set_result(outcome)
            else:
                call.future.set_exception(outcome)
