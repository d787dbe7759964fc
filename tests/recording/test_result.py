from __future__ import annotations

import json

import pytest

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.recording.result import (
    EpisodeResult,
    MetricsResult,
    TaskResult,
    UsageResult,
    installed_versions,
    result_from_json,
)

RESULT = EpisodeResult(
    scored=True,
    success=False,
    cause="stalled",
    task=TaskResult("vln", "Gehe zur Tür.", "door", "door_1"),
    metrics=MetricsResult(navigation_error_m=1.5, spl=0.0),
    usage=UsageResult(input_tokens=3),
    versions={"python": "3.11"},
)


def words(text: str) -> set[str]:
    return set(text.split())


def test_a_result_survives_its_file() -> None:
    assert result_from_json(RESULT.to_json()) == RESULT


def test_the_file_holds_the_public_names() -> None:
    data = json.loads(EpisodeResult().to_json())
    assert set(data) >= words(
        "schema_version scored success cause task scenario robot ablation seed model metrics "
        "counts usage time versions"
    )
    assert set(data["task"]) == {"family", "text", "name", "goal", "protocol"}
    assert set(data["model"]) == {"language", "vision", "perception", "reasoning"}
    assert set(data["metrics"]) >= words(
        "navigation_error_m path_length_m shortest_path_m spl oracle_success collisions "
        "max_contact_force_n answer answer_correct answer_score"
    )
    assert set(data["counts"]) == words(
        "decisions language_calls vision_calls reasks fallbacks backtracks"
    )
    assert set(data["usage"]) == words(
        "input_tokens output_tokens images cost_usd cached_tokens reasoning_tokens attempts errors"
    )
    assert data["time"] == {"simulated_s": 0.0}
    assert data["success"] is None


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"schema_version": 99}', RESULT.to_json().replace("cause", "causes")],
)
def test_another_file_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"result\.json"):
        result_from_json(text)


def test_the_usage_is_that_of_both_models() -> None:
    language = ModelUsage(3, 1, 5, Usage(900, 90, 12, 0.25, 400, 60), 0.25, 40.0)
    vision = ModelUsage(2, 0, 2, Usage(100, 10, 2, None), 0.0, 2.0)
    assert UsageResult.of(language + vision) == UsageResult(1000, 100, 14, None, 400, 60, 7, 1)
    assert (language + vision).spent_usd == 0.25
    assert UsageResult.of(ModelUsage()) == UsageResult(cost_usd=0.0)


def test_a_result_of_before_these_fields_is_read() -> None:
    data = json.loads(RESULT.to_json())
    for name in ("attempts", "errors"):
        del data["usage"][name]
    del data["error"]
    assert result_from_json(json.dumps(data)) == RESULT


def test_versions_are_told() -> None:
    assert installed_versions()["python"].startswith("3.")
    assert installed_versions()["drake"][0].isdigit()
