"""The model ``rules``: one request in, one JSON reply out."""

from __future__ import annotations

import dataclasses
from typing import Any

from unilavira_drake.errors import MllmError
from unilavira_drake.messages import DOWN
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables
from unilavira_drake.mllm.rules.check import answer, double_check
from unilavira_drake.mllm.rules.decide import decide
from unilavira_drake.mllm.rules.dials import RulesDials
from unilavira_drake.mllm.rules.flight.decide import check_flight, decide_flight, plan_flight
from unilavira_drake.mllm.rules.flight.situation import assess_flight
from unilavira_drake.mllm.rules.flight.vision import ground_in_flight
from unilavira_drake.mllm.rules.lexicon import unused_words
from unilavira_drake.mllm.rules.mistakes import misdirected, refuse, written
from unilavira_drake.mllm.rules.perception import perceived
from unilavira_drake.mllm.rules.plan import clauses_of, items_of
from unilavira_drake.mllm.rules.situation import Situation, assess
from unilavira_drake.mllm.rules.vision import ground

NOTHING_UNDERSTOOD = "No step of the task was understood"
"""The plan for such a task; it is no clause, so the model asks to stop at once and says why."""


class RulesModel:
    """A stateless, deterministic function of one request; needs no key and no network.

    It reads the prompt's variables and the labelled detections of the views.  It sees no poses,
    no identities across views, no map and nothing behind a closed line of sight, and remembers
    only what the TODO list and the history of the request carry.

    Args:
        dials: how badly it sees, remembers, decides and writes; by default not at all.
    """

    name = "rules"
    perception = "ground_truth"
    reasoning = "rules"
    box_space = "pixels"
    deadline = 60.0
    description = "rules on the simulator's labels, not a multimodal LLM"

    def __init__(self, dials: RulesDials | None = None) -> None:
        self.dials = dials or RulesDials()
        if told := str(self.dials):
            self.name = f"{self.name} ({told})"
            self.description = f"{self.description}; made worse by {told}"

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request.

        Raises:
            MllmError: if the request carries no evidence or its call is unknown.
            ReplyRefused: by chance, if the dial ``refused`` says so.
        """
        if request.evidence is None:
            raise MllmError("rules: the request carries no labelled detections to reason on.")
        refuse(request, self.dials)
        reply = misdirected(_reply(perceived(request, self.dials)), request, self.dials)
        text = written(reply, request, self.dials)
        return Completion(text, Usage(cost_usd=0.0), self.dials.latency or None)

    def close(self) -> None:
        """Does nothing: there are no connections."""


def _reply(request: MllmRequest) -> dict[str, Any]:
    if _is_directive(request):
        return _flight_reply(request)
    request = _grounded(request)
    if isinstance(request.variables, VisionVariables):
        return ground(request.variables, request.evidence or ())
    situation = assess(request)
    if request.call == "plan_todo":
        return _plan(situation)
    if request.call in ("decide", "recover"):
        return decide(situation)
    if request.call == "double_check":
        return double_check(situation)
    if request.call == "answer":
        return answer(situation)
    raise MllmError(f"rules: unknown call {request.call!r}.")


def _is_directive(request: MllmRequest) -> bool:
    """Whether the task directs a flight; an aircraft indoors reads other tasks as a robot does."""
    variables = request.variables
    if not isinstance(variables, LanguageVariables | VisionVariables):
        return False
    return variables.in_flight and variables.family == "aerial_vln"


def _grounded(request: MllmRequest) -> MllmRequest:
    """Returns the request without the view straight down, of which rules for homes know nothing."""
    evidence = tuple(view for view in request.evidence or () if view.direction != DOWN)
    if len(evidence) == len(request.evidence or ()):
        return request
    variables = request.variables
    if isinstance(variables, LanguageVariables):
        level = tuple(view for view in variables.views if view.direction != DOWN)
        variables = dataclasses.replace(variables, views=level)
    return dataclasses.replace(request, evidence=evidence, variables=variables)


def _flight_reply(request: MllmRequest) -> dict[str, Any]:
    if isinstance(request.variables, VisionVariables):
        return ground_in_flight(request.variables, request.evidence or ())
    situation = assess_flight(request)
    if request.call == "plan_todo":
        return plan_flight(situation)
    if request.call in ("decide", "recover"):
        return decide_flight(situation)
    if request.call == "double_check":
        return check_flight(situation)
    raise MllmError(f"rules: no reply to the call {request.call!r} in flight.")


def _plan(situation: Situation) -> dict[str, Any]:
    variables = situation.variables
    clauses = clauses_of(variables.task, variables.family, situation.scene.room)
    unused = unused_words(variables.task)
    words = f"Words not used: {', '.join(unused)}." if unused else "Every word was used."
    return {
        "reasoning": f"{len(clauses)} clauses found in the text. {words}",
        "todo": items_of(clauses) or [NOTHING_UNDERSTOOD],
    }
