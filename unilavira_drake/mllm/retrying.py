"""Which failed tries of a call are repeated, when, and which error remains in the end.

Waits are drawn with full jitter (uniform between 0 and a bound that doubles), so that workers
that failed together do not come back together; a server that names a time is believed.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import tenacity

from unilavira_drake.errors import MllmQuotaError, UniLaviraError
from unilavira_drake.messages import Message
from unilavira_drake.mllm.wire import WireFailure

T = TypeVar("T")


@dataclass(frozen=True)
class RetryPolicy(Message):
    """Waits between tries, wall-clock seconds."""

    base: float = 0.5
    """Bound of the first wait; it doubles with each try."""
    cap: float = 30.0
    longest_wait: float = 60.0
    """A server that asks for more is not asked again in this call."""


class TryFailed(Exception):
    """One try gave no text.

    Args:
        failure: why.
        away: whether there is no model at that address at present (no connection, an outage, a
            model that is still being loaded), so that waiting may help where trying does not.
        loading: whether the server says itself that it will be ready soon.
        seconds: how long the try took.
    """

    def __init__(
        self,
        failure: WireFailure,
        *,
        away: bool = False,
        loading: bool = False,
        seconds: float = 0.0,
    ) -> None:
        super().__init__(failure.message)
        self.failure = failure
        self.away = away or loading
        self.loading = loading
        self.seconds = seconds


class CallClock:
    """The time that one call has: a deadline, put off while its endpoint is away.

    Args:
        deadline: seconds for the call.
        patience: seconds by which waiting for an absent endpoint may put the deadline off.
        clock: seconds that never run backwards.
    """

    def __init__(
        self, deadline: float, patience: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock = clock
        self._start = clock()
        self._time = deadline
        self.deadline = deadline
        self.patience = patience

    @property
    def elapsed(self) -> float:
        """Seconds since the call began."""
        return self._clock() - self._start

    @property
    def remaining(self) -> float:
        """Seconds that are left; never negative."""
        return max(self._time - self.elapsed, 0.0)

    def put_off(self, seconds: float) -> None:
        """Gives back time that was spent on waiting, as far as patience goes."""
        granted = min(seconds, self.patience)
        self.patience -= granted
        self._time += granted


class Retries:
    """Runs the tries of one call.

    Args:
        policy: the waits.
        max_attempts: how many tries at most; those that found the endpoint away while there is
            patience left, or still loading, are not counted.
        clock: the call's time; no try begins after its end.
        pause: waits some seconds; may raise to give the call up.
    """

    def __init__(
        self,
        policy: RetryPolicy,
        *,
        max_attempts: int,
        clock: CallClock,
        pause: Callable[[float], None],
    ) -> None:
        self._policy = policy
        self._max_attempts = max_attempts
        self._clock = clock
        self._pause = pause
        self._jitter = tenacity.wait_random_exponential(multiplier=policy.base, max=policy.cap)
        self._tries = 0
        self._counted = 0
        self._end = ""

    def run(self, attempt: Callable[[], T]) -> T:
        """Returns what the first successful try returns.

        Raises:
            UniLaviraError: the error that the last failure names; a time to wait that is too
                long becomes an MllmQuotaError that tells when to come back.
        """
        retrying = tenacity.Retrying(
            retry=tenacity.retry_if_exception(self._may_help),
            wait=self._wait,
            stop=self._stop,
            sleep=self._pause,
            reraise=True,
        )
        try:
            return retrying(attempt)
        except TryFailed as failed:
            raise self._error(failed.failure) from None

    def _may_help(self, error: BaseException) -> bool:
        if not isinstance(error, TryFailed):
            return False
        self._tries += 1
        wait = error.failure.retry_after
        return error.failure.retryable and (wait is None or wait <= self._policy.longest_wait)

    def _wait(self, state: tenacity.RetryCallState) -> float:
        # A named time with some jitter on top: it is the same for all who were turned away.
        return (_failed(state).failure.retry_after or 0.0) + self._jitter(state)

    def _stop(self, state: tenacity.RetryCallState) -> bool:
        failed = _failed(state)
        patient = failed.away and self._clock.patience > 0.0
        if patient:
            self._clock.put_off(failed.seconds + state.upcoming_sleep)
        if not (patient or failed.loading):
            self._counted += 1
        if self._counted >= self._max_attempts:
            self._end = f"{self._tries} tries"
        elif state.upcoming_sleep >= self._clock.remaining:
            self._end = (
                f"{self._tries} {'try' if self._tries == 1 else 'tries'}, the next one would "
                f"come after the deadline of {self._clock.deadline:g} s"
            )
        return bool(self._end)

    def _error(self, failure: WireFailure) -> UniLaviraError:
        wait = failure.retry_after
        if failure.retryable and wait is not None:
            too_long = wait > self._policy.longest_wait
            if too_long or wait >= self._clock.remaining:
                when = datetime.datetime.now() + datetime.timedelta(seconds=min(wait, 1e7))
                return MllmQuotaError(
                    f"{failure.message} The server allows the next try in {wait:.0f} s, at "
                    f"{when:%Y-%m-%d %H:%M:%S}."
                )
        return failure.error(failure.message + (f" ({self._end})" if self._end else ""))


def _failed(state: tenacity.RetryCallState) -> TryFailed:
    error = state.outcome.exception() if state.outcome is not None else None
    assert isinstance(error, TryFailed)
    return error
