"""The link to a model: latency in simulated time, calls outside the Context."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Protocol

from pydrake.systems.framework import Context

from unilavira_drake.errors import MllmError
from unilavira_drake.messages import Message
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.reply import Completion, MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.ports import Level, message_input

_TIME_TOLERANCE = 1e-9


class Latency(Protocol):
    """How long a model thinks; a deterministic function of the request."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""


@dataclass(frozen=True)
class LinkState(Message):
    """The request under way or last answered, its times, the visible reply and the totals."""

    request: MllmRequest = MllmRequest()
    t_issue: float = 0.0
    """Simulated seconds."""
    t_visible: float = 0.0
    """When the reply becomes visible, simulated seconds."""
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
    or after ``t_issue + latency``; physics goes on meanwhile.  An error of the model is shown as
    a reply with ``error`` set, never raised.

    .. pydrake_system::
        name: ModelLink
        input_ports:
        - model_request
        output_ports:
        - model_reply
        - usage
    """

    def __init__(self, *, broker: Broker, latency: Latency, period: float) -> None:
        """Polls its input each ``period``, seconds."""
        super().__init__(LinkState(), period=period)
        self._broker = broker
        self._latency = latency
        self._model_request = message_input(self, "model_request", MllmRequest())
        self.declare_output("model_reply", lambda state: state.reply, MllmReply())
        self.declare_output("usage", lambda state: state.usage, ModelUsage())

    def step(self, context: Context, state: LinkState) -> LinkState:
        """Returns the state after issuing a new request or showing a due reply."""
        request = self._model_request(context)
        now = context.get_time()
        known = (state.request.n, state.request.attempt)
        if request.n > 0 and (request.n, request.attempt) != known:
            self._broker.submit(request)
            return dataclasses.replace(
                state, request=request, t_issue=now, t_visible=now + self._latency.sample(request)
            )
        if state.pending and now >= state.t_visible - _TIME_TOLERANCE:
            return self._joined(state)
        return state

    def _joined(self, state: LinkState) -> LinkState:
        error = ""
        try:
            completion = self._broker.result(state.request)
        except MllmError as failure:
            completion, error = Completion(), f"{type(failure).__name__}: {failure}"
        reply = MllmReply(
            n=state.request.n,
            attempt=state.request.attempt,
            text=completion.text,
            error=error,
            usage=completion.usage,
            latency=round(state.t_visible - state.t_issue, 9),
        )
        total = state.usage.total if error else state.usage.total + completion.usage
        usage = ModelUsage(state.usage.calls + 1, state.usage.errors + bool(error), total)
        return dataclasses.replace(state, reply=reply, usage=usage)
