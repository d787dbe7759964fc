"""How long a model thinks, in simulated seconds.

A latency is a deterministic function of the request's identity and the episode's seed, so the
same scenario gives the same bytes and a cloned Context sees the same delays.
"""

import dataclasses as dc
import hashlib
import math

import numpy as np

from unilavira_drake.mllm.request import MllmRequest


@dc.dataclass
class NoLatency:
    """Replies are visible at the next tick (``!NoLatency``)."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""
        return 0.0


@dc.dataclass
class ConstantLatency:
    """Every reply takes the same time (``!ConstantLatency``)."""

    seconds: float = 40.0

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""
        return self.seconds


@dc.dataclass
class LognormalLatency:
    """Replies scatter around a median (``!LognormalLatency``), seeded by the request."""

    median: float = 40.0
    sigma: float = 0.3
    """Standard deviation of the logarithm."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""
        key = f"{request.seed}/{request.role}/{request.n}/{request.attempt}".encode()
        seed = int.from_bytes(hashlib.sha256(key).digest()[:8], "big")
        normal = np.random.default_rng(seed).standard_normal()
        return self.median * math.exp(self.sigma * float(normal))
