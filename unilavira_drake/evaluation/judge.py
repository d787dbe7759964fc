"""A model's mark for an answer: how well it says what was expected, from 1 to 5.

The scale is that of OpenEQA's LLM-Match (Majumdar et al., "OpenEQA: Embodied Question Answering in
the Era of Foundation Models", 2024): a mark m counts as (m - 1) / 4, no answer as 0.  The words of
the prompt are our own, so marks of other work cannot be compared one to one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from unilavira_drake.errors import MllmError, ReplyFormatError
from unilavira_drake.evaluation.scoring import Score
from unilavira_drake.messages import Message
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.prompt import template_text
from unilavira_drake.mllm.reply import Completion, MllmReply
from unilavira_drake.mllm.reply_forms import JudgeReply
from unilavira_drake.mllm.request import FreeVariables, MllmRequest
from unilavira_drake.mllm.usage import ModelUsage, paid
from unilavira_drake.task_choice import EpisodeTask

RequestListener = Callable[[MllmRequest], None]

MAX_REASKS = 1
LOWEST, HIGHEST = 1, 5
REASONING_LIMIT = 400
"""Characters of a judge's sentence that are kept."""


@dataclass(frozen=True)
class Judgement(Message):
    """What a judge made of an answer, and what that cost."""

    model: str = ""
    """The judge's name."""
    mark: int | None = None
    """From 1 to 5; None when no reply could be had."""
    reasoning: str = ""
    """The sentence that explains the mark."""
    usage: ModelUsage = ModelUsage()
    error: str = ""
    """Why there is no mark: the named error."""
    interrupted: bool = False
    """Whether there is none because a person did not wait for it."""

    @property
    def score(self) -> float | None:
        """The mark as a number from 0 to 1."""
        return None if self.mark is None else (self.mark - LOWEST) / (HIGHEST - LOWEST)


def judge_request(
    question: str, answer: str, accepted: Sequence[str], *, seed: int = 0, feedback: str = ""
) -> MllmRequest:
    """Returns what a judge is asked: a text, without any picture.

    Args:
        question: as it was put to the agent.
        answer: the agent's.
        accepted: the expected answer first, then others that count.
        seed: of the episode.
        feedback: what was wrong with the reply to the first attempt.
    """
    text = template_text(
        "judge/answer.txt.j2",
        question=question,
        answer=answer,
        expected=tuple(accepted),
        feedback=feedback,
    )
    return MllmRequest(
        role="judge",
        n=1,
        attempt=int(bool(feedback)),
        seed=seed,
        call="judge",
        variables=FreeVariables(text),
    )


def judge(
    broker: Broker,
    question: str,
    answer: str,
    accepted: Sequence[str],
    *,
    seed: int = 0,
    on_request: RequestListener | None = None,
) -> Judgement:
    """Returns a model's judgement on an answer; without an answer the model is not asked.

    A reply that cannot be used is asked for once more, with what was wrong with it.  What stands
    in the way of a mark is told and never raised.

    Args:
        broker: of the judge, see :func:`unilavira_drake.mllm.judges.make_judge`.
        question: as it was put to the agent.
        answer: the agent's.
        accepted: the expected answer first, then others that count.
        seed: of the episode.
        on_request: called before the model is asked.
    """
    made = Judgement(broker.backend.name)
    if not answer.strip():
        return dataclasses.replace(made, mark=LOWEST, reasoning="No answer was given.")
    feedback = ""
    while True:
        request = judge_request(question, answer, accepted, seed=seed, feedback=feedback)
        if on_request is not None:
            on_request(request)
        try:
            outcome = _outcome(broker, request)
        except KeyboardInterrupt:
            error = "interrupted before there was a mark."
            return dataclasses.replace(made, error=error, interrupted=True)
        made = dataclasses.replace(made, usage=made.usage + _cost(broker, request, outcome))
        try:
            if not isinstance(outcome, Completion):
                raise outcome
            reply, _ = JudgeReply.read(outcome.text)
            return dataclasses.replace(made, mark=reply.score, reasoning=_short(reply.reasoning))
        except (MllmError, ReplyFormatError) as error:
            worth_it = isinstance(error, ReplyFormatError) and error.worth_a_reask
            if request.attempt >= MAX_REASKS or not worth_it:
                return dataclasses.replace(made, error=f"{type(error).__name__}: {error}")
            feedback = str(error)


def judge_episode(
    broker: Broker | None,
    verdict: Score,
    task: EpisodeTask,
    answer: str,
    *,
    seed: int,
    on_request: RequestListener | None = None,
) -> Judgement | None:
    """Returns a judge's word on the answer of an episode, and closes the broker.

    There is nothing to judge without a judge, for a task without expected answers, and where
    nothing is scored.  The episode is over: its budgets neither stop a judge nor count it, and it
    is never lost for want of a mark.
    """
    if broker is None:
        return None
    try:
        if not task.answers or verdict.answer_correct is None:
            return None
        return judge(broker, task.spec.text, answer, task.answers, seed=seed, on_request=on_request)
    finally:
        broker.close()


def _short(reasoning: str) -> str:
    line = " ".join(reasoning.split())
    return line if len(line) <= REASONING_LIMIT else f"{line[: REASONING_LIMIT - 3]}..."


def _outcome(broker: Broker, request: MllmRequest) -> Completion | MllmError | ReplyFormatError:
    try:
        return broker.result(request)
    except (MllmError, ReplyFormatError) as error:
        return error


def _cost(
    broker: Broker, request: MllmRequest, outcome: Completion | MllmError | ReplyFormatError
) -> ModelUsage:
    """Returns what one request to the judge used; its seconds are wall-clock, or as recorded."""
    if isinstance(outcome, Completion):
        reply = MllmReply(usage=outcome.usage)
    else:
        reply = MllmReply(usage=paid(outcome.attempts), error=type(outcome).__name__)
    seconds = broker.latency(request)
    return ModelUsage(asked=1).after(reply, attempts=outcome.attempts, seconds=seconds)
