"""Counts what happened in an episode, from its messages."""

from __future__ import annotations

from typing import Any

from unilavira_drake.messages import LanguageAction, VisionAction
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.recording.result import CountsResult


class Tally:
    """A listener that counts calls, re-asks, fallbacks and backtracks."""

    def __init__(self) -> None:
        self._calls = {"language": 0, "vision": 0}
        self._reasks = 0
        self._fallbacks = 0
        self._backtracks = 0
        self.answer = ""
        """The agent's answer to a question; empty without one."""

    def record(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a new message at a time, simulated seconds."""
        if isinstance(message, MllmRequest):
            self._calls[message.role] += 1
            self._reasks += message.attempt > 0
        elif isinstance(message, LanguageAction | VisionAction):
            self._fallbacks += message.fallback
            if isinstance(message, LanguageAction):
                self._backtracks += message.tool == "backtrack"
                self.answer = message.answer or self.answer

    def counts(self, decisions: int) -> CountsResult:
        """Returns the counts; ``decisions`` are the monitor's."""
        return CountsResult(
            decisions=decisions,
            language_calls=self._calls["language"],
            vision_calls=self._calls["vision"],
            reasks=self._reasks,
            fallbacks=self._fallbacks,
            backtracks=self._backtracks,
        )
