"""A remote model at the end of a process: interrupts, forks and the exit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
from fault_server import FaultServer
from wire_faults import FAULTS


@pytest.fixture(scope="module")
def server() -> Iterator[FaultServer]:
    with FaultServer(FAULTS) as running:
        yield running


SCRIPT = """
import os, socket, sys, time
sys.path[:0] = {path!r}
from tiny_model import GROUND, profile_of
from unilavira_drake.errors import MllmTimeout
from unilavira_drake.mllm.remote import RemoteModel

def model(deadline=60.0):
    profile = profile_of("openai", {base_url!r}, deadline=deadline, attempt=deadline)
    return RemoteModel(profile, role="vision", key="")

"""
INTERRUPT = """
try:
    model().complete(GROUND)
except KeyboardInterrupt:
    sys.stdin.read()
    raise
"""
FORK = """
model().complete(GROUND)
child = os.fork()
if child:
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
model().complete(GROUND)
os._exit(42)
"""
RESOLVER = """
socket.getaddrinfo = lambda *_, **__: time.sleep(60.0)
try:
    model(deadline=0.3).complete(GROUND)
except MllmTimeout:
    sys.exit(42)
"""


def script(base_url: str, text: str) -> subprocess.Popen[str]:
    path = [os.path.dirname(__file__), *sys.path]
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(path=path, base_url=base_url) + text],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_an_interrupt_leaves_no_orphan(server: FaultServer) -> None:
    base_url = server.base_url("hang")
    visit = server.visit(base_url)
    with script(base_url, INTERRUPT) as process:
        until = time.monotonic() + 60.0
        while not visit.posts and time.monotonic() < until:
            time.sleep(0.02)
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert visit.left.wait(5.0), "the connection outlives the interrupt"
        _, said = process.communicate(timeout=30)
    assert time.monotonic() - begin < 10.0
    assert said.rstrip().endswith("KeyboardInterrupt")
    assert "Warning" not in said
    assert len(visit.posts) == 1


def test_a_forked_worker_asks_for_itself(server: FaultServer) -> None:
    base_url = server.base_url("good")
    with script(base_url, FORK) as process:
        _, said = process.communicate(timeout=60)
    assert process.returncode == 42, said
    assert len(server.visit(base_url).posts) == 2


def test_a_resolver_that_hangs_does_not_hold_up_the_exit() -> None:
    with script("http://far.invalid", RESOLVER) as process:
        _, said = process.communicate(timeout=30)
    assert process.returncode == 42, said
