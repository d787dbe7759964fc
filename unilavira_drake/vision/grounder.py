"""The auxiliary grounder: mends a doubted mark of the vision model (paper, future work ii)."""

from __future__ import annotations

from pydrake.systems.framework import Context

from unilavira_drake.messages import Grounding, Panorama, VisionAction
from unilavira_drake.ports import Level, message_input
from unilavira_drake.vision.grounding import GroundingLimits, Propose, ground


class Grounder(Level):
    """Turns vision action n into grounding n, between ``vision`` and ``goal_selector``.

    A mark that is not doubted, and one for which nothing better is found, passes unchanged; see
    ``vision.grounding`` for when that is.  A detector of one's own takes part by
    ``replace={"grounder": Grounder(propose=from_pictures(detect), period=0.1)}``.

    .. pydrake_system::

        name: Grounder
        input_ports:
        - vision_action
        - panorama
        output_ports:
        - vision_action
        - grounding

    Args:
        propose: the grounder; called in the event in which the vision action arrives.
        period: polling period, seconds.
        confidence: a mark of which the model is less sure is doubted, and no candidate with a
            lower score is taken.
        region: share of the view from which on a box without one depth is doubted.
        nearest: a mark that is closer is doubted, metres along the floor.
        max_range: depths beyond are no place to go to, metres.
    """

    def __init__(
        self,
        *,
        propose: Propose,
        period: float,
        confidence: float = 0.5,
        region: float = 0.4,
        nearest: float = 0.6,
        max_range: float = 10.0,
    ) -> None:
        super().__init__(Grounding(), period=period)
        self._propose = propose
        self._limits = GroundingLimits(confidence, region, nearest, max_range)
        self._vision = message_input(self, "vision_action", VisionAction())
        self._panorama = message_input(self, "panorama", Panorama())
        self.declare_output("vision_action", lambda state: state.action, VisionAction())
        self.declare_output("grounding", lambda state: state, Grounding())

    def step(self, context: Context, state: Grounding) -> Grounding:
        """Looks at a new vision action once its panorama is there."""
        action = self._vision(context)
        if action.n == state.n:
            return state
        panorama = self._panorama(context)
        if panorama.n != action.n:
            return state
        try:
            frame = panorama.frame(action.direction)
        except KeyError:
            # The goal selector says so.
            return Grounding(n=action.n, action=action)
        return ground(action, frame, panorama.position, self._propose, self._limits)
