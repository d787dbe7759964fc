"""One call to a remote model: its tries, until there is a text or a named error."""

from __future__ import annotations

import dataclasses
import functools
import json
import logging
import operator
import time
from dataclasses import dataclass
from typing import Any

import pydantic

from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmError,
    MllmRequestError,
    MllmTimeout,
    MllmUnreachable,
    ReplyFormatError,
    ReplyTruncated,
)
from unilavira_drake.mllm.address import host_of
from unilavira_drake.mllm.breaker import Breaker
from unilavira_drake.mllm.cancellation import Cancellation
from unilavira_drake.mllm.http import HttpClient, HttpLimits, HttpResponse
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY, plain_line, redact_bytes
from unilavira_drake.mllm.prices import cost_usd
from unilavira_drake.mllm.profile import Profile, StructuredMode
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.rate_limit import RateLimit
from unilavira_drake.mllm.reply import Attempt, Completion, Usage
from unilavira_drake.mllm.request import VIEW_LABEL, MllmRequest
from unilavira_drake.mllm.retrying import CallClock, Retries, RetryPolicy, TryFailed
from unilavira_drake.mllm.structured_modes import step_down, structured_mode
from unilavira_drake.mllm.tokens import estimated_tokens
from unilavira_drake.mllm.wire import WireDialect, WireFailure, WireReply

log = logging.getLogger(__name__)
"""Tells of each failed try at once, for who watches; the ledger has it when the call has ended."""

_BREAKER_SLICE = 1.0
"""Seconds between two looks at an open breaker, which another call may close."""


@dataclass(frozen=True)
class Line:
    """What all calls of one model have in common."""

    profile: Profile
    role: str
    dialect: WireDialect
    http: HttpClient
    breaker: Breaker
    limit: RateLimit
    policy: RetryPolicy
    cancellation: Cancellation

    @functools.cached_property
    def url(self) -> str:
        """Where requests are posted."""
        return self.dialect.url(self.profile)


class RemoteCall:
    """One call; used once.

    Args:
        spent: seconds of the decision's deadline that are gone.
    """

    def __init__(
        self,
        line: Line,
        request: MllmRequest,
        key: pydantic.SecretStr | None,
        *,
        spent: float = 0.0,
    ) -> None:
        self._line = line
        self._key = key
        profile = line.profile
        self._settings = profile.settings(line.role)
        if profile.peer != "rules":
            # Ground truth leaves this process for no other kind of peer, whatever a dialect does.
            request = dataclasses.replace(request, evidence=None)
        self._request = request
        self._prompt = compose_prompt(request)
        self._temperature = self._settings.temperature
        if request.attempt > 0:
            self._temperature = min(self._temperature + profile.reask_temperature, 2.0)
        self._max_output_tokens = self._settings.max_output_tokens
        left = max(self._settings.deadline - spent, 0.0)
        self._clock = CallClock(left, profile.outage_patience)
        self._attempts: list[Attempt] = []

    @property
    def seconds(self) -> float:
        """Wall-clock seconds since the call began."""
        return self._clock.elapsed

    def run(self) -> Completion:
        """Returns the reply.

        Raises:
            MllmError: as :meth:`RemoteModel.complete`; carries ``attempts``.
            ReplyFormatError: likewise.
        """
        retries = Retries(
            self._line.policy,
            max_attempts=self._line.profile.max_attempts,
            clock=self._clock,
            pause=self._line.cancellation.pause,
        )
        try:
            reply = retries.run(self._try)
        except (MllmError, ReplyFormatError) as error:
            error.attempts = tuple(self._attempts)
            raise
        # Half a surrogate pair could be written into no file; escaped, its reader still objects.
        text = reply.text.encode("utf-8", "backslashreplace").decode()
        usage = functools.reduce(operator.add, (row.usage for row in self._attempts))
        return Completion(text, usage, self._clock.elapsed, tuple(self._attempts))

    def _try(self) -> WireReply:
        """One try; what only has to be asked for in another way is asked again at once."""
        doubled = self._max_output_tokens > self._settings.max_output_tokens
        while True:
            self._wait_for_breaker()
            mode = structured_mode(self._line.profile)
            outcome, status = self._ask(mode)
            if isinstance(outcome, WireReply):
                return outcome
            if outcome.step_down and step_down(self._line.profile, mode):
                continue
            if issubclass(outcome.error, ReplyTruncated) and not doubled:
                doubled = True
                self._max_output_tokens *= 2
                continue
            if issubclass(outcome.error, ContextLengthError) and self._leave_past_out():
                continue
            raise TryFailed(
                outcome,
                away=_is_away(outcome, status),
                loading=_is_loading(outcome, status),
                seconds=self._attempts[-1].latency,
            )

    def _leave_past_out(self) -> bool:
        """Drops the pictures of the past, once; returns whether there were any."""
        now = tuple(image for image in self._request.images if image.label.startswith(VIEW_LABEL))
        if not now or len(now) == len(self._request.images):
            return False
        self._request = dataclasses.replace(self._request, images=now)
        self._prompt = compose_prompt(self._request)
        return True

    def _wait_for_breaker(self) -> None:
        breaker = self._line.breaker
        while (wait := breaker.admit()) > 0.0:
            pause = min(wait, _BREAKER_SLICE, self._clock.patience)
            if pause <= 0.0:
                raise MllmUnreachable(
                    f"{host_of(self._line.url)} is not asked for now after {breaker.state} "
                    f"The next try is due in {wait:.0f} s."
                )
            self._line.cancellation.pause(pause)
            self._clock.put_off(pause)

    def _ask(self, mode: StructuredMode) -> tuple[WireReply | WireFailure, int | None]:
        """One request on the wire; adds a row to the attempts, whatever comes of it."""
        line, model = self._line, self._line.profile.model
        expected = estimated_tokens(self._prompt, line.profile)
        booking = line.limit.book(expected, within=self._clock.remaining)
        line.cancellation.pause(booking.wait)
        body = line.dialect.body(
            self._prompt,
            self._request,
            line.profile,
            structured=mode,
            temperature=self._temperature,
            max_output_tokens=self._max_output_tokens,
        )
        begin = time.monotonic()
        answer = self._exchange(body)
        seconds = time.monotonic() - begin
        status = answer.status if isinstance(answer, HttpResponse) else None
        outcome = self._read(answer) if isinstance(answer, HttpResponse) else answer
        outcome = self._with_words(outcome)
        self._tell_breaker(outcome, status)
        usage = self._priced(outcome, status)
        if usage.input_tokens or usage.output_tokens:
            line.limit.correct(booking, usage.input_tokens + usage.output_tokens)
        if isinstance(outcome, WireReply):
            detail = f"answered by {outcome.model}" if outcome.model not in ("", model) else ""
            self._note("ok", status, usage, seconds, detail)
        else:
            self._note(outcome.error.__name__, status, usage, seconds, outcome.message)
            log.info("try %d failed: %s", len(self._attempts), outcome.message)
        return outcome, status

    def _exchange(self, body: bytes) -> HttpResponse | WireFailure:
        line, profile = self._line, self._line.profile
        limits = HttpLimits(
            min(self._settings.attempt_deadline, self._clock.remaining),
            profile.connect_timeout,
            profile.max_reply_bytes,
        )
        if limits.deadline <= 0.0:
            raise MllmTimeout(f"no reply within {self._settings.deadline:g} s.")
        key = self._key.get_secret_value() if self._key is not None else None
        headers, begin = line.dialect.headers(key), time.monotonic()
        try:
            exchange = line.http.submit("POST", line.url, headers=headers, body=body, limits=limits)
            return line.cancellation.result(exchange)
        except BaseException:
            self._note("cancelled", None, Usage(), time.monotonic() - begin, "")
            raise

    def _read(self, answer: HttpResponse) -> WireReply | WireFailure:
        # Before anyone cuts words out of it: half of a key is found by nobody afterwards.
        body = redact_bytes(answer.body, self._key)
        if 300 <= answer.status < 400:
            target = host_of(answer.headers.get("location", "")) or "another path"
            return WireFailure(
                MllmRequestError,
                f"HTTP {answer.status}: it redirects to {target}, which is not followed because "
                "the key would go along; set base_url to the final address.",
            )
        return self._line.dialect.read(answer.status, answer.headers, parsed(body), body)

    def _with_words(self, outcome: WireReply | WireFailure) -> WireReply | WireFailure:
        """A failure's message as a person should read it."""
        if isinstance(outcome, WireReply):
            return outcome
        host, message = host_of(self._line.url), outcome.message
        # A reply's own fault is told in the re-ask, and no address belongs in a prompt.
        if host not in message and not issubclass(outcome.error, ReplyFormatError):
            message = f"{host}: {message}"
        if issubclass(outcome.error, MllmAuthenticationError):
            names = f"{ROLE_KEYS[self._line.role]} or {SHARED_KEY}"
            message += f" Check {names}." if self._key else f" No key was sent; set {names}."
        return dataclasses.replace(outcome, message=plain_line(message, self._key))

    def _tell_breaker(self, outcome: WireReply | WireFailure, status: int | None) -> None:
        # One that is overloaded is there; its calls wait by themselves.
        if isinstance(outcome, WireFailure) and _is_away(outcome, status) and status != 503:
            self._line.breaker.failed(outcome.message)
        else:
            self._line.breaker.answered()

    def _priced(self, outcome: WireReply | WireFailure, status: int | None) -> Usage:
        """What an attempt has cost; None where its provider may have worked without telling."""
        usage, prices = outcome.usage, self._line.profile.prices
        counted = bool(usage.input_tokens or usage.output_tokens)
        free = usage.cost_usd == 0.0 or (status is not None and status >= 300)
        cost = 0.0 if free and not counted and prices is not None else cost_usd(usage, prices)
        shown = counted or isinstance(outcome, WireReply)
        images = len(self._prompt.images) if shown else 0
        return dataclasses.replace(usage, images=images, cost_usd=cost)

    def _note(
        self, status: str, http_status: int | None, usage: Usage, seconds: float, detail: str
    ) -> None:
        model = self._line.profile.model
        detail = plain_line(detail, self._key)
        self._attempts.append(Attempt(model, status, http_status, usage, seconds, detail))


def parsed(body: bytes) -> Any:
    """Returns the JSON value of a body, or None if it is none.

    Whatever its ``Content-Type`` says; a byte order mark is taken off.
    """
    try:
        return json.loads(body.decode("utf-8-sig"), parse_constant=_refuse)
    # Beside malformed text: too deep a nesting, or an integer of thousands of digits.
    except (ValueError, RecursionError):
        return None


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON")


def _is_away(failure: WireFailure, status: int | None) -> bool:
    nobody = failure.retryable and issubclass(failure.error, MllmUnreachable | MllmTimeout)
    return nobody and (status is None or status in (502, 503, 504))


def _is_loading(failure: WireFailure, status: int | None) -> bool:
    return status == 503 and failure.retryable and "loading" in failure.message.lower()
