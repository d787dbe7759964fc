"""Gemini's REST format, from the server's side."""

from __future__ import annotations

from typing import Any

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.request import ImagePart
from unilavira_drake.mllm.transfer import EXTRA_FIELD
from unilavira_drake.serving.outcome import STATUS, Answer, Kind, Refusal
from unilavira_drake.serving.question import Question, Turn, integer, picture

_STATUS_NAMES: dict[Kind, str] = {
    "invalid": "INVALID_ARGUMENT",
    "too_long": "INVALID_ARGUMENT",
    "unauthorized": "UNAUTHENTICATED",
    "forbidden": "PERMISSION_DENIED",
    "not_found": "NOT_FOUND",
    "too_large": "INVALID_ARGUMENT",
    "quota": "RESOURCE_EXHAUSTED",
    "internal": "INTERNAL",
    "unreachable": "UNAVAILABLE",
    "timeout": "DEADLINE_EXCEEDED",
}
_DETAILS: dict[Kind, dict[str, Any]] = {
    "too_long": {
        "@type": "type.googleapis.com/google.rpc.ErrorInfo",
        "reason": "CONTEXT_LENGTH_EXCEEDED",
    },
    # The backend has waited already; another wait is for tomorrow.
    "quota": {
        "@type": "type.googleapis.com/google.rpc.QuotaFailure",
        "violations": [{"quotaId": "BackendQuotaPerDay"}],
    },
}
_FINISH = {"complete": "STOP", "truncated": "MAX_TOKENS", "refused": "SAFETY"}
_LEVELS = {"LOW": "low", "MEDIUM": "medium", "HIGH": "high"}


class GeminiFormat:
    """``POST /v1beta/models/MODEL:generateContent``."""

    def question(self, body: dict[str, Any]) -> Question:
        """Returns what a body asks.

        Raises:
            InputError: if it has another form; names the place.
        """
        contents = body.get("contents")
        if not isinstance(contents, list) or not contents:
            raise InputError("contents: must be a list that is not empty.")
        turns = tuple(_turn(turn, f"contents[{number}]") for number, turn in enumerate(contents))
        system = body.get("systemInstruction", body.get("system_instruction"))
        rules = () if system is None else _turn(system, "systemInstruction").parts
        generation = body.get("generationConfig")
        generation = generation if isinstance(generation, dict) else {}
        return Question(
            system="".join(part for part in rules if isinstance(part, str)),
            turns=turns,
            seed=integer(generation.get("seed")),
            schema=generation.get("responseJsonSchema", generation.get("responseSchema")),
            typed=body.get(EXTRA_FIELD),
        )

    def answer(self, answer: Answer, model: str, number: int) -> dict[str, Any]:
        """Returns the body that tells an answer."""
        usage = answer.usage
        candidate: dict[str, Any] = {"index": 0, "finishReason": _FINISH[answer.ended]}
        if answer.ended != "refused":
            candidate["content"] = {"role": "model", "parts": [{"text": answer.text}]}
        else:
            candidate["finishMessage"] = answer.reason
        return {
            "candidates": [candidate],
            "usageMetadata": {
                "promptTokenCount": usage.input_tokens,
                "candidatesTokenCount": usage.output_tokens - usage.reasoning_tokens,
                "thoughtsTokenCount": usage.reasoning_tokens,
                "cachedContentTokenCount": usage.cached_tokens,
                "totalTokenCount": usage.input_tokens + usage.output_tokens,
            },
            "modelVersion": model,
            "responseId": f"response-{number}",
        }

    def refusal(self, refusal: Refusal) -> dict[str, Any]:
        """Returns the body that tells why there is none."""
        error: dict[str, Any] = {
            "code": STATUS[refusal.kind],
            "message": refusal.message,
            "status": _STATUS_NAMES[refusal.kind],
        }
        if refusal.kind in _DETAILS:
            error["details"] = [_DETAILS[refusal.kind]]
        return {"error": error}


def _turn(turn: Any, place: str) -> Turn:
    parts = turn.get("parts") if isinstance(turn, dict) else None
    if not isinstance(parts, list):
        raise InputError(f"{place}.parts: must be a list.")
    speaker = str(turn.get("role", "user"))
    return Turn(
        speaker,
        tuple(_part(part, f"{place}.parts[{number}]") for number, part in enumerate(parts)),
    )


def _part(part: Any, place: str) -> str | ImagePart:
    if isinstance(part, dict) and isinstance(part.get("text"), str):
        return str(part["text"])
    data = part.get("inlineData", part.get("inline_data")) if isinstance(part, dict) else None
    if not isinstance(data, dict):
        raise InputError(f"{place}: must hold text or inlineData; files are not fetched here.")
    resolution = part.get("mediaResolution")
    level = resolution.get("level") if isinstance(resolution, dict) else None
    name = level.rpartition("_")[2] if isinstance(level, str) else ""
    return picture(data.get("data"), place, _LEVELS.get(name, "high"))
