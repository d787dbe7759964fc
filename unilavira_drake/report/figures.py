"""The figures of a run as names and words."""

from __future__ import annotations

from unilavira_drake.recording.result import EpisodeResult, UsageResult
from unilavira_drake.report.model import RunRecord, Step

_WORDS = {True: "yes", False: "no", None: "–"}

Rows = tuple[tuple[str, str], ...]
"""A name and its value each."""


def run_figures(run: RunRecord) -> Rows:
    """Returns what a run came to, how often what happened, and what it cost."""
    counts, result = run.counts, run.result
    rows = [
        *(() if result is None else _scores(result)),
        ("simulated time", f"{run.simulated:.1f} s"),
        ("decisions", str(counts.decisions)),
        ("language calls", str(counts.language_calls)),
        ("vision calls", str(counts.vision_calls)),
        *_marks(run.steps),
        ("asked again", str(counts.reasks)),
        ("fallbacks", str(counts.fallbacks)),
        ("backtracks", str(counts.backtracks)),
    ]
    return (*rows, *(() if result is None else cost_figures(result.usage)))


def judge_figures(result: EpisodeResult) -> Rows:
    """Returns what a judge said of the answer; nothing where nobody judged."""
    judge, score = result.judge, result.metrics.answer_score
    if judge is None:
        return ()
    if judge.mark is None or score is None:
        return (("answer score", f"none: {result.error}"),)
    return (
        ("answer score", f"{score:.2f} ({judge.mark} of 5 by {judge.model})"),
        ("the judge's reason", judge.reasoning),
    )


def cost_figures(usage: UsageResult) -> Rows:
    """Returns tokens and dollars, and the judge's part in them; nothing where none were used."""
    if not (usage.input_tokens or usage.output_tokens):
        return ()
    judge = usage.judge
    told = judge is not None and (judge.input_tokens or judge.output_tokens)
    tokens = f"{usage.input_tokens} in, {usage.output_tokens} out"
    if judge is not None and told:
        tokens += f"; the judge's part {judge.input_tokens} in, {judge.output_tokens} out"
    cost = "" if usage.cost_usd is None else f"{usage.cost_usd:.4f} USD"
    if judge is not None and told and judge.cost_usd is not None:
        cost = f"{cost or 'not known'}; the judge's part {judge.cost_usd:.4f} USD"
    return (("tokens", tokens), *((("cost", cost),) if cost else ()))


def metres(value: float | None) -> str:
    """Returns a length in words."""
    return "–" if value is None else f"{value:.2f} m"


def _scores(result: EpisodeResult) -> Rows:
    metrics = result.metrics
    answer = []
    if metrics.answer is not None:
        answer = [("answer", metrics.answer), ("answer correct", _WORDS[metrics.answer_correct])]
    where = [
        ("in the goal's room", _WORDS[metrics.same_room]),
        ("goal in the last view", _WORDS[metrics.goal_seen]),
    ]
    if result.task.is_flight:  # Room and view have no part in its success.
        where = [("path type", metrics.path_type or "–")]
    return (
        *answer,
        *judge_figures(result),
        ("navigation error", metres(metrics.navigation_error_m)),
        *where,
        ("path length", metres(metrics.path_length_m)),
        ("shortest path", metres(metrics.shortest_path_m)),
        ("SPL", "–" if metrics.spl is None else f"{metrics.spl:.2f}"),
        ("collisions", str(metrics.collisions)),
    )


def _marks(steps: tuple[Step, ...]) -> Rows:
    """Returns how often the auxiliary grounder was asked; nothing where there was none."""
    groundings = [step.grounding for step in steps if step.grounding is not None]
    if not groundings:
        return ()
    doubted = sum(bool(one.doubt) for one in groundings)
    refined = sum(one.refined for one in groundings)
    return (("marks doubted", f"{doubted} of {len(groundings)}, {refined} refined"),)
