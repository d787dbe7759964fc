"""Every way in which an episode ends has its name, and keeps what was done."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from pydrake.systems.framework import Context

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.ports import Level, message_input

SILENCE = "language_latency: !ConstantLatency {seconds: 100000}"


@pytest.mark.parametrize(
    ("overlay", "cause"),
    [
        (f"{SILENCE}\nbudgets: {{simulated_time: 12, stall: 5}}", "time_budget"),
        ("budgets: {decisions: 1}", "decision_budget"),
    ],
)
def test_budgets_and_silence_end_with_a_named_cause(overlay: str, cause: str) -> None:
    result = run_episode(load_scenario("flat", overlay))
    assert result.cause == cause
    assert result.success is False
    assert result.metrics.spl == 0.0


class DeadLink(Level):
    """A link that has lost the model's reply."""

    def __init__(self) -> None:
        super().__init__(MllmReply(), period=0.1)
        message_input(self, "model_request", MllmRequest())
        self.declare_output("model_reply", lambda state: state, MllmReply())
        self.declare_output("usage", lambda state: ModelUsage(), ModelUsage())

    def step(self, context: Context, state: MllmReply) -> MllmReply:
        return state


def test_a_ring_that_stands_still_is_stalled() -> None:
    scenario = load_scenario("flat", "budgets: {stall: 20}")
    result = run_episode(scenario, replace={"language_link": DeadLink()})
    assert (result.cause, result.success) == ("stalled", False)


def test_an_interrupt_keeps_what_was_done(tmp_path: Path) -> None:
    def interrupt(t: float, system: str, event: str, message: Any) -> None:
        if isinstance(message, LanguageAction) and message.n == 3:
            raise KeyboardInterrupt

    result = run_episode(load_scenario("flat"), out=tmp_path / "run", on_event=interrupt)
    assert result.cause == "interrupted"
    lines = (tmp_path / "run" / "transcript.jsonl").read_text().splitlines()
    assert {json.loads(line)["decision"] for line in lines} >= {1, 2}
    assert json.loads((tmp_path / "run" / "result.json").read_text())["cause"] == "interrupted"
    assert (tmp_path / "run" / "map.png").read_bytes().startswith(b"\x89PNG")


def test_free_text_without_a_goal_is_not_scored() -> None:
    overlay = "task: {text: 'Go to the red sofa.'}\nbudgets: {decisions: 1}"
    result = run_episode(load_scenario("flat", overlay))
    assert result.scored is False
    assert result.success is None
    assert result.metrics.navigation_error_m is None
    assert result.metrics.spl is None
