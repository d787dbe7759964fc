"""A model's mark for an answer: how well it says what was expected, from 1 to 5.

The scale is that of OpenEQA's LLM-Match (Majumdar et al., "OpenEQA: Embodied Question Answering in
the Era of Foundation Models", 2024): a mark m counts as (m - 1) / 4, no answer as 0.  The words of
the prompt are our own, so marks of other work cannot be compared one to one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.errors import MllmError, ReplyFormatError
from unilavira_drake.evaluation.scoring import Score
from unilavira_drake.messages import Message
from unilavira_drake.mllm.broker import AttemptListener
from unilavira_drake.mllm.judges import make_judge
from unilavira_drake.mllm.prompt import template_text
from unilavira_drake.mllm.reply import Attempt, Mllm
from unilavira_drake.mllm.reply_forms import JudgeReply
from unilavira_drake.mllm.request import FreeVariables, MllmRequest
from unilavira_drake.task_choice import EpisodeTask

MAX_REASKS = 1
LOWEST, HIGHEST = 1, 5


@dataclass(frozen=True)
class Judgement(Message):
    """A mark, and the sentence that explains it."""

    mark: int = LOWEST
    reasoning: str = ""

    @property
    def score(self) -> float:
        """The mark as a number from 0 to 1."""
        return (self.mark - LOWEST) / (HIGHEST - LOWEST)


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
        n=1, attempt=int(bool(feedback)), seed=seed, call="judge", variables=FreeVariables(text)
    )


def judge(
    model: Mllm,
    question: str,
    answer: str,
    accepted: Sequence[str],
    *,
    seed: int = 0,
    on_attempt: AttemptListener | None = None,
) -> Judgement:
    """Returns a model's judgement on an answer; without an answer the model is not asked.

    A reply that cannot be used is asked for once more, with what was wrong with it.

    Args:
        model: see :func:`unilavira_drake.mllm.judges.make_judge`.
        question: as it was put to the agent.
        answer: the agent's.
        accepted: the expected answer first, then others that count.
        seed: of the episode.
        on_attempt: called for each attempt of each call, see ``Broker``.

    Raises:
        MllmError: if no reply can be had.
        ReplyFormatError: if the second reply cannot be used either.
    """
    if not answer.strip():
        return Judgement(LOWEST, "No answer was given.")
    request = judge_request(question, answer, accepted, seed=seed)
    while True:
        try:
            reply, _ = JudgeReply.read(_asked(model, request, on_attempt))
            return Judgement(reply.score, reply.reasoning)
        except ReplyFormatError as error:
            if request.attempt >= MAX_REASKS or not error.worth_a_reask:
                raise
            request = judge_request(question, answer, accepted, seed=seed, feedback=str(error))


def judge_episode(
    spec: str,
    verdict: Score,
    task: EpisodeTask,
    answer: str,
    *,
    seed: int,
    on_attempt: AttemptListener | None = None,
) -> tuple[Score, str]:
    """Returns the verdict with a judge's mark for the answer, and why there is none.

    There is nothing to judge without a judge's spec, for a task without expected answers, and
    where nothing is scored.  An episode that has run is never lost for want of a judge.
    """
    if not (spec and task.answers and verdict.answer_correct is not None):
        return verdict, ""
    model = make_judge(spec)
    try:
        found = judge(model, task.spec.text, answer, task.answers, seed=seed, on_attempt=on_attempt)
    except (MllmError, ReplyFormatError) as error:
        return verdict, f"judge_model: {type(error).__name__}: {error}"
    finally:
        model.close()
    return dataclasses.replace(verdict, answer_score=found.score), ""


def _asked(model: Mllm, request: MllmRequest, on_attempt: AttemptListener | None) -> str:
    """Returns the text of a reply, telling every attempt that it took."""
    try:
        completion = model.complete(request)
    except (MllmError, ReplyFormatError) as error:
        _tell(on_attempt, request, error.attempts)
        raise
    _tell(on_attempt, request, completion.attempts)
    return completion.text


def _tell(
    on_attempt: AttemptListener | None, request: MllmRequest, attempts: Sequence[Attempt]
) -> None:
    if on_attempt is not None:
        for number, attempt in enumerate(attempts, start=1):
            on_attempt(request, number, attempt)
