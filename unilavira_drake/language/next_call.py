"""Which call the language model gets next: one pure table."""

from __future__ import annotations

from unilavira_drake.messages import LanguageAction, Outcome
from unilavira_drake.tasks import asks


def next_call(
    last: LanguageAction,
    outcome: Outcome,
    *,
    family: str,
    has_todo: bool,
    revert_only: bool = False,
) -> str:
    """Returns the call that follows the last language action and its outcome.

    =============================  ==============================================
    last action and outcome        next call
    =============================  ==============================================
    nothing yet                    ``plan_todo``; ``decide`` without a TODO memory
    ``backtrack``, arrived         ``recover`` (paper III-D); ``decide`` for a mere revert
    ``backtrack``, failed          ``decide``
    ``double_check``               ``double_check``
    confirmed, a question          ``answer``
    anything else                  ``decide``
    =============================  ==============================================
    """
    if last.n == 0:
        return "plan_todo" if has_todo else "decide"
    if last.tool == "backtrack" and outcome.state == "arrived":
        return "decide" if revert_only else "recover"
    if last.tool == "double_check":
        return "double_check"
    if last.call == "double_check" and last.confirmed and asks(family):
        return "answer"
    return "decide"
