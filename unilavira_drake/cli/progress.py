"""Live progress: each decision with its reason, its target and the TODO list."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.status import Status
from rich.text import Text

from unilavira_drake.messages import (
    Goal,
    LanguageAction,
    NavigationStatus,
    Panorama,
    TodoItem,
    TodoList,
    VisionAction,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.mailbox import REPLIES, MailboxModel
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.task_choice import EpisodeTask

_INDENT = " " * 5
_COLUMN = 16
"""Letters for a decision; an argument that does not fit has a line of its own."""
_TRIES = "unilavira_drake.mllm.remote_call"
"""The logger of the failed tries."""


class _LiveLine:
    """The last line on a terminal; drawn many times a second, so that its wall time goes on."""

    def __init__(self) -> None:
        self.began = time.perf_counter()
        self.doing = "building the world"
        self.failed = ""
        """The last failed try of a call under way."""

    def __rich__(self) -> Text:
        wall = time.perf_counter() - self.began
        failed = f"; {self.failed}" if self.failed else ""
        return Text(f"{self.doing}, wall {wall:.1f} s{failed}", no_wrap=True, overflow="ellipsis")


class _FailedTries(logging.Handler):
    """Passes on what the calls of remote models tell of themselves, from their threads."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__(logging.INFO)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        """Takes one failed try."""
        self._tell(record.getMessage())


class Progress:
    """Prints what happens; on a terminal its last line says what goes on just now."""

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or Console(highlight=False, soft_wrap=False)
        self._status: Status | None = None
        self._live = _LiveLine()
        self._tries = _FailedTries(self._failed)
        self._level = logging.NOTSET
        self._todo: tuple[TodoItem, ...] = ()
        self._mailboxes: dict[str, MailboxModel] = {}

    def __enter__(self) -> Progress:
        """Begins to measure wall time, and shows the live line on a terminal."""
        self._live.began = time.perf_counter()
        tries = logging.getLogger(_TRIES)
        self._level = tries.level
        tries.setLevel(logging.INFO)
        tries.addHandler(self._tries)
        if self.console.is_terminal:
            self._status = self.console.status(self._live)
            self._status.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Ends the live line."""
        tries = logging.getLogger(_TRIES)
        tries.removeHandler(self._tries)
        tries.setLevel(self._level)
        if self._status is not None:
            self._status.stop()

    def introduce(
        self, *, language: Mllm, vision: Mllm, task: EpisodeTask, judge: Mllm | None = None
    ) -> None:
        """Says what the models are, and what the task is."""
        for role, model in (("language", language), ("vision", vision), ("judge", judge)):
            if isinstance(model, MailboxModel):
                self._mailboxes[role] = model
        if language.description == vision.description:
            self._line(f"model: {language.description}", "bold")
        else:
            self._line(f"language model: {language.description}", "bold")
            self._line(f"vision model: {vision.description}", "bold")
        if judge is not None:
            self._line(f"judge of answers: {judge.description}", "bold")
        name = f" @{task.name}" if task.name else ""
        scored = f"scored against {task.goal}" if task.goal else "not scored"
        self._line(f"task{name} ({task.spec.family}, {scored}): {task.spec.text}")

    def record(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a new message at a time, simulated seconds."""
        if isinstance(message, MllmRequest) and message.role in self._mailboxes:
            place = self._mailboxes[message.role].place(message)
            self._line(f"{_INDENT}reply to {place / REPLIES[0]}", "magenta")
        elif isinstance(message, LanguageAction):
            self._decision(t, message)
        elif isinstance(message, TodoList):
            self._todo_list(message)
        elif isinstance(message, VisionAction):
            found = message.target_desc if not message.reason else message.reason
            self._line(f"{_INDENT}target: {found}")
        elif isinstance(message, NavigationStatus) and message.state == "failed":
            self._line(f"{_INDENT}failed: {message.reason}", "red")
        self._now(t, message)

    def _decision(self, t: float, action: LanguageAction) -> None:
        wall = time.perf_counter() - self._live.began
        what = f"{action.tool} {action.argument}".strip()
        long = len(what) > _COLUMN
        column = f"{action.tool if long else what:<{_COLUMN}}"
        self._line(
            f"{action.n:>3}. {action.call:<12} {column} simulated {t:6.1f} s  wall {wall:5.1f} s",
            "bold cyan",
        )
        if long:
            self._line(f"{_INDENT}{action.argument}", "bold cyan")
        reasoning = action.reasoning_action or action.reason or action.progress_analysis
        if reasoning:
            self._line(f"{_INDENT}{reasoning}", "dim")
        if action.answer:
            self._line(f"{_INDENT}answer: {action.answer}", "bold")

    def _todo_list(self, todo: TodoList) -> None:
        if todo.items != self._todo:
            for item in todo.items:
                done = item.status == "completed"
                evidence = f" ({item.result})" if done and item.result else ""
                self._line(
                    f"{_INDENT}[{'x' if done else ' '}] {item.content}{evidence}",
                    "green" if done else "",
                )
            self._todo = todo.items
        for sentence in todo.feedback:
            self._line(f"{_INDENT}! {sentence}", "yellow")

    def _line(self, text: str, style: str = "") -> None:
        line = Text(" ".join(text.split("\n")), style=style)
        if self.console.is_terminal and text.startswith(_INDENT):
            self.console.print(line, overflow="ellipsis", no_wrap=True)
        else:
            self.console.print(line, soft_wrap=True)

    def _now(self, t: float, message: Any) -> None:
        if isinstance(message, LanguageAction | VisionAction):
            self._live.failed = ""
        doing = _doing(message)
        if doing:
            self._live.doing = f"{doing}  simulated {t:.1f} s"

    def _failed(self, words: str) -> None:
        self._live.failed = words
        if self._status is None:
            self._line(f"{_INDENT}{words}", "yellow")


def _doing(message: Any) -> str:
    if isinstance(message, MllmRequest):
        return f"the {message.role} model thinks ({message.call})"
    if isinstance(message, Goal) and message.kind == "go":
        return "driving"
    if isinstance(message, EpisodeMetrics):
        return f"driving, {message.path_length:.1f} m so far"
    if isinstance(message, NavigationStatus) and message.terminal:
        return "looking around"
    return "thinking" if isinstance(message, Panorama) else ""
