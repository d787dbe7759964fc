from __future__ import annotations

import dataclasses
import json

import pytest

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.recording.result import (
    EpisodeResult,
    JudgeResult,
    MetricsResult,
    RoleUsageResult,
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


LANGUAGE = ModelUsage(3, 1, 5, Usage(900, 90, 12, 0.25, 400, 60), 0.25, 40.0)
VISION = ModelUsage(2, 0, 2, Usage(100, 10, 2, 0.0), 0.0, 2.0)
JUDGE = ModelUsage(1, 0, 2, Usage(300, 30, 0, 0.5), 0.5, 3.0)
JUDGED = dataclasses.replace(
    RESULT,
    usage=UsageResult.of(LANGUAGE, VISION, JUDGE),
    judge=JudgeResult("someone", 4, "Nearly."),
)


def words(text: str) -> set[str]:
    return set(text.split())


@pytest.mark.parametrize("result", [RESULT, JUDGED], ids=["alone", "judged"])
def test_a_result_survives_its_file(result: EpisodeResult) -> None:
    assert result_from_json(result.to_json()) == result


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
        "path_type max_contact_force_n answer answer_correct answer_score"
    )
    assert set(data["counts"]) == words(
        "decisions language_calls vision_calls reasks fallbacks backtracks"
    )
    columns = words(
        "input_tokens output_tokens images cost_usd cached_tokens reasoning_tokens attempts errors "
        "calls"
    )
    assert set(data["usage"]) == columns | {"language", "vision", "judge"}
    assert data["usage"]["judge"] is data["judge"] is data["success"] is None
    data = json.loads(JUDGED.to_json())
    assert set(data["usage"]["language"]) == set(data["usage"]["judge"]) == columns
    assert data["judge"] == {"model": "someone", "mark": 4, "reasoning": "Nearly."}
    assert data["time"] == {"simulated_s": 0.0}


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", '{"schema_version": 99}', RESULT.to_json().replace("cause", "causes"),
        JUDGED.to_json().replace("mark", "note"), JUDGED.to_json().replace("calls", "questions"),
    ],
)  # fmt: skip
def test_another_file_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"result\.json"):
        result_from_json(text)


def test_the_usage_is_that_of_all_models_and_tells_them_apart() -> None:
    language = RoleUsageResult(900, 90, 12, 0.25, 400, 60, 5, 1, 3)
    vision = RoleUsageResult(100, 10, 2, 0.0, 0, 0, 2, 0, 2)
    judge = RoleUsageResult(300, 30, 0, 0.5, 0, 0, 2, 0, 1)
    alone = UsageResult.of(LANGUAGE, VISION)
    assert alone == UsageResult(1000, 100, 14, 0.25, 400, 60, 7, 1, 5, language, vision, None)
    judged = UsageResult.of(LANGUAGE, VISION, JUDGE)
    assert judged == UsageResult(1300, 130, 14, 0.75, 400, 60, 9, 1, 6, language, vision, judge)
    nothing = RoleUsageResult(cost_usd=0.0)
    assert UsageResult.of(ModelUsage(), ModelUsage()) == UsageResult(
        cost_usd=0.0, language=nothing, vision=nothing
    )


def test_one_price_that_is_not_known_leaves_the_others_known() -> None:
    unknown = ModelUsage(1, 0, 1, Usage(300, 30, 0, None))
    usage = UsageResult.of(LANGUAGE, VISION, unknown)
    assert usage.cost_usd is None
    assert usage.language is not None
    assert usage.judge is not None
    assert (usage.language.cost_usd, usage.judge.cost_usd) == (0.25, None)


def test_a_result_of_before_these_fields_is_read() -> None:
    data = json.loads(RESULT.to_json())
    for name in ("attempts", "errors", "calls", "language", "vision", "judge"):
        del data["usage"][name]
    del data["error"], data["judge"]
    assert result_from_json(json.dumps(data)) == RESULT


def test_versions_are_told() -> None:
    assert installed_versions()["python"].startswith("3.")
    assert installed_versions()["drake"][0].isdigit()
