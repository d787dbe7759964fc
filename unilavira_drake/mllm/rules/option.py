"""One place to go to, and what speaks against it wherever it lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

from unilavira_drake.messages import ALREADY_THERE, VIEW_YAW
from unilavira_drake.mllm.rules.situation import Situation


@dataclass(frozen=True)
class Option:
    """One place to go to."""

    direction: str
    bearing: float
    """Degrees to the left of ``front``."""
    distance: float
    target: str
    """What is to be grounded, in words."""
    cost: float
    why: str
    cites: str = ""
    """Detection that shows it."""

    @property
    def order(self) -> str:
        """The sentence that tells the vision model what to ground."""
        axis = math.degrees(VIEW_YAW[self.direction])
        off = math.remainder(self.bearing - axis, 360.0)
        side = "left" if off >= 0 else "right"
        return (
            f"Target: {self.target}, about {self.distance:.1f} m, {abs(off):.0f} deg {side} "
            f"of the {self.direction} view's axis."
        )


def tried_cost(situation: Situation, direction: str) -> float:
    """Returns what earlier tries in a direction from here speak against it, metres."""
    here = situation.here
    tried = here.tried if here else ()
    useless = (f"{direction}: failed", f"{direction}: arrived: {ALREADY_THERE}")
    failures = sum(t.startswith(useless) for t in tried)
    returns = sum(t.startswith(f"{direction}: ") for t in tried) - failures
    return 25.0 * failures + 3.0 * returns
