"""The one-step revert as a System, in the place of Second Chance Backtrack."""

from __future__ import annotations

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, LeafSystem

from unilavira_drake.memory.revert import one_step_revert
from unilavira_drake.messages import History, SecondChance
from unilavira_drake.ports import message_input


class OneStepRevert(LeafSystem):
    """Offers ``backtrack`` to the place of the latest step alone, without any evidence.

    A baseline: the wiring ``lavira`` connects it to the language level instead of the waypoint
    memory's own ``second_chance``.

    .. pydrake_system::

        name: OneStepRevert
        input_ports:
        - history
        output_ports:
        - second_chance
    """

    def __init__(self) -> None:
        super().__init__()
        self._history = message_input(self, "history", History())
        # Without these Drake would also count time, and compute anew at every tick.
        self.DeclareAbstractOutputPort(
            "second_chance",
            lambda: AbstractValue.Make(SecondChance()),
            self._calc_second_chance,  # type: ignore[arg-type]
            prerequisites_of_calc={self._history.ticket},
        )

    def _calc_second_chance(self, context: Context, output: AbstractValue) -> None:
        output.set_value(one_step_revert(self._history(context)))
