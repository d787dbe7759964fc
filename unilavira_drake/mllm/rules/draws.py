"""Random draws that are functions of the request alone."""

from __future__ import annotations

import hashlib
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from unilavira_drake.mllm.request import FreeVariables, MllmRequest

T = TypeVar("T")

_BITS = 52
"""Of a draw: few enough that no value rounds to 1."""
_NORMAL = statistics.NormalDist()


@dataclass(frozen=True)
class Draws:
    """Independent draws for one attempt of one call; ``what`` names each draw."""

    key: str

    @classmethod
    def of(cls, request: MllmRequest, seed: int) -> Draws:
        """Returns the draws for a request; ``seed`` adds to the request's own.

        The task is part of them: without it all tasks of one seed would go wrong at the same
        calls.
        """
        variables = request.variables
        task = variables.text if isinstance(variables, FreeVariables) else variables.task
        parts = (seed, request.seed, request.role, request.n, request.attempt, task)
        return cls("/".join(map(str, parts)))

    def uniform(self, *what: str) -> float:
        """Returns a number between 0 and 1, both excluded."""
        digest = hashlib.sha256("/".join((self.key, *what)).encode()).digest()
        return ((int.from_bytes(digest[:8], "big") >> (64 - _BITS)) + 0.5) / 2.0**_BITS

    def normal(self, *what: str) -> float:
        """Returns a standard normal number."""
        return _NORMAL.inv_cdf(self.uniform(*what))

    def happens(self, probability: float, *what: str) -> bool:
        """Whether an event of this probability happens; if so, then at any higher one, too."""
        return self.uniform(*what) < probability

    def choice(self, options: Sequence[T], *what: str) -> T:
        """Returns one of some options, each equally likely."""
        return options[int(self.uniform(*what) * len(options))]
