from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from unilavira_drake.errors import MllmError, MllmQuotaError, MllmUnreachable, ReplyRefused
from unilavira_drake.mllm.retrying import CallClock, Retries, RetryPolicy, TryFailed
from unilavira_drake.mllm.wire import WireFailure

DOWN = WireFailure(MllmUnreachable, "down.", retryable=True)


class Time:
    """A clock that only waiting moves."""

    def __init__(self) -> None:
        self.now = 50.0
        self.waits: list[float] = []

    def __call__(self) -> float:
        return self.now

    def pause(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.now += seconds


def run(
    time: Time,
    *failures: TryFailed,
    deadline: float = 100.0,
    patience: float = 0.0,
    max_attempts: int = 4,
) -> str:
    clock = CallClock(deadline, patience, time)
    retries = Retries(RetryPolicy(), max_attempts=max_attempts, clock=clock, pause=time.pause)
    rest = list(failures)

    def attempt() -> str:
        if rest:
            failed = rest.pop(0)
            time.now += failed.seconds
            raise failed
        return "text"

    return retries.run(attempt)


@pytest.fixture
def time() -> Time:
    random.seed(5)
    return Time()


def test_waits_are_drawn_below_a_bound_that_doubles() -> None:
    longest = [0.0] * 9
    shortest = [99.0] * 9
    for _ in range(300):
        time = Time()
        run(time, *[TryFailed(DOWN)] * 9, max_attempts=10, deadline=1e4)
        longest = [max(pair) for pair in zip(longest, time.waits, strict=True)]
        shortest = [min(pair) for pair in zip(shortest, time.waits, strict=True)]
    bounds = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0]
    assert all(0.9 * bound < wait <= bound for wait, bound in zip(longest, bounds, strict=True))
    assert all(wait < 0.1 * bound for wait, bound in zip(shortest, bounds, strict=True))


def test_a_named_time_is_believed(time: Time) -> None:
    named = WireFailure(MllmQuotaError, "too many.", retryable=True, retry_after=20.0)
    assert run(time, TryFailed(named)) == "text"
    assert 20.0 <= time.waits[0] <= 20.5


def test_a_named_time_that_is_too_far_off_is_told(time: Time) -> None:
    for seconds, deadline in ((61.0, 1000.0), (30.0, 29.0)):
        named = WireFailure(MllmUnreachable, "busy.", retryable=True, retry_after=seconds)
        with pytest.raises(MllmQuotaError, match=rf"^busy\. .* next try in {seconds:.0f} s, at 2"):
            run(time, TryFailed(named), deadline=deadline)
    assert time.waits == []


def test_tries_are_counted(time: Time) -> None:
    with pytest.raises(MllmUnreachable, match=r"^down\. \(4 tries\)$"):
        run(time, *[TryFailed(DOWN)] * 9)
    assert len(time.waits) == 3


def test_no_try_begins_after_the_deadline(time: Time) -> None:
    with pytest.raises(MllmUnreachable, match="1 try, the next one would come after the deadline"):
        run(time, TryFailed(DOWN, seconds=100.0), deadline=100.0)
    assert time.waits == []


@pytest.mark.parametrize("error", [ReplyRefused, MllmQuotaError])
def test_what_is_final_is_raised_at_once(error: type[MllmError | ReplyRefused], time: Time) -> None:
    with pytest.raises(error, match=r"^no\.$"):
        run(time, TryFailed(WireFailure(error, "no.")))
    assert time.waits == []


def test_an_absent_endpoint_costs_patience_not_tries(time: Time) -> None:
    absent = [TryFailed(DOWN, away=True, seconds=10.0)] * 8
    assert run(time, *absent, deadline=15.0, patience=300.0) == "text"
    with pytest.raises(MllmUnreachable, match="4 tries"):
        run(time, *absent, deadline=1000.0)


def test_patience_ends(time: Time) -> None:
    begin = time.now
    with pytest.raises(MllmUnreachable):
        run(time, *[TryFailed(DOWN, away=True, seconds=10.0)] * 99, deadline=15.0, patience=60.0)
    assert 50.0 <= time.now - begin <= 75.0 + 10.0


def test_a_model_that_is_being_loaded_is_waited_for_until_the_deadline(time: Time) -> None:
    loading = [TryFailed(DOWN, loading=True)] * 12
    assert run(time, *loading, deadline=1000.0) == "text"
    with pytest.raises(MllmUnreachable, match="after the deadline of 30 s"):
        run(time, *loading * 10, deadline=30.0)


def test_a_pause_may_give_the_call_up() -> None:
    def interrupted(_: float) -> None:
        raise MllmError("closed.")

    pause: Callable[[float], None] = interrupted
    retries = Retries(RetryPolicy(), max_attempts=4, clock=CallClock(9.0, 0.0), pause=pause)

    def attempt() -> str:
        raise TryFailed(DOWN)

    with pytest.raises(MllmError, match="closed"):
        retries.run(attempt)
