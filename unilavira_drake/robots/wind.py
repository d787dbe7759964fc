"""Wind: a steady part and seeded gusts, which push an aircraft through its drag."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from unilavira_drake.ports import vector_input
from unilavira_drake.robots.gusts import drag, next_gust, warm_up


class WindModel(NamedTuple):
    """The air that moves."""

    speed: float = 0.0
    """Of the steady wind, m/s."""
    direction: float = 0.0
    """Yaw towards which it blows, radians."""
    gusts: float = 0.0
    """Standard deviation of the horizontal gusts, m/s."""
    correlation_time: float = 2.0
    """Of the gusts, seconds."""
    seed: int = 0
    mirrored: bool = False
    """Whether the gusts blow as in a world whose y is negated; ``direction`` is as it says."""


STILL_AIR = WindModel()


class Wind(LeafSystem):
    """The force of the air on a body: drag against its velocity relative to the wind.

    Everything random is a function of seed and time: a clone of a Context meets the same gusts.

    .. pydrake_system::

        name: Wind
        input_ports:
        - body_state
        output_ports:
        - force
        - wind

    ``body_state`` is that of a floating body: quaternion, position, [w; v] in the world.
    ``force`` is (6,): no torque, and the force at the body's origin in the world, newtons.
    ``wind`` is (3,) m/s.

    Args:
        model: the wind.
        linear_drag: newtons by m/s.
        quadratic_drag: newtons by (m/s)^2.
        period: seconds for which a force is held.
    """

    def __init__(
        self, *, model: WindModel, linear_drag: float, quadratic_drag: float, period: float
    ) -> None:
        super().__init__()
        self.set_name("wind")
        warm_up()
        self._model = model
        self._drag = (linear_drag, quadratic_drag)
        self._period = period
        self._sides = np.array([1.0, -1.0 if model.mirrored else 1.0, 1.0])
        steady = model.speed
        self._steady = np.array(
            [steady * math.cos(model.direction), steady * math.sin(model.direction), 0.0]
        )
        self._body_state = vector_input(self, "body_state", 13)
        force = self.DeclareDiscreteState(6)
        wind: Any = self._steady
        air = self.DeclareDiscreteState(wind)
        self._force_index, self._air_index = int(force), int(air)
        self.DeclareStateOutputPort("force", force)
        self.DeclareStateOutputPort("wind", air)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        model = self._model
        air: Any = context.get_discrete_state(self._air_index).value()
        if model.gusts > 0.0:
            count = round(context.get_time() / self._period)
            gust = next_gust(
                self._sides * (air - self._steady),
                model.seed,
                count,
                self._period,
                model.gusts,
                model.correlation_time,
            )
            air = self._steady + self._sides * gust
            discrete_state.set_value(self._air_index, air)
        force: Any = drag(air, self._body_state(context), *self._drag)
        discrete_state.set_value(self._force_index, force)
