"""What the agent is asked: the task families and the task itself, without its goal."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.errors import TaskError
from unilavira_drake.messages import Message

FAMILIES = ("vln", "objectnav", "eqa", "aerial_vln")
"""Route instruction, object goal, embodied question, flight directive (paper III-A)."""

MAX_TASK_WORDS = 2000


@dataclass(frozen=True)
class TaskSpec(Message):
    """A task as the agent receives it.  The goal that scores it is not part of it."""

    family: str = "vln"
    text: str = ""


def checked_task(text: str, family: str = "vln") -> TaskSpec:
    """Returns a task with its spaces folded.

    Raises:
        TaskError: if the text is empty or longer than 2,000 words, or the family is unknown.
    """
    words = text.split()
    if not words:
        raise TaskError("task: the text is empty; say where to go, e.g. 'Go to the red sofa.'")
    if len(words) > MAX_TASK_WORDS:
        raise TaskError(
            f"task: {len(words)} words, at most {MAX_TASK_WORDS} are read; shorten the text "
            f"(it starts {' '.join(words[:6])!r})."
        )
    if family not in FAMILIES:
        raise TaskError(f"task: unknown family {family!r}; valid: {', '.join(FAMILIES)}.")
    return TaskSpec(family=family, text=" ".join(words))
