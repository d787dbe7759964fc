"""What the two models decide: the language action and the vision action."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages.frozen import Message

CALLS = ("plan_todo", "decide", "recover", "double_check", "answer")
"""The five calls to the language model."""

TOOLS = ("turn", "backtrack", "go_stair", "double_check", "stay", "stop", "none")
"""``turn`` to ``double_check`` are the model's (paper Eq. 2).  The ring adds ``stay`` (nothing to
do: a plan, a verdict), ``stop`` (verified: the ring rests) and ``none`` (no usable reply)."""


@dataclass(frozen=True)
class TodoUpdate(Message):
    """One operation on the TODO list; ``index`` counts from 1 in the list as shown."""

    op: str = "update"
    """``update`` | ``rewrite`` | ``add`` | ``remove``."""
    index: int | None = None
    content: str = ""
    status: str = ""
    """``completed`` | ``pending`` for ``update``; empty otherwise."""
    result: str = ""


@dataclass(frozen=True)
class LanguageAction(Message):
    """One reply of the language model, parsed, under the number of its call."""

    n: int = 0
    call: str = ""
    tool: str = "none"
    direction: str = ""
    waypoint: int | None = None
    stair: str = ""
    todo_updates: tuple[TodoUpdate, ...] = ()
    progress_analysis: str = ""
    reasoning_todo: str = ""
    reasoning_action: str = ""
    scene: str = ""
    confirmed: bool | None = None
    """Verdict of a ``double_check`` call; None for the other calls."""
    reason: str = ""
    """Why a stop was rejected, or why there is no action."""
    answer: str = ""
    evidence: tuple[str, ...] = ()
    """Of an answer: the views, and the names of the pictures of the past, that settle it."""
    fallback: bool = False
    """Whether the documented safe action took the place of unusable replies."""
    repairs: tuple[str, ...] = ()
    """What was forgiven in the model's text to read it, one sentence each."""

    @property
    def argument(self) -> str:
        """The tool's argument as text: direction, waypoint number or up/down."""
        if self.tool == "turn":
            return self.direction
        if self.tool == "backtrack":
            return str(self.waypoint)
        return self.stair if self.tool == "go_stair" else ""


@dataclass(frozen=True)
class VisionAction(Message):
    """Where the chosen view holds the target: a box or a point in pixels, or neither."""

    n: int = 0
    direction: str = ""
    box: tuple[float, float, float, float] | None = None
    """(u_min, v_min, u_max, v_max), pixels of the chosen view."""
    point: tuple[float, float] | None = None
    """(u, v), pixels of the chosen view."""
    target_desc: str = ""
    confidence: float | None = None
    reason: str = ""
    """Why nothing was selected; empty when a box or a point was."""
    fallback: bool = False
    """Whether unusable replies left nothing to select."""
    repairs: tuple[str, ...] = ()
    """What was forgiven in the model's text to read it, one sentence each."""
