"""What the pending steps of a plan ask of the next move, and what a bearing costs them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.plan import Step
from unilavira_drake.mllm.rules.sight import angle_between

_SECTOR = 65.0
"""Within this angle of the wanted bearing a move takes a turn, degrees."""
_WANTED = {"left": 90.0, "right": -90.0, "around": 180.0, "straight": 0.0}
"""Bearing of each turn word, degrees to the left of ``front``."""


@dataclass(frozen=True)
class Aim:
    """What the pending steps ask of the next move."""

    goal: Clause | None
    """First hard step."""
    turn: Step | None
    """Turn to be taken with this very move."""
    soft: tuple[Clause, ...]
    """Steps before the goal that only say how to get there."""
    rooms: tuple[str, ...]
    """Rooms named from here on, in order."""
    inside: str
    """Kind of room in which the goal is said to be, if the robot was sent there."""

    @property
    def heading(self) -> float:
        """Where the robot will look after a pending turn, degrees to the left of ``front``."""
        return _WANTED[self.turn.clause.side or self.turn.clause.kind] if self.turn else 0.0

    @property
    def ends_first(self) -> bool:
        """Whether the goal has to wait until the end of a room, or something, was reached."""
        return any(c.kind == "end" for c in self.soft)


def aim_of(steps: Sequence[Step], room: str) -> Aim:
    """Returns what the pending steps of a plan ask of the next move in a kind of room.

    To walk along the room that the robot is in says how to go on, not where to be.
    """
    pending = [s for s in steps if not s.done]
    here = [s for s in pending if s.clause.kind == "along" and s.clause.room in ("", room)]
    at = next((i for i, s in enumerate(pending) if s.clause.hard and s not in here), len(pending))
    goal = pending[at].clause if at < len(pending) else None
    first = pending[0] if pending else None
    turn = first if first is not None and first.clause.kind in ("turn", "straight") else None
    soft = tuple(s.clause for s in pending[:at])
    rooms = tuple(s.clause.room for s in pending if s.clause.room and s.clause.kind != "leave")
    before = [s.clause for s in steps if s.done and s.clause.kind in ("enter", "door", "leave")]
    inside = before[-1].room if before and before[-1].kind == "enter" else ""
    return Aim(goal, turn, soft, rooms, inside if goal and goal.category else "")


def in_sector(turn: Clause, bearing: float) -> bool:
    """Whether a bearing counts as taking a turn."""
    return angle_between(bearing, _WANTED[turn.side or turn.kind]) <= _SECTOR


def turn_cost(aim: Aim, bearing: float) -> float:
    """Returns what a bearing costs while a turn is to be taken, metres."""
    if aim.turn is None:
        return 0.0
    off = angle_between(bearing, aim.heading)
    if off <= _SECTOR:
        return off / 15.0 - 8.0
    return 80.0 if aim.goal is not None and aim.goal.kind == "door" else 10.0


def on_side(side: str, bearing: float, aim: Aim) -> bool:
    """Whether a bearing is on a side of the robot, as it will look after a pending turn."""
    off = math.remainder(bearing - aim.heading, 360.0)
    return side not in ("left", "right") or (off > 0.0) == (side == "left")


def side_cost(side: str, bearing: float, aim: Aim) -> float:
    """Returns what being on the said or the other side costs, metres."""
    if side not in ("left", "right"):
        return 0.0
    return -4.0 if on_side(side, bearing, aim) else 4.0
