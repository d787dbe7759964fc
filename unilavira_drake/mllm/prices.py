"""What a call has cost, by the prices that a profile knows."""

from __future__ import annotations

from unilavira_drake.mllm.profile import Prices
from unilavira_drake.mllm.reply import Usage

_MILLION = 1_000_000.0


def cost_usd(usage: Usage, prices: Prices | None) -> float | None:
    """Returns the cost of a reply in US dollars, or None when it is not known.

    It is not known without prices, and neither when the server has counted no tokens: a cost of
    0 would be a guess.
    """
    if prices is None or not (usage.input_tokens or usage.output_tokens):
        return None
    cached_price = prices.input if prices.cached is None else prices.cached
    fresh = usage.input_tokens - usage.cached_tokens
    return (
        fresh * prices.input
        + usage.cached_tokens * cached_price
        + usage.output_tokens * prices.output
    ) / _MILLION
