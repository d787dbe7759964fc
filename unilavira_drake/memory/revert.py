"""One-step revert: what LaViRA had in the place of Second Chance Backtrack (paper section I)."""

from __future__ import annotations

from unilavira_drake.messages import History, SecondChance

_MOVES = ("turn", "fly", "go_stair", "backtrack")


def one_step_revert(history: History) -> SecondChance:
    """Returns the offer to take back the latest move, if that was a step forward.

    A revert cannot be reverted, and a step that left the place where it began cannot either.
    Nothing that failed is told.
    """
    last = next((d for d in reversed(history.decisions) if d.tool in _MOVES), None)
    offers: tuple[int, ...] = ()
    if (
        last is not None
        and last.tool != "backtrack"
        and last.waypoint != history.current
        and history.waypoint(last.waypoint) is not None
    ):
        offers = (last.waypoint,)
    return SecondChance(history.n, offers, revert_only=True)
