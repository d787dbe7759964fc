"""The recalibration step: a count that grows each time a robot is calibrated anew."""

from __future__ import annotations

import math
from typing import Any

from pydrake.systems.framework import BasicVector, LeafSystem


class Recalibration(LeafSystem):
    """Counts recalibrations, one each period; pose estimate and exposure begin anew when it grows.

    A System of the user's own in its place may decide otherwise, e.g. at a docking station.

    .. pydrake_system::

        name: Recalibration
        output_ports:
        - recalibrations

    Args:
        period: seconds between two recalibrations.
    """

    def __init__(self, *, period: float) -> None:
        super().__init__()
        self._period = period
        self.DeclareVectorOutputPort("recalibrations", BasicVector(1), self._calc)

    def _calc(self, context: Any, output: Any) -> None:
        # A step's time may be a hair less than the multiple of the period that it stands for.
        output.SetFromVector([math.floor(context.get_time() / self._period + 1e-9)])
