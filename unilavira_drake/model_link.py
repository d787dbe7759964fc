"""The link to a model: latency in simulated time, calls outside the Context."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Protocol

from pydrake.systems.framework import Context

from unilavira_drake.errors import MllmError, ReplyFormatError
from unilavira_drake.messages import Awaited, Message
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.latency import MeasuredLatency, RealTimeLatency
from unilavira_drake.mllm.reply import Completion, MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import ModelUsage, paid
from unilavira_drake.ports import Level, message_input

_TIME_TOLERANCE = 1e-9


class DrawnLatency(Protocol):
    """How long a model thinks; a deterministic function of the request."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""


Latency = DrawnLatency | MeasuredLatency | RealTimeLatency
"""Drawn from the request, or what the model really takes."""


@dataclass(frozen=True)
class LinkState(Message):
    """The request under way or last answered, its times, the visible reply and the totals."""

    request: MllmRequest = MllmRequest()
    t_issue: float = 0.0
    """Simulated seconds."""
    t_visible: float = 0.0
    """When the reply becomes visible, simulated seconds; infinite until a reply in real time."""
    reply: MllmReply = MllmReply()
    usage: ModelUsage = ModelUsage()

    @property
    def pending(self) -> bool:
        """Whether the reply to ``request`` is not visible yet."""
        return (self.reply.n, self.reply.attempt) != (self.request.n, self.request.attempt)


class ModelLink(Level):
    """Passes each request to a model once and shows its reply when its latency is over.

    A request is new when its (n, attempt) is; the initial request (n = 0) is ignored.  The call
    runs outside the Context from the moment of the request, and is joined at the first tick at
    or after ``t_issue + latency``; physics goes on meanwhile.  A measured latency is known only
    when the reply has come, so the call is joined at once and shown later; in real time it is
    joined at the first tick after the reply has come.  An error of the model or of the way to it
    is shown as a reply with ``error`` set, never raised.

    .. pydrake_system::

        name: ModelLink
        input_ports:
        - model_request
        output_ports:
        - model_reply
        - usage
        - awaited
    """

    def __init__(self, *, broker: Broker, latency: Latency, period: float) -> None:
        """Polls its input each ``period``, seconds."""
        super().__init__(LinkState(), period=period)
        self._broker = broker
        self._latency = latency
        self._model_request = message_input(self, "model_request", MllmRequest())
        self.declare_output("model_reply", lambda state: state.reply, MllmReply())
        self.declare_output("usage", lambda state: state.usage, ModelUsage())
        self.declare_output(
            "awaited",
            lambda state: Awaited(state.t_issue if state.pending else None),
            Awaited(),
        )

    def step(self, context: Context, state: LinkState) -> LinkState:
        """Returns the state after issuing a new request or showing a due reply."""
        request = self._model_request(context)
        now = context.get_time()
        known = (state.request.n, state.request.attempt)
        if request.n > 0 and (request.n, request.attempt) != known:
            self._broker.submit(request)
            delay = self._delay(request)
            return dataclasses.replace(
                state,
                request=request,
                t_issue=now,
                t_visible=now + delay,
                usage=state.usage + ModelUsage(asked=1),
            )
        if not state.pending:
            return state
        if math.isinf(state.t_visible):
            if self._broker.done(state.request):
                return self._joined(dataclasses.replace(state, t_visible=now))
        elif now >= state.t_visible - _TIME_TOLERANCE:
            return self._joined(state)
        return state

    def _delay(self, request: MllmRequest) -> float:
        if isinstance(self._latency, RealTimeLatency):
            return math.inf
        if isinstance(self._latency, MeasuredLatency):
            # Nothing is waited for in vain: an outage must not use up the agent's simulated time.
            lost = isinstance(self._outcome(request), MllmError)
            return 0.0 if lost else self._broker.latency(request)
        return self._latency.sample(request)

    def _outcome(self, request: MllmRequest) -> Completion | MllmError | ReplyFormatError:
        try:
            return self._broker.result(request)
        except (MllmError, ReplyFormatError) as error:
            return error

    def _joined(self, state: LinkState) -> LinkState:
        outcome = self._outcome(state.request)
        lost = isinstance(outcome, MllmError)
        reply = MllmReply(
            n=state.request.n,
            attempt=state.request.attempt,
            text=outcome.text if isinstance(outcome, Completion) else "",
            error=_error(outcome),
            usage=outcome.usage if isinstance(outcome, Completion) else paid(outcome.attempts),
            latency=round(state.t_visible - state.t_issue, 9),
            infrastructure=lost,
            unusable=isinstance(outcome, ReplyFormatError) and outcome.worth_a_reask,
        )
        usage = state.usage.after(
            reply,
            attempts=outcome.attempts,
            # A model in this process has no latency of its own; how fast this machine is must not
            # reach the Context.
            seconds=outcome.latency or 0.0,
            failure=f"{type(outcome).__name__}: {outcome}" if lost else "",
        )
        return dataclasses.replace(state, reply=reply, usage=usage)


def _error(outcome: Completion | MllmError | ReplyFormatError) -> str:
    """Returns what a port tells of an error: words of the model's own, else the name alone.

    Words about a machine or a service may hold addresses and times, which belong in no Context.
    """
    if isinstance(outcome, Completion):
        return ""
    name = type(outcome).__name__
    if isinstance(outcome, MllmError):
        return name
    # What a re-ask quotes is for the model, which knows none of our names.
    return str(outcome) if outcome.worth_a_reask else f"{name}: {outcome}"
