"""What the auxiliary grounder made of a step's mark, in words and as boxes."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Candidate, Grounding


@dataclass(frozen=True)
class GroundingPanel:
    """Whether the vision model's mark was kept or refined, and why."""

    words: str
    taken: Candidate | None
    """What took the place of the model's mark."""
    left: tuple[Candidate, ...]
    """What the grounder found besides, best first."""


def grounding_panel(grounding: Grounding | None) -> GroundingPanel | None:
    """Returns how a mark was mended; None without a grounder, or without a mark to be mended."""
    if grounding is None:
        return None
    action = grounding.action
    if action.box is None and action.point is None:
        return None
    found = grounding.candidates
    if not grounding.doubt:
        return GroundingPanel("The model's mark was kept: it was not doubted.", None, ())
    if not grounding.refined:
        words = f"The model's mark was kept, though doubted ({grounding.doubt}): {grounding.reason}"
        return GroundingPanel(f"{words}.", None, found)
    words = f"The model's mark was doubted ({grounding.doubt}) and refined by the grounder."
    return GroundingPanel(words, found[0] if found else None, found[1:])
