"""How finely a model is shown its pictures, and how many of the past: the prompt's presets."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Message


@dataclass(frozen=True)
class PromptPreset(Message):
    """What each picture of a language prompt may cost; details as in ``ImagePart``."""

    view_detail: str = "medium"
    """Of the four current views."""
    history_detail: str = "low"
    """Of the pictures of the past."""
    history_width: int | None = 320
    """Width of the pictures of the past, pixels; None keeps the camera's."""
    history_factor: int = 1
    """How many times the ``keyframes`` of the scenario are kept."""


PROMPT_PRESETS = {
    "compact": PromptPreset(),
    "paper": PromptPreset("high", "high", None, 2),
}
"""``compact`` is the default.  ``paper`` sends every picture in full, with twice the history."""
