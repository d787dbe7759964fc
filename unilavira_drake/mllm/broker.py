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
from concurrent.futures import Future, InvalidStateError
from concurrent.futures import TimeoutError as FutureTimeoutError

from unilavira_drake.errors import MllmError, MllmTimeout
from unilavira_drake.mllm.reply import Completion, Mllm
from unilavira_drake.mllm.request import MllmRequest

_WAITING_SLICE = 0.2
"""Wall-clock seconds after which an interrupt is noticed at the latest."""
_CLOSING_TIME = 1.0
"""Wall-clock seconds that ``close`` waits for calls under way."""


class Broker:
    """Runs each request once in a daemon thread and remembers its reply or its error.

    ``deadline`` is the wall-clock time in seconds that :meth:`result` waits for one reply.  A
    missed deadline is remembered like any other answer, so that every reader sees the same.
    Workers end when there is nothing to do; none outlives the process.
    """

    def __init__(self, backend: Mllm, *, max_workers: int = 4, deadline: float = 150.0) -> None:
        self._backend = backend
        self._max_workers = max_workers
        self._deadline = deadline
        self._lock = threading.Lock()
        self._futures: dict[str, Future[Completion]] = {}
        self._waiting: collections.deque[tuple[MllmRequest, Future[Completion]]] = (
            collections.deque()
        )
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
        self._future(request)

    def result(self, request: MllmRequest) -> Completion:
        """Returns the reply to a request, waiting for it if need be.

        Raises:
            MllmTimeout: if there is no reply before the deadline.
            MllmError: if the model could not be reached, answered with an error, or the broker
                was closed before the reply came.
        """
        future = self._future(request)
        until = time.monotonic() + self._deadline
        while not future.done():
            remaining = until - time.monotonic()
            if remaining <= 0.0:
                # The worker may settle it in this very moment; the first word stands.
                _settle(future, error=MllmTimeout(f"no reply within {self._deadline:g} s."))
            # In slices: an interrupt that comes just before a wait is seen only after it.
            with contextlib.suppress(FutureTimeoutError):
                future.exception(timeout=min(max(remaining, 0.0), _WAITING_SLICE))
        return future.result()

    def close(self) -> None:
        """Answers every open request with an error and ends the workers.

        A call that is inside the backend is given a second to return; after that its daemon
        thread is left behind and its late reply is ignored.
        """
        with self._lock:
            self._closed = True
            self._waiting.clear()
            open_futures = [future for future in self._futures.values() if not future.done()]
            workers = list(self._workers)
        for future in open_futures:
            _settle(future, error=MllmError("the model was closed before it replied."))
        until = time.monotonic() + _CLOSING_TIME
        for worker in workers:
            worker.join(max(until - time.monotonic(), 0.0))

    def _future(self, request: MllmRequest) -> Future[Completion]:
        digest = request.digest
        with self._lock:
            known = self._futures.get(digest)
            if known is not None:
                return known
            if self._closed:
                raise MllmError("the model is closed.")
            future: Future[Completion] = Future()
            self._futures[digest] = future
            self._waiting.append((request, future))
            if len(self._workers) < self._max_workers:
                worker = threading.Thread(target=self._work, name="mllm-call", daemon=True)
                self._workers.add(worker)
                worker.start()
            return future

    def _work(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    self._workers.discard(threading.current_thread())
                    return
                request, future = self._waiting.popleft()
                if future.done():  # Its reader has given up; do not pay for the call.
                    continue
                self._calls += 1
            try:
                completion = self._backend.complete(request)
            except BaseException as error:  # A bug is raised where the reply is read.
                _settle(future, error=error)
            else:
                _settle(future, completion=completion)


def _settle(
    future: Future[Completion],
    *,
    completion: Completion | None = None,
    error: BaseException | None = None,
) -> None:
    """Gives a future its reply or its error; the first word stands."""
    try:
        if completion is not None:
            future.set_result(completion)
        else:
            future.set_exception(error)
    except InvalidStateError:
        pass
