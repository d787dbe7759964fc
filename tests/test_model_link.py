from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable

import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator

from unilavira_drake.errors import MllmError, ReplyRefused
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.latency import (
    ConstantLatency,
    LognormalLatency,
    MeasuredLatency,
    NoLatency,
    RealTimeLatency,
)
from unilavira_drake.mllm.reply import Attempt, Completion, MllmReply, Usage
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.model_link import Latency, ModelLink

COST = Usage(100, 20, 4, 0.5)


class Backend:
    name = "test"
    perception = "images"
    reasoning = "model"
    box_space = "pixels"
    description = "A test's own model."

    def __init__(self, reply: Callable[[MllmRequest], str], deadline: float) -> None:
        self.deadline = deadline
        self._reply = reply

    def complete(self, request: MllmRequest) -> Completion:
        return Completion(self._reply(request), COST, latency=1.25)

    def close(self) -> None:
        pass


def _echo(request: MllmRequest) -> str:
    return f"{request.n}.{request.attempt}"


class Bench:
    """A link in a Simulator of its own, with a hand on its input and an eye on its outputs."""

    def __init__(
        self,
        reply: Callable[[MllmRequest], str] = _echo,
        latency: Latency | None = None,
        deadline: float = 10.0,
    ) -> None:
        self.broker = Broker(Backend(reply, deadline), max_workers=2, grace=0.0)
        self.link = ModelLink(broker=self.broker, latency=latency or NoLatency(), period=0.1)
        self.simulator = Simulator(self.link)
        self.ask(self.simulator, MllmRequest())

    def ask(self, simulator: Simulator, request: MllmRequest) -> None:
        port = self.link.GetInputPort("model_request")
        port.FixValue(simulator.get_mutable_context(), AbstractValue.Make(request))

    def reply(self, simulator: Simulator) -> MllmReply:
        reply: MllmReply = self.link.GetOutputPort("model_reply").Eval(simulator.get_context())
        return reply

    def usage(self, simulator: Simulator) -> ModelUsage:
        usage: ModelUsage = self.link.GetOutputPort("usage").Eval(simulator.get_context())
        return usage


def test_the_initial_request_is_ignored() -> None:
    bench = Bench()
    bench.simulator.AdvanceTo(1.0)
    assert bench.reply(bench.simulator) == MllmReply()
    assert bench.usage(bench.simulator) == ModelUsage()
    assert bench.broker.calls == 0


@pytest.mark.parametrize("seconds", [0.3, 2.0, 40.0])
def test_the_reply_is_visible_at_issue_plus_latency(seconds: float) -> None:
    bench = Bench(latency=ConstantLatency(seconds))
    simulator = bench.simulator
    simulator.AdvanceTo(0.95)
    bench.ask(simulator, MllmRequest(n=1, call="decide"))
    issued = 1.0
    simulator.AdvanceTo(issued + seconds - 0.05)
    assert bench.reply(simulator) == MllmReply()
    simulator.AdvanceTo(issued + seconds + 0.05)
    assert bench.reply(simulator) == MllmReply(1, 0, "1.0", "", COST, seconds)


def test_no_latency_means_the_next_tick_and_a_reask_is_a_new_request() -> None:
    bench = Bench()
    simulator = bench.simulator
    for attempt in (0, 1):
        bench.ask(simulator, MllmRequest(n=1, attempt=attempt))
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.25)
        assert bench.reply(simulator).text == f"1.{attempt}"
    simulator.AdvanceTo(3.0)
    assert bench.broker.calls == 2
    assert bench.usage(simulator) == ModelUsage(2, 0, 2, Usage(200, 40, 8, 1.0), 1.0, 2.5, asked=2)


def test_clones_share_one_call_and_one_future() -> None:
    bench = Bench(latency=LognormalLatency(median=5.0))
    simulator = bench.simulator
    bench.ask(simulator, MllmRequest(n=1, seed=3))
    simulator.AdvanceTo(1.0)  # The call is under way now.
    other = Simulator(bench.link, simulator.get_context().Clone())
    for each in (simulator, other):
        each.AdvanceTo(30.0)
        bench.ask(each, MllmRequest(n=2, seed=3))
        each.AdvanceTo(60.0)
    assert bench.reply(simulator) == bench.reply(other)
    assert bench.reply(simulator).text == "2.0"
    assert bench.usage(simulator) == bench.usage(other)
    assert bench.broker.calls == 2


def test_an_unmoved_robot_gets_a_new_reply_under_a_new_number() -> None:
    bench = Bench()
    request = MllmRequest(n=1, call="decide")
    for n in (1, 2):
        bench.ask(bench.simulator, dataclasses.replace(request, n=n))
        bench.simulator.AdvanceTo(float(n))
    assert bench.reply(bench.simulator).text == "2.0"


def test_an_error_is_a_value() -> None:
    def refuse(request: MllmRequest) -> str:
        if request.n == 1:
            raise MllmError("the service answered 503")
        return "fine"

    bench = Bench(refuse)
    bench.ask(bench.simulator, MllmRequest(n=1))
    bench.simulator.AdvanceTo(1.0)
    reply = bench.reply(bench.simulator)
    assert (reply.n, reply.text, reply.usage) == (1, "", Usage(cost_usd=0.0))
    assert reply.infrastructure
    # Its words may hold an address or a time of the day, and replies stand in transcripts.
    assert reply.error == "MllmError"
    bench.ask(bench.simulator, MllmRequest(n=2))
    bench.simulator.AdvanceTo(2.0)
    assert (bench.reply(bench.simulator).text, bench.reply(bench.simulator).error) == ("fine", "")
    usage = bench.usage(bench.simulator)
    assert (usage.calls, usage.errors, usage.attempts, usage.total) == (2, 1, 2, COST)
    assert usage.failure == "MllmError: the service answered 503"


def test_a_refusal_is_the_model_s_own_and_is_paid_for() -> None:
    def refuse(request: MllmRequest) -> str:
        error = ReplyRefused("blocked by a filter")
        error.attempts, error.latency = (Attempt("m", usage=COST), Attempt("m", usage=COST)), 3.0
        raise error

    bench = Bench(refuse)
    bench.ask(bench.simulator, MllmRequest(n=1))
    bench.simulator.AdvanceTo(1.0)
    reply = bench.reply(bench.simulator)
    assert reply.error == "ReplyRefused: blocked by a filter"
    assert not reply.infrastructure
    assert reply.usage == COST + COST
    assert bench.usage(bench.simulator) == ModelUsage(1, 1, 2, COST + COST, 1.0, 3.0, asked=1)


def test_what_is_known_of_a_cost_counts_beside_what_is_not() -> None:
    known, unknown = Usage(10, 5, 0, 0.25), Usage(0, 0, 0, None)
    attempts = (
        Attempt("m", "MllmTimeout", usage=unknown),
        Attempt("m", http_status=200, usage=known),
        Attempt("m", http_status=200, usage=unknown),
    )
    reply = MllmReply(1, usage=known + unknown)
    usage = ModelUsage().after(reply, attempts=attempts, seconds=1.0)
    assert (usage.spent_usd, usage.total.cost_usd, usage.attempts) == (0.25, None, 3)
    assert usage.uncounted == 1


def test_a_measured_latency_is_what_the_model_says_it_took() -> None:
    bench = Bench(latency=MeasuredLatency())
    simulator = bench.simulator
    bench.ask(simulator, MllmRequest(n=1))
    simulator.AdvanceTo(1.2)  # Asked at 0.0125.
    assert bench.reply(simulator) == MllmReply()
    simulator.AdvanceTo(1.4)
    assert bench.reply(simulator).latency == 1.25


def test_an_outage_takes_no_simulated_time() -> None:
    def lose(request: MllmRequest) -> str:
        error = MllmError("no connection")
        error.latency = 720.0
        raise error

    bench = Bench(lose, latency=MeasuredLatency())
    bench.ask(bench.simulator, MllmRequest(n=1))
    bench.simulator.AdvanceTo(1.0)
    assert bench.reply(bench.simulator).infrastructure
    assert bench.usage(bench.simulator).seconds == 720.0


def test_in_real_time_the_reply_is_visible_when_it_has_come() -> None:
    gate = threading.Event()
    bench = Bench(lambda request: str(gate.wait(10.0)), RealTimeLatency())
    simulator = bench.simulator
    bench.ask(simulator, MllmRequest(n=1))
    simulator.AdvanceTo(30.0)  # The robot goes on.
    assert bench.reply(simulator) == MllmReply()
    gate.set()
    while not bench.broker.done(MllmRequest(n=1)):
        time.sleep(0.001)
    simulator.AdvanceTo(30.2)
    assert bench.reply(simulator).text == "True"
    assert bench.reply(simulator).latency == pytest.approx(30.0, abs=0.2)


def test_silence_is_the_named_timeout() -> None:
    gate = threading.Event()
    bench = Bench(lambda request: str(gate.wait(10.0)), deadline=0.05)
    bench.ask(bench.simulator, MllmRequest(n=1))
    bench.simulator.AdvanceTo(1.0)
    gate.set()
    assert bench.reply(bench.simulator).error == "MllmTimeout"
    assert bench.usage(bench.simulator).failure == "MllmTimeout: no reply within 0.05 s."


def test_a_bug_of_the_backend_is_raised() -> None:
    def bug(request: MllmRequest) -> str:
        raise ZeroDivisionError("bug")

    bench = Bench(bug)
    bench.ask(bench.simulator, MllmRequest(n=1))
    with pytest.raises(ZeroDivisionError):
        bench.simulator.AdvanceTo(1.0)


def test_unknown_cost_stays_unknown() -> None:
    assert (ModelUsage().total + Usage(1, 1, 0, None)).cost_usd is None
    assert (ModelUsage().total + COST).cost_usd == pytest.approx(0.5)
