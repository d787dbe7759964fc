"""How long a model thinks, in simulated seconds.

Most latencies are a deterministic function of the request's identity and the episode's seed, so
the same scenario gives the same bytes and a cloned Context sees the same delays.  Two depend on
the model: ``MeasuredLatency`` is as reproducible as its replies (exactly, from a cassette), and
``RealTimeLatency`` is not reproducible at all.
"""

import dataclasses as dc
import functools
import hashlib
import math
from pathlib import Path

import numpy as np

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.ledger import ANSWERED, read_ledger
from unilavira_drake.mllm.request import MllmRequest

CONDITIONS = {"healthy": (30.0, 60.0), "contended": (80.0, 150.0)}
"""Condition of the service -> the range of seconds that the paper tells for a language call."""
_NORMAL_95 = 1.6448536269514722
"""The 95th percentile of the normal distribution."""


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
        return _lognormal(request, self.median, self.sigma)


@dc.dataclass
class PaperLatency:
    """What the paper tells of its large model (``!PaperLatency``): 30-60 s, contended 80-150 s.

    Lognormal, seeded by the request; the ends of the range are the 5th and 95th percentiles.
    """

    condition: str = "healthy"
    """``healthy`` | ``contended``."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply."""
        low, high = CONDITIONS[self.condition]
        return _lognormal(request, math.sqrt(low * high), math.log(high / low) / (2 * _NORMAL_95))


@dc.dataclass
class RecordedLatency:
    """Drawn from an earlier run (``!RecordedLatency``), seeded by the request.

    Each draw is the latency of one answered attempt of the same role in that run's ledger.
    """

    file: str = ""
    """Path of a ``ledger.jsonl``."""

    def sample(self, request: MllmRequest) -> float:
        """Returns simulated seconds from request to reply.

        Raises:
            InputError: if the ledger cannot be read or has no answered attempt of the role.
        """
        seconds = recorded_latencies(self.file, request.role)
        return seconds[_seed(request) % len(seconds)]


@dc.dataclass
class MeasuredLatency:
    """As long as the model really took (``!MeasuredLatency``): the simulation waits for it.

    The latencies of a cassette are those of its recording, so its episodes are the same to the
    byte; those of a live model are never twice the same.
    """


@dc.dataclass
class RealTimeLatency:
    """As long as the model takes while the robot goes on in real time (``!RealTimeLatency``).

    The simulation runs no faster than real time, and a reply is visible at the first tick after
    it has come.  Not reproducible, not even from a cassette.
    """


@functools.lru_cache(maxsize=16)
def recorded_latencies(file: str, role: str) -> tuple[float, ...]:
    """Returns the seconds of each answered attempt of a role in a ledger, in its order.

    Raises:
        InputError: if the ledger cannot be read or has no answered attempt of the role.
    """
    rows = read_ledger(Path(file))
    seconds = tuple(row.latency_s for row in rows if row.role == role and row.status in ANSWERED)
    if not seconds:
        raise InputError(f"{file}: the ledger holds no answered call of the {role} model.")
    return seconds


def _lognormal(request: MllmRequest, median: float, sigma: float) -> float:
    normal = np.random.default_rng(_seed(request)).standard_normal()
    return median * math.exp(sigma * float(normal))


def _seed(request: MllmRequest) -> int:
    key = f"{request.seed}/{request.role}/{request.n}/{request.attempt}".encode()
    return int.from_bytes(hashlib.sha256(key).digest()[:8], "big")
