from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from unilavira_drake.errors import MllmError, MllmTimeout, ReplyRefused
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.reply import Attempt, Completion, Usage
from unilavira_drake.mllm.request import MllmRequest


class Backend:
    """Answers with ``reply``; remembers what it was asked, and by which threads."""

    name = "test"
    perception = "images"
    reasoning = "model"
    box_space = "pixels"
    description = "A test's own model."

    def __init__(self, reply: Callable[[MllmRequest], str], deadline: float = 10.0) -> None:
        self.deadline = deadline
        self.closed = 0
        self.asked: list[MllmRequest] = []
        self.threads: set[threading.Thread] = set()
        self._reply = reply

    def complete(self, request: MllmRequest) -> Completion:
        self.asked.append(request)
        self.threads.add(threading.current_thread())
        return Completion(text=self._reply(request))

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def gate() -> Iterator[threading.Event]:
    event = threading.Event()
    yield event
    event.set()


def _raise(error: Exception) -> Callable[[MllmRequest], str]:
    def reply(request: MllmRequest) -> str:
        raise error

    return reply


def test_each_request_is_called_once() -> None:
    backend = Backend(lambda request: f"{request.n}.{request.attempt}")
    broker = Broker(backend, max_workers=2)
    requests = [MllmRequest(n=n, attempt=a) for n in (1, 2, 3) for a in (0, 1)]
    for request in requests * 3:
        broker.submit(request)
    assert [broker.result(request).text for request in requests] == [
        "1.0", "1.1", "2.0", "2.1", "3.0", "3.1",
    ]  # fmt: skip
    assert broker.calls == len(backend.asked) == 6
    # An equal request, made anew, is the same call; another seed is another one.
    assert broker.result(MllmRequest(n=1)).text == "1.0"
    assert broker.calls == 6
    broker.result(MllmRequest(n=1, seed=1))
    assert broker.calls == 7


def test_never_more_workers_than_allowed(gate: threading.Event) -> None:
    running, most, lock = 0, 0, threading.Lock()
    both_in = threading.Barrier(2)

    def reply(request: MllmRequest) -> str:
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        both_in.wait(10.0)
        with lock:
            running -= 1
        return ""

    broker = Broker(Backend(reply), max_workers=2)
    requests = [MllmRequest(n=n) for n in range(1, 9)]
    for request in requests:
        broker.submit(request)
    for request in requests:
        broker.result(request)
    assert most == 2


def test_a_submitted_call_runs_before_it_is_joined() -> None:
    called = threading.Event()
    broker = Broker(Backend(lambda request: str(called.set())))
    broker.submit(MllmRequest(n=1))
    assert called.wait(10.0)


def test_an_error_is_remembered() -> None:
    backend = Backend(_raise(MllmError("refused")))
    broker = Broker(backend)
    for _ in range(2):
        with pytest.raises(MllmError, match="refused"):
            broker.result(MllmRequest(n=1))
    assert broker.calls == 1


@pytest.mark.parametrize("error", [ZeroDivisionError("bug"), KeyError("bug")])
def test_a_bug_of_the_backend_is_raised_as_it_is(error: Exception) -> None:
    broker = Broker(Backend(_raise(error)))
    with pytest.raises(type(error), match="bug"):
        broker.result(MllmRequest(n=1))


def test_a_file_that_cannot_be_read_is_no_bug() -> None:
    broker = Broker(Backend(_raise(PermissionError("the mailbox"))))
    with pytest.raises(MllmError, match="test: the mailbox"):
        broker.result(MllmRequest(n=1))


def test_deadline_is_remembered_and_a_late_reply_ignored(gate: threading.Event) -> None:
    backend = Backend(lambda request: str(gate.wait(10.0)), deadline=0.05)
    broker = Broker(backend, grace=0.0)
    with pytest.raises(MllmTimeout, match=r"no reply within 0\.05 s"):
        broker.result(MllmRequest(n=1))
    gate.set()
    for thread in backend.threads:
        thread.join(10.0)
    with pytest.raises(MllmTimeout):
        broker.result(MllmRequest(n=1))
    assert broker.calls == 1


def test_a_call_whose_reader_gave_up_is_not_made(gate: threading.Event) -> None:
    backend = Backend(lambda request: str(gate.wait(10.0)), deadline=0.05)
    broker = Broker(backend, max_workers=1, grace=0.0)
    for n in (1, 2):
        with pytest.raises(MllmTimeout):
            broker.result(MllmRequest(n=n))
    gate.set()
    for thread in list(broker._workers):
        thread.join(10.0)
    assert broker.calls == 1


def test_workers_end_when_there_is_nothing_to_do() -> None:
    backend = Backend(lambda request: "")
    broker = Broker(backend)
    broker.result(MllmRequest(n=1))
    for thread in backend.threads:
        assert thread.daemon
        thread.join(10.0)
        assert not thread.is_alive()


def test_close_settles_open_calls_and_keeps_replies(gate: threading.Event) -> None:
    def reply(request: MllmRequest) -> str:
        return "early" if request.n == 1 else str(gate.wait(0.2))

    backend = Backend(reply)
    broker = Broker(backend, max_workers=1)
    assert broker.result(MllmRequest(n=1)).text == "early"
    for n in (2, 3):
        broker.submit(MllmRequest(n=n))
    broker.close()
    broker.close()
    assert backend.closed == 1
    assert broker.result(MllmRequest(n=1)).text == "early"
    for n in (2, 3, 4):
        with pytest.raises(MllmError, match="closed"):
            broker.result(MllmRequest(n=n))
    assert not any(thread.is_alive() for thread in backend.threads)
    assert 3 not in [request.n for request in backend.asked]


def test_close_wakes_a_reader(gate: threading.Event) -> None:
    broker = Broker(Backend(lambda request: str(gate.wait(10.0))))
    caught: list[BaseException] = []

    def read() -> None:
        try:
            broker.result(MllmRequest(n=1))
        except MllmError as error:
            caught.append(error)

    reader = threading.Thread(target=read)
    reader.start()
    while not broker.calls:
        pass
    closer = threading.Thread(target=broker.close)
    closer.start()
    reader.join(10.0)
    gate.set()
    closer.join(10.0)
    assert "closed" in str(caught[0])


Row = tuple[int, int, str, str]


class Rows:
    """Keeps what a broker tells of attempts."""

    def __init__(self) -> None:
        self.all: list[Attempt] = []
        self.seen: list[Row] = []

    def __call__(self, request: MllmRequest, tries: int, attempt: Attempt) -> None:
        self.all.append(attempt)
        self.seen.append((request.n, tries, attempt.model, attempt.status))


def test_a_backend_that_tells_no_attempts_has_made_one() -> None:
    rows = Rows()
    broker = Broker(Backend(lambda request: str(time.sleep(0.02))), on_attempt=rows)
    completion = broker.result(MllmRequest(n=1))
    assert rows.seen == [(1, 1, "test", "ok")]
    assert completion.latency is None
    assert 0.02 <= rows.all[0].latency < 10.0
    assert rows.all[0].latency == broker.latency(MllmRequest(n=1))
    broker.result(MllmRequest(n=1))
    assert len(rows.seen) == 1


def test_each_attempt_on_the_wire_is_told_before_the_reply_is_seen() -> None:
    attempts = (Attempt("m", "MllmTimeout", latency=3.0), Attempt("m", "ok", 200, Usage(7, 2)))

    class Told(Backend):
        def complete(self, request: MllmRequest) -> Completion:
            if request.n == 1:
                return Completion("text", Usage(7, 2), 12.5, attempts)
            error = ReplyRefused("no")
            error.attempts, error.latency = attempts[:1], 4.5
            raise error

    rows = Rows()
    broker = Broker(Told(str), on_attempt=rows)
    assert broker.result(MllmRequest(n=1)).latency == 12.5
    assert rows.seen == [(1, 1, "m", "MllmTimeout"), (1, 2, "m", "ok")]
    with pytest.raises(ReplyRefused):
        broker.result(MllmRequest(n=2))
    assert rows.seen[2:] == [(2, 1, "m", "MllmTimeout")]
    assert broker.latency(MllmRequest(n=2)) == 4.5


def test_a_call_that_is_given_up_is_told_as_cancelled(gate: threading.Event) -> None:
    rows = Rows()
    backend = Backend(lambda request: str(gate.wait(10.0)))
    broker = Broker(backend, max_workers=1, on_attempt=rows)
    for n in (1, 2):
        broker.submit(MllmRequest(n=n))
    while not backend.asked:
        time.sleep(0.001)
    broker.close()
    # The second one was never asked for.
    assert rows.seen == [(1, 1, "test", "cancelled")]
    gate.set()
    for thread in backend.threads:
        thread.join(10.0)
    assert len(rows.seen) == 1


def test_a_backend_that_ends_its_call_when_it_is_closed_was_cancelled() -> None:
    class Closing(Backend):
        def __init__(self) -> None:
            super().__init__(str)
            self.gate = threading.Event()

        def complete(self, request: MllmRequest) -> Completion:
            self.asked.append(request)
            self.gate.wait(10.0)
            raise MllmError("closed before a reply")

        def close(self) -> None:
            self.gate.set()

    rows, backend = Rows(), Closing()
    broker = Broker(backend, on_attempt=rows)
    broker.submit(MllmRequest(n=1))
    while not backend.asked:
        time.sleep(0.001)
    broker.close()
    assert rows.seen == [(1, 1, "test", "cancelled")]
    assert rows.all[0].detail == "closed before a reply"


def test_a_late_reply_is_still_told(gate: threading.Event) -> None:
    rows = Rows()
    backend = Backend(lambda request: str(gate.wait(10.0)), deadline=0.05)
    broker = Broker(backend, grace=0.0, on_attempt=rows)
    with pytest.raises(MllmTimeout):
        broker.result(MllmRequest(n=1))
    assert rows.seen == []
    gate.set()
    for thread in backend.threads:
        thread.join(10.0)
    # It was paid for.
    assert rows.seen == [(1, 1, "test", "ok")]


def test_a_row_that_cannot_be_written_is_raised_where_the_reply_is_read() -> None:
    def full(request: MllmRequest, tries: int, attempt: Attempt) -> None:
        raise OSError("disk full")

    broker = Broker(Backend(lambda request: ""), on_attempt=full)
    with pytest.raises(MllmError, match="the ledger cannot be written: disk full"):
        broker.result(MllmRequest(n=1))


def test_done_waits_for_nothing(gate: threading.Event) -> None:
    backend = Backend(lambda request: str(gate.wait(10.0)))
    broker = Broker(backend)
    assert not broker.done(MllmRequest(n=1))
    gate.set()
    broker.result(MllmRequest(n=1))
    assert broker.done(MllmRequest(n=1))


def test_done_knows_the_deadline(gate: threading.Event) -> None:
    backend = Backend(lambda request: str(gate.wait(10.0)), deadline=0.01)
    broker = Broker(backend, grace=0.0)
    while not broker.done(MllmRequest(n=1)):
        time.sleep(0.001)
    with pytest.raises(MllmTimeout):
        broker.result(MllmRequest(n=1))


WAITS_FOR_EVER = """
import threading
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.request import MllmRequest

class Backend:
    name = "test"
    deadline = 600.0

    def complete(self, request):
        print("asked", flush=True)
        threading.Event().wait()

    def close(self):
        print("closed", flush=True)

broker = Broker(Backend())
try:
    broker.result(MllmRequest(n=1))
except KeyboardInterrupt:
    broker.close()
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends a POSIX signal")
def test_interrupt_ends_the_wait_and_the_process() -> None:
    command = [sys.executable, "-c", WAITS_FOR_EVER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "asked\n"
        process.send_signal(signal.SIGINT)
        try:
            out, _ = process.communicate(timeout=30.0)
        finally:
            process.kill()
    assert (out, process.returncode) == ("closed\ninterrupted\n", 0)
