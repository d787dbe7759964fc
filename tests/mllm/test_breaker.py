from __future__ import annotations

from unilavira_drake.mllm.breaker import Breaker, breaker_of


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_it_opens_after_failures_in_a_row_only() -> None:
    breaker = Breaker(failures=3, cooling=30.0, clock=Clock())
    for _ in range(2):
        breaker.failed("reset")
    breaker.answered()
    for _ in range(2):
        breaker.failed("reset")
    assert breaker.admit() == 0.0
    breaker.failed("refused")
    assert breaker.admit() == 30.0
    assert breaker.state == "3 failures in a row, the last: refused"


def test_one_probe_at_a_time() -> None:
    clock = Clock()
    breaker = Breaker(failures=1, cooling=30.0, clock=clock)
    breaker.failed("reset")
    clock.now += 12.0
    assert breaker.admit() == 18.0
    clock.now += 18.0
    assert breaker.admit() == 0.0
    assert breaker.admit() == 30.0, "the probe is under way"
    clock.now += 5.0
    breaker.failed("reset")
    assert breaker.admit() == 30.0
    clock.now += 30.0
    assert breaker.admit() == 0.0
    breaker.answered()
    assert [breaker.admit() for _ in range(3)] == [0.0] * 3


def test_a_probe_that_never_tells_is_followed_by_another() -> None:
    clock = Clock()
    breaker = Breaker(failures=1, cooling=30.0, clock=clock)
    breaker.failed("reset")
    for _ in range(3):
        clock.now += 30.0
        assert breaker.admit() == 0.0


def test_an_endpoint_is_an_address_and_a_model() -> None:
    assert breaker_of("http://a", "m") is breaker_of("http://a", "m")
    assert breaker_of("http://a", "m") is not breaker_of("http://a", "n")
    assert breaker_of("http://a", "m") is not breaker_of("http://b", "m")
