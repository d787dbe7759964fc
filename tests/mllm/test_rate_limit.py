from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import MllmQuotaError, MllmTimeout
from unilavira_drake.mllm.rate_limit import RateLimit

FOREVER = 1e9


class Clock:
    def __init__(self) -> None:
        self.now = 1_000_000.0

    def __call__(self) -> float:
        return self.now


def limit_of(
    folder: Path, clock: Clock, requests: float | None = None, tokens: float | None = None
) -> RateLimit:
    return RateLimit(
        "endpoint",
        requests_per_minute=requests,
        tokens_per_minute=tokens,
        folder=folder,
        clock=clock,
    )


def test_without_limits_nothing_is_written(tmp_path: Path) -> None:
    limit = limit_of(tmp_path, Clock())
    assert limit.book(10**9, within=0.0).wait == 0.0
    assert list(tmp_path.iterdir()) == []


def test_requests(tmp_path: Path) -> None:
    clock = Clock()
    limit = limit_of(tmp_path, clock, requests=3)
    waits = []
    for _ in range(5):
        waits.append(limit.book(1, within=FOREVER).wait)
        clock.now += 1.0
    # The 4th may come a minute after the 1st, and they queue.
    assert waits == pytest.approx([0.0, 0.0, 0.0, 57.0, 57.0])


def test_less_than_one_request_a_minute(tmp_path: Path) -> None:
    limit = limit_of(tmp_path, Clock(), requests=0.5)
    assert [limit.book(1, within=FOREVER).wait for _ in range(3)] == [0.0, 120.0, 240.0]


def test_tokens(tmp_path: Path) -> None:
    clock = Clock()
    limit = limit_of(tmp_path, clock, tokens=1000)
    assert limit.book(600, within=FOREVER).wait == 0.0
    clock.now += 10.0
    assert limit.book(400, within=FOREVER).wait == 0.0
    assert limit.book(1, within=FOREVER).wait == 50.0
    # More than the limit allows at all: alone, in a minute of its own.
    assert limit.book(5000, within=FOREVER).wait == pytest.approx(110.0)


def test_what_a_request_has_really_cost_counts(tmp_path: Path) -> None:
    limit = limit_of(tmp_path, Clock(), tokens=1000)
    booking = limit.book(900, within=FOREVER)
    limit.correct(booking, 300)
    assert limit.book(700, within=FOREVER).wait == 0.0
    assert limit.book(1, within=FOREVER).wait == 60.0


def test_a_wait_that_is_too_long_books_nothing(tmp_path: Path) -> None:
    limit = limit_of(tmp_path, Clock(), requests=1)
    limit.book(1, within=0.0)
    for _ in range(3):
        with pytest.raises(MllmQuotaError, match="1 requests a minute allows the next request"):
            limit.book(1, within=30.0)
    assert limit.book(1, within=61.0).wait == 60.0


@settings(
    derandomize=True,
    deadline=None,
    max_examples=30,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    asked=st.lists(st.tuples(st.floats(0.0, 40.0), st.integers(1, 500)), min_size=1, max_size=25),
    requests=st.sampled_from([None, 1.0, 2.5, 4.0]),
    tokens=st.sampled_from([None, 500.0, 900.0]),
)
def test_no_minute_ever_holds_more_than_is_allowed(
    asked: list[tuple[float, int]],
    requests: float | None,
    tokens: float | None,
    tmp_path: Path,
) -> None:
    for file in tmp_path.iterdir():
        file.unlink()
    clock = Clock()
    limit = limit_of(tmp_path, clock, requests, tokens)
    sent = []
    for pause, count in asked:
        clock.now += pause
        booking = limit.book(count, within=FOREVER)
        sent.append((clock.now + booking.wait, count))
        if booking.wait > 300.0:  # As the longest deadline has it.
            clock.now += booking.wait
    assert sent == sorted(sent, key=lambda place: place[0])
    for moment, _ in sent:
        window = [count for at, count in sent if moment <= at < moment + 60.0 - 1e-6]
        if requests is not None:
            assert len(window) <= max(int(requests), 1)
        if tokens is not None:
            assert sum(window) <= tokens or len(window) == 1


def test_a_damaged_file_and_another_clock_are_forgiven(tmp_path: Path) -> None:
    clock = Clock()
    limit = limit_of(tmp_path, clock, requests=1)
    limit.book(1, within=FOREVER)
    (file,) = tmp_path.glob("*.json")
    file.write_text('[["a", 12')
    assert limit.book(1, within=FOREVER).wait == 0.0
    clock.now -= 86_400.0
    assert limit.book(1, within=FOREVER).wait == 0.0


def test_a_lock_that_is_not_given_back_ends_at_the_deadline(tmp_path: Path) -> None:
    limit = limit_of(tmp_path, Clock(), requests=1)
    limit.book(1, within=FOREVER)
    (file,) = tmp_path.glob("*.lock")
    with file.open("w") as holder:
        fcntl.flock(holder, fcntl.LOCK_EX)
        with pytest.raises(MllmTimeout, match="locked by another process"):
            limit.book(1, within=0.1)
    assert limit.book(1, within=FOREVER).wait == 60.0


WORKER = """
import os, sys
from pathlib import Path
from unilavira_drake.mllm.rate_limit import RateLimit
limit = RateLimit("endpoint", requests_per_minute=10, tokens_per_minute=None,
                  folder=Path(sys.argv[1]), clock=lambda: 1000.0)
print(*(limit.book(1, within=1e9).wait for _ in range(20)), flush=True)
os.kill(os.getpid(), 9)
"""


def test_processes_share_a_limit_and_may_die(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", WORKER, str(tmp_path)],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for _ in range(3)
    ]
    waits = sorted(
        float(wait) for worker in workers for wait in worker.communicate(timeout=60)[0].split()
    )
    assert waits == [60.0 * (n // 10) for n in range(60)]
    limit = RateLimit(
        "endpoint",
        requests_per_minute=10,
        tokens_per_minute=None,
        folder=tmp_path,
        clock=lambda: 1000.0,
    )
    assert limit.book(1, within=FOREVER).wait == 360.0


def test_the_users_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    limit = RateLimit("endpoint", requests_per_minute=5, tokens_per_minute=None)
    limit.book(1, within=1.0)
    assert len(list((tmp_path / "unilavira" / "rates").iterdir())) == 2
    # A home that cannot be written.
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    limit.book(1, within=1.0)
    assert list(tmp_path.glob("unilavira-*/rates/*.json"))
