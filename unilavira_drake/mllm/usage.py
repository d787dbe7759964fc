"""What a model has cost so far."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Message
from unilavira_drake.mllm.reply import Usage


@dataclass(frozen=True)
class ModelUsage(Message):
    """Totals over the replies that have become visible."""

    calls: int = 0
    """Requests answered, by a reply or by an error."""
    errors: int = 0
    """How many of them by an error."""
    total: Usage = Usage(cost_usd=0.0)
    """Sum over the replies; the cost is unknown as soon as one reply's cost is."""
