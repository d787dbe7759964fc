"""What a model has cost so far."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from unilavira_drake.messages import Message
from unilavira_drake.mllm.reply import Attempt, MllmReply, Usage


@dataclass(frozen=True)
class ModelUsage(Message):
    """Totals over the replies that have become visible."""

    calls: int = 0
    """Requests answered, by a reply or by an error."""
    errors: int = 0
    """How many of them by an error."""
    attempts: int = 0
    """Requests on the wire, retries included."""
    total: Usage = Usage(cost_usd=0.0)
    """Sum over the replies; the cost is unknown as soon as one reply's cost is."""
    spent_usd: float = 0.0
    """US dollars over the replies whose cost is known."""
    seconds: float = 0.0
    """That the model took, wall-clock or as recorded; no part of a transcript."""
    failure: str = ""
    """The first error that was not the model's own, in words; empty while the model can be
    reached; no part of a transcript."""
    asked: int = 0
    """Requests issued; more than ``calls`` while a model thinks."""

    uncounted: int = 0
    """Replies of which their server did not count the tokens: no budget of them can be kept."""

    def __add__(self, other: ModelUsage) -> ModelUsage:
        return ModelUsage(
            self.calls + other.calls,
            self.errors + other.errors,
            self.attempts + other.attempts,
            self.total + other.total,
            self.spent_usd + other.spent_usd,
            self.seconds + other.seconds,
            self.failure or other.failure,
            self.asked + other.asked,
            self.uncounted + other.uncounted,
        )

    @property
    def thinking(self) -> bool:
        """Whether a request is not answered yet."""
        return self.asked > self.calls

    @property
    def tokens(self) -> int:
        """Tokens in and out."""
        return self.total.input_tokens + self.total.output_tokens

    def after(
        self,
        reply: MllmReply,
        *,
        attempts: tuple[Attempt, ...],
        seconds: float,
        failure: str = "",
    ) -> ModelUsage:
        """Returns the totals with one more reply, its attempts and the seconds that it took.

        ``failure`` is the error in its place in words, if that was not the model's own.
        """
        costs = [attempt.usage for attempt in attempts] or [reply.usage]
        return self + ModelUsage(
            calls=1,
            errors=int(bool(reply.error)),
            attempts=len(attempts) or 1,
            total=reply.usage,
            # What is known counts, also where another attempt's cost is not.
            spent_usd=sum(one.cost_usd or 0.0 for one in costs),
            uncounted=sum(attempt.uncounted for attempt in attempts),
            seconds=seconds,
            failure=failure,
        )


def paid(attempts: Iterable[Attempt]) -> Usage:
    """Returns what attempts cost together, e.g. those of a call that brought no reply."""
    return sum((attempt.usage for attempt in attempts), Usage(cost_usd=0.0))
