"""What is measured of an episode, and why it ended."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from unilavira_drake.messages.frozen import Message

UNREACHABLE = "model_unreachable"
INTERRUPTED = "interrupted"
UNCOUNTED = "tokens_not_counted"
UNSCORED = (UNREACHABLE, INTERRUPTED, UNCOUNTED)
"""Causes that are not the agent's doing: nothing is scored."""
CAUSES = {
    "stopped": "The agent ended the episode by its own verified stop.",
    "decision_budget": "The decisions of the budget are used up, and the last one is carried out.",
    "time_budget": "The simulated time of the budget is over.",
    "call_budget": "The model calls of the budget are used up.",
    "token_budget": "The tokens of the budget are used up.",
    "model_time_budget": "The models have taken all the seconds of the budget.",
    "cost_budget": "The money of the budget is spent.",
    "stalled": "For the stall time nothing was new: no panorama, action, status, motion or reply.",
    UNREACHABLE: "A model could not be reached or gave no reply; nothing is scored.",
    UNCOUNTED: "A budget of tokens or dollars cannot be kept, the server counts none; not scored.",
    INTERRUPTED: "A person stopped the run; what was done is kept, nothing is scored.",
}
"""Every cause with which an episode ends, and what it means."""


@dataclass(frozen=True)
class EpisodeMetrics(Message):
    """Measured from the true pose, the contacts and the messages up to ``time``."""

    time: float = 0.0
    """Simulated seconds of the latest change."""
    x: float = 0.0
    """Position of the base in the world, metres."""
    y: float = 0.0
    z: float = 0.0
    path_length: float = 0.0
    """Metres, from steps of at least 1 mm."""
    goal_distance: float | None = None
    """Metres to the goal now, as its rule measures; None when the episode is not scored."""
    min_goal_distance: float | None = None
    """The least of it so far."""
    collisions: int = 0
    """How often a contact began."""
    max_contact_force: float = 0.0
    """Newtons, over the sampled contacts."""
    min_person_distance: float | None = None
    """The least distance from the footprint to a person so far; None where there are none."""
    person_contacts: int = 0
    """How often a contact with a person began; each is one of the collisions, too."""
    decisions: int = 0
    """``decide`` and ``recover`` calls answered so far."""
    progress_time: float = 0.0
    """When a panorama, action, status or motion was last new, simulated seconds."""
    cause: str = ""
    """A key of ``CAUSES`` once the episode has ended, else empty."""

    @property
    def ended(self) -> bool:
        """Whether the episode has ended."""
        return bool(self.cause)

    def interrupted(self) -> EpisodeMetrics:
        """Returns these metrics as those of a run that a person stopped."""
        return dataclasses.replace(self, cause=INTERRUPTED)

    @property
    def position(self) -> tuple[float, float]:
        """Position of the base in the world, metres."""
        return self.x, self.y

    def distance_from(self, x: float, y: float, z: float = 0.0) -> float:
        """Returns the straight distance between the base and a point, metres."""
        return math.hypot(self.x - x, self.y - y, self.z - z)
