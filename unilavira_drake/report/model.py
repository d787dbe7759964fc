"""A run folder as frozen records: what each step saw, thought, chose and came to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from unilavira_drake.errors import InputError
from unilavira_drake.messages import (
    Goal,
    Grounding,
    LanguageAction,
    NavigationStatus,
    Panorama,
    TodoItem,
    TodoList,
    VisionAction,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.recording.result import CountsResult, EpisodeResult, result_from_json
from unilavira_drake.recording.tally import Tally
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.report.reading import Entry, MapNote, read_transcript
from unilavira_drake.report.todo_change import TodoChange, todo_changes

T = TypeVar("T")


@dataclass(frozen=True)
class Attempt:
    """One question to a model and what came back."""

    role: str
    attempt: int
    complaint: str
    """What was wrong with the reply before; empty at the first attempt."""
    reply: MllmReply | None
    """None when the record ends before the reply."""


@dataclass(frozen=True)
class Step:
    """Everything under the number of one language call; None where nothing was recorded."""

    n: int
    call: str
    asked: float
    """When the panorama was there, simulated seconds."""
    variables: LanguageVariables | None
    panorama: Panorama | None
    map: MapNote | None
    attempts: tuple[Attempt, ...]
    action: LanguageAction | None
    vision: VisionAction | None
    """The vision model's own mark."""
    grounding: Grounding | None
    """What the auxiliary grounder made of it; None without one."""
    goal: Goal | None
    changes: tuple[TodoChange, ...] | None
    """The TODO list with what became of each item; None without a list."""
    feedback: tuple[str, ...]
    """What the TODO list refused or rolled back."""
    status: NavigationStatus | None
    """How the goal ended; None when it did not."""
    decided: float | None
    """When the action was there, simulated seconds."""
    ended: float | None
    """When the goal was done, simulated seconds."""

    @property
    def reasks(self) -> int:
        """How many questions were asked again."""
        return sum(attempt.attempt > 0 for attempt in self.attempts)

    @property
    def fallback(self) -> bool:
        """Whether a safe action took the place of an unusable reply."""
        actions = (self.action, self.vision)
        return any(action is not None and action.fallback for action in actions)


@dataclass(frozen=True)
class RunRecord:
    """A run folder, read."""

    folder: Path
    steps: tuple[Step, ...]
    trace: EpisodeTrace
    counts: CountsResult
    """From ``result.json``, else from the transcript."""
    simulated: float
    """Simulated seconds up to the last line."""
    result: EpisodeResult | None
    problems: tuple[str, ...]
    """Sentences about what is missing or cannot be read."""

    @property
    def task(self) -> str:
        """The task's text; empty when nothing tells it."""
        if self.result is not None:
            return self.result.task.text
        told = (step.variables.task for step in self.steps if step.variables is not None)
        return next(told, "")

    def span(self, step: Step) -> tuple[float, float]:
        """Returns from when to when the robot's way is that of a step, simulated seconds.

        That is from its decision to the next one, or to the end of the record: it also brakes and
        looks around.
        """
        begin = -math.inf if step.decided is None else step.decided
        decided = (one.decided for one in self.steps if one.decided is not None)
        return begin, min((t for t in decided if t > begin), default=math.inf)


def read_run(folder: Path) -> RunRecord:
    """Reads a run folder, complete or not.

    Raises:
        InputError: if it is no run folder, or its transcript cannot be read at all.
    """
    transcript = read_transcript(folder)
    result, problems = _result(folder)
    tally, trace = Tally(), EpisodeTrace()
    decisions = 0
    for entry in transcript.entries:
        if not isinstance(entry.message, MapNote):
            tally.record(entry.t, entry.system, entry.event, entry.message)
            trace.record(entry.t, entry.system, entry.event, entry.message)
        if isinstance(entry.message, EpisodeMetrics):
            decisions = entry.message.decisions
    return RunRecord(
        folder=folder,
        steps=_steps(transcript.entries),
        trace=trace,
        counts=tally.counts(decisions) if result is None else result.counts,
        simulated=max((entry.t for entry in transcript.entries), default=0.0),
        result=result,
        problems=transcript.problems + problems,
    )


def _result(folder: Path) -> tuple[EpisodeResult | None, tuple[str, ...]]:
    path = folder / "result.json"
    try:
        return result_from_json(path.read_text(encoding="utf-8")), ()
    except FileNotFoundError:
        return None, ("result.json is missing: how the run ended and its scores are not known.",)
    except (OSError, UnicodeDecodeError) as error:
        return None, (f"result.json cannot be read: {error}.",)
    except InputError as error:
        return None, (str(error),)


def _steps(entries: Iterable[Entry]) -> tuple[Step, ...]:
    by_number: dict[int, list[Entry]] = {}
    for entry in entries:
        number = getattr(entry.message, "n", 0)
        if number > 0:
            by_number.setdefault(number, []).append(entry)
    steps: list[Step] = []
    todo: tuple[TodoItem, ...] = ()
    for number in sorted(by_number):
        group = by_number[number]
        steps.append(_step(number, group, todo))
        lists = [entry.message for entry in group if isinstance(entry.message, TodoList)]
        todo = lists[-1].items if lists else todo
    return tuple(steps)


def _step(n: int, entries: list[Entry], todo: tuple[TodoItem, ...]) -> Step:
    action, status = _last(entries, LanguageAction), _last(entries, NavigationStatus)
    updated = _last(entries, TodoList)
    questions = [entry.message for entry in entries if isinstance(entry.message, MllmRequest)]
    told = [q.variables for q in questions if isinstance(q.variables, LanguageVariables)]
    changes = None
    if updated is not None:
        changes = todo_changes(todo, updated, () if action is None else action.todo_updates)
    done = status is not None and status.terminal
    return Step(
        n=n,
        call=action.call if action is not None else next((q.call for q in questions), ""),
        asked=entries[0].t,
        variables=told[-1] if told else None,
        panorama=_last(entries, Panorama),
        map=_last(entries, MapNote),
        attempts=_attempts(entries),
        action=action,
        vision=_last(entries, VisionAction),
        grounding=_last(entries, Grounding),
        goal=_last(entries, Goal),
        changes=changes,
        feedback=() if updated is None else updated.feedback,
        status=status if done else None,
        decided=_time(entries, LanguageAction),
        ended=_time(entries, NavigationStatus) if done else None,
    )


def _last(entries: list[Entry], kind: type[T]) -> T | None:
    """Returns the latest message of a type."""
    found = [entry.message for entry in entries if isinstance(entry.message, kind)]
    return found[-1] if found else None


def _time(entries: list[Entry], kind: type) -> float | None:
    return max((entry.t for entry in entries if isinstance(entry.message, kind)), default=None)


def _attempts(entries: list[Entry]) -> tuple[Attempt, ...]:
    # A reply does not say its role; the link that gave it does.
    replies = {
        (entry.system.removesuffix("_link"), entry.message.attempt): entry.message
        for entry in entries
        if isinstance(entry.message, MllmReply)
    }
    return tuple(
        Attempt(
            role=entry.message.role,
            attempt=entry.message.attempt,
            complaint=entry.message.feedback,
            reply=replies.get((entry.message.role, entry.message.attempt)),
        )
        for entry in entries
        if isinstance(entry.message, MllmRequest)
    )
