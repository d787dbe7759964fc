"""What the two models decide: the language action and the vision action."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages.frozen import Message

CALLS = ("plan_todo", "decide", "recover", "double_check", "answer")
"""The five calls to the language model."""

TOOLS = ("turn", "backtrack", "go_stair", "double_check", "fly", "stay", "stop", "none")
"""``turn`` to ``double_check`` are the model's (paper Eq. 2), and ``fly`` is where vision could not
ground a view in flight (direction-constrained module, paper V).  The ring adds ``stay`` (nothing to
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
    climb: float | None = None
    """In flight: metres by which the robot is to end higher than it is now; None: not said."""
    bearing: float = 0.0
    """Of ``fly``: degrees to the left of ``front`` ..."""
    distance: float = 0.0
    """... and metres along the ground."""
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
        """The tool's argument as text: direction, waypoint number, up/down, or where to fly."""
        if self.tool == "turn":
            return ", ".join(part for part in (self.direction, _climb_words(self.climb)) if part)
        if self.tool == "fly":
            side = "left" if self.bearing >= 0 else "right"
            way = f"{self.distance:.0f} m at {abs(self.bearing):.0f} degrees to the {side}"
            parts = (way if self.distance else "", _climb_words(self.climb))
            return ", ".join(part for part in parts if part)
        if self.tool == "backtrack":
            return str(self.waypoint)
        return self.stair if self.tool == "go_stair" else ""


def _climb_words(climb: float | None) -> str:
    if not climb:
        return ""
    return f"{abs(climb):.0f} m {'up' if climb > 0 else 'down'}"


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
