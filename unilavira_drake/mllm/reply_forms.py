"""The form of each reply: one pydantic model for each call (paper III-B1, III-B2, III-C, III-D).

Reasoning stands before what it decides, since a model writes in this order (paper III-C: separate
``reasoning_todo`` and ``reasoning_action`` fields).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pydantic

from unilavira_drake.mllm.reply_model import (
    Bearing,
    Climb,
    Distance,
    Mark,
    Number,
    ReplyModel,
    Share,
    Whole,
)


class UpdateOp(ReplyModel):
    """Closes an item with its evidence, or opens it again."""

    op: Literal["update"]
    index: Whole
    status: Literal["completed", "pending"]
    # May be missing: the TODO memory then rolls the completion back and says so.
    result: str = ""


class RewriteOp(ReplyModel):
    """Words a pending item better."""

    op: Literal["rewrite"]
    index: Whole
    content: str


class AddOp(ReplyModel):
    """Adds an item at a position, or at the end."""

    op: Literal["add"]
    content: str
    index: Whole | None = None


class RemoveOp(ReplyModel):
    """Drops an item."""

    op: Literal["remove"]
    index: Whole


class Turn(ReplyModel):
    """Go towards something in one of the four views."""

    tool: Literal["turn"]
    direction: Literal["front", "left", "right", "back"]


class FlightTurn(ReplyModel):
    """Fly to something in one of the five views, and end higher or lower if ``climb`` says so."""

    tool: Literal["turn"]
    direction: Literal["front", "left", "right", "back", "down"]
    climb: Climb | None = None


class Fly(ReplyModel):
    """Fly by numbers, where vision could not ground a view (paper V)."""

    tool: Literal["fly"]
    bearing: Bearing
    distance: Distance
    climb: Climb


class Backtrack(ReplyModel):
    """Drive back to a waypoint (paper III-D)."""

    tool: Literal["backtrack"]
    waypoint: Whole


class GoStair(ReplyModel):
    """Take the stairs."""

    tool: Literal["go_stair"]
    stair: Literal["up", "down"]
    # The view that shows them; missing: front.
    direction: Literal["front", "left", "right", "back"] | None = None


class DoubleCheck(ReplyModel):
    """Propose to stop here."""

    tool: Literal["double_check"]


TodoOp = Annotated[
    UpdateOp | RewriteOp | AddOp | RemoveOp,
    pydantic.Field(discriminator="op"),
]
Tool = Annotated[
    Turn | Backtrack | GoStair | DoubleCheck,
    pydantic.Field(discriminator="tool"),
]
FlightTool = Annotated[
    FlightTurn | Fly | Backtrack | DoubleCheck,
    pydantic.Field(discriminator="tool"),
]


class PlanReply(ReplyModel):
    """Reply to ``plan_todo``."""

    reasoning: str
    todo: list[str]


class ActionReply(ReplyModel):
    """Reply to ``decide`` and ``recover``; the TODO fields may be left out without a list."""

    progress_analysis: str
    reasoning_todo: str = ""
    todo_updates: list[TodoOp] = pydantic.Field(default_factory=list)
    reasoning_action: str
    action: Tool
    scene: str


class FlightReply(ReplyModel):
    """The same in flight."""

    progress_analysis: str
    reasoning_todo: str = ""
    todo_updates: list[TodoOp] = pydantic.Field(default_factory=list)
    reasoning_action: str
    action: FlightTool
    scene: str


class VerdictReply(ReplyModel):
    """Reply to ``double_check``."""

    reasoning: str
    confirmed: bool
    reason: str


class AnswerReply(ReplyModel):
    """Reply to ``answer``."""

    reasoning: str
    # The pictures that settle it: views, and pictures of the past by their names.
    evidence: list[str] = pydantic.Field(default_factory=list)
    answer: str


class GroundReply(ReplyModel):
    """Reply to ``ground``: a box, or a point when a box is ill-defined, or neither and why."""

    target_desc: str
    box: Annotated[list[Number], pydantic.Field(min_length=4, max_length=4)] | None
    point: Annotated[list[Number], pydantic.Field(min_length=2, max_length=2)] | None
    confidence: Share | None
    reason: str


class JudgeReply(ReplyModel):
    """Reply to ``judge``: how well an answer agrees with the expected one, offline."""

    reasoning: str
    score: Mark


REPLY_MODELS: dict[str, type[ReplyModel]] = {
    "plan_todo": PlanReply,
    "decide": ActionReply,
    "recover": ActionReply,
    "double_check": VerdictReply,
    "answer": AnswerReply,
    "ground": GroundReply,
    "judge": JudgeReply,
}
"""Call -> the form of its reply; the call ``free`` has none."""


def reply_form(call: str, *, in_flight: bool = False) -> type[ReplyModel] | None:
    """Returns the form of the reply to a call, or None where any text will do."""
    form = REPLY_MODELS.get(call)
    return FlightReply if in_flight and form is ActionReply else form


def reply_schema(call: str, *, in_flight: bool = False) -> dict[str, Any] | None:
    """Returns the JSON schema of the reply to a call, or None where any text will do."""
    form = reply_form(call, in_flight=in_flight)
    return None if form is None else form.model_json_schema()
