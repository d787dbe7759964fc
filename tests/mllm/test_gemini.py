"""Gemini's REST format: bodies by the documented form, and what each kind of answer means.

The answers are constructed from the provider's documentation, not recorded.
"""

from __future__ import annotations

import base64
import dataclasses
import json
from typing import Any

import pytest

from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmQuotaError,
    MllmRequestError,
    MllmUnreachable,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
    UniLaviraError,
)
from unilavira_drake.mllm.gemini import GeminiDialect
from unilavira_drake.mllm.profile import Profile, RoleSettings, StructuredMode
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.mllm.wire import WireFailure, WireReply

DIALECT = GeminiDialect()
PROFILE = Profile(
    name="g",
    description="",
    dialect="gemini",
    base_url="https://generativelanguage.googleapis.com/",
    model="gemini-3.1-pro-preview",
    language=RoleSettings(thinking="high"),
)
VIEW, PAST = ImagePart("view front", b"\xff\xd8view", "medium"), ImagePart("H1", b"past", "low")
PROMPT = Prompt("The rules.", ("H1:\n", PAST, "view front:\n", VIEW, "Now decide: größer ☂"))
REQUEST = MllmRequest(n=4, call="decide", seed=7, images=(VIEW, PAST))
USAGE = {
    "promptTokenCount": 22305,
    "candidatesTokenCount": 183,
    "thoughtsTokenCount": 1435,
    "cachedContentTokenCount": 16000,
    "totalTokenCount": 23923,
}
COUNTED = Usage(22305, 1618, cached_tokens=16000, reasoning_tokens=1435)


def body(
    request: MllmRequest = REQUEST,
    profile: Profile = PROFILE,
    structured: StructuredMode = "json_schema",
) -> dict[str, Any]:
    data = DIALECT.body(
        PROMPT, request, profile, structured=structured, temperature=1.0, max_output_tokens=16384
    )
    value = json.loads(data)
    assert isinstance(value, dict)
    return value


def read(data: Any, status: int = 200, headers: dict[str, str] | None = None) -> Any:
    return DIALECT.read(status, headers or {}, data, json.dumps(data).encode())


def answer(text: str = '{"a": 1}', reason: str | None = "STOP", **more: Any) -> dict[str, Any]:
    candidate: dict[str, Any] = {"content": {"role": "model", "parts": [{"text": text}]}}
    if reason is not None:
        candidate["finishReason"] = reason
    return {"candidates": [candidate], "usageMetadata": USAGE, **more}


def refusal(code: int, status: str, message: str, *details: dict[str, Any]) -> dict[str, Any]:
    error = {"code": code, "message": message, "status": status, "details": list(details)}
    return {"error": error}


def test_address_and_key() -> None:
    beta = "https://generativelanguage.googleapis.com/v1beta"
    assert DIALECT.url(PROFILE) == f"{beta}/models/gemini-3.1-pro-preview:generateContent"
    alpha = PROFILE.model_copy(update={"base_url": beta.replace("beta", "alpha")})
    assert DIALECT.url(alpha).startswith(
        "https://generativelanguage.googleapis.com/v1alpha/models/"
    )
    assert DIALECT.headers("SECRET")["x-goog-api-key"] == "SECRET"
    assert "SECRET" not in DIALECT.url(PROFILE)
    assert DIALECT.headers(None) == {"content-type": "application/json"}


def test_the_body_has_the_documented_form() -> None:
    value = body()
    assert value["systemInstruction"] == {"parts": [{"text": "The rules."}]}
    generation = value["generationConfig"]
    schema = generation.pop("responseJsonSchema")
    assert schema["required"] == list(schema["properties"])
    assert generation == {
        "temperature": 1.0,
        "maxOutputTokens": 16384,
        "seed": 7,
        "candidateCount": 1,
        "responseMimeType": "application/json",
        "thinkingConfig": {"thinkingLevel": "high", "includeThoughts": False},
    }
    (turn,) = value["contents"]
    assert turn["role"] == "user"
    past, view = turn["parts"][1], turn["parts"][3]
    assert past == {
        "inlineData": {
            "mimeType": "image/jpeg",
            "data": base64.b64encode(PAST.jpeg).decode(),
        },
        "mediaResolution": {"level": "MEDIA_RESOLUTION_LOW"},
    }
    assert base64.b64decode(view["inlineData"]["data"]) == VIEW.jpeg
    assert view["mediaResolution"] == {"level": "MEDIA_RESOLUTION_MEDIUM"}
    assert [part["text"] for part in turn["parts"][::2]] == [
        "H1:\n",
        "view front:\n",
        "Now decide: größer ☂",
    ]


def test_the_same_request_gives_the_same_bytes() -> None:
    def once() -> bytes:
        return DIALECT.body(
            PROMPT,
            dataclasses.replace(REQUEST),
            PROFILE.model_copy(),
            structured="json_schema",
            temperature=0.0,
            max_output_tokens=9,
        )

    assert once() == once()


def test_weaker_modes_put_the_schema_into_the_prompt() -> None:
    value = body(structured="json_object")
    assert value["generationConfig"]["responseMimeType"] == "application/json"
    assert "responseJsonSchema" not in value["generationConfig"]
    assert '"progress_analysis"' in value["contents"][0]["parts"][-1]["text"]
    bare = body(structured="prompt")
    assert "responseMimeType" not in bare["generationConfig"]
    assert bare["contents"] == value["contents"]


def test_a_free_request_asks_for_no_form() -> None:
    free = MllmRequest(call="free", variables=FreeVariables("Hello."))
    data = DIALECT.body(
        Prompt(parts=("Hello.",)),
        free,
        PROFILE.model_copy(update={"language": RoleSettings()}),
        structured="json_schema",
        temperature=0.0,
        max_output_tokens=99,
    )
    assert json.loads(data) == {
        "generationConfig": {
            "temperature": 0.0,
            "maxOutputTokens": 99,
            "seed": 0,
            "candidateCount": 1,
        },
        "contents": [{"role": "user", "parts": [{"text": "Hello."}]}],
    }


def test_a_profile_adds_and_removes_fields() -> None:
    safety = [{"category": "HARM_CATEGORY_DANGEROUS_CONTENT", "threshold": "BLOCK_ONLY_HIGH"}]
    extra = {"safetySettings": safety, "generationConfig": {"topK": 1, "seed": None}}
    value = body(profile=PROFILE.model_copy(update={"body": extra}))
    assert value["safetySettings"] == safety
    assert value["generationConfig"]["topK"] == 1
    assert value["generationConfig"]["temperature"] == 1.0
    assert "seed" not in value["generationConfig"]
    bare = PROFILE.model_copy(
        update={"body": {"generationConfig": None, "systemInstruction": None}}
    )
    assert set(body(profile=bare)) == {"contents"}


def test_a_reply_joins_its_visible_texts() -> None:
    data = answer(modelVersion="gemini-3.1-pro-preview-2")
    data["candidates"][0]["content"]["parts"] = [
        {"text": "I wonder", "thought": True},
        {"text": '{"a"', "thoughtSignature": "x"},
        {"text": ": 1}"},
    ]
    assert read(data) == WireReply('{"a": 1}', COUNTED, "gemini-3.1-pro-preview-2")
    assert read([data]) == read(data)


@pytest.mark.parametrize("reason", [None, "", "FINISH_REASON_UNSPECIFIED", 3])
def test_a_missing_reason_is_no_fault(reason: Any) -> None:
    assert isinstance(read(answer(reason=reason)), WireReply)


def test_arguments_of_a_function_call_are_a_text() -> None:
    data = answer()
    data["candidates"][0]["content"]["parts"] = [
        {"functionCall": {"name": "reply", "args": {"a": "ä"}}}
    ]
    assert json.loads(read(data).text) == {"a": "ä"}


@pytest.mark.parametrize(
    ("reason", "error"),
    [
        ("MAX_TOKENS", ReplyTruncated),
        ("SAFETY", ReplyRefused),
        ("RECITATION", ReplyRefused),
        ("BLOCKLIST", ReplyRefused),
        ("PROHIBITED_CONTENT", ReplyRefused),
        ("SPII", ReplyRefused),
        ("IMAGE_SAFETY", ReplyRefused),
        ("MALFORMED_FUNCTION_CALL", ReplyFormatError),
        ("MALFORMED_RESPONSE", ReplyFormatError),
        ("UNEXPECTED_TOOL_CALL", ReplyFormatError),
        ("LANGUAGE", ReplyFormatError),
        ("OTHER", ReplyFormatError),
        ("SOMETHING_OF_NEXT_YEAR", ReplyFormatError),
    ],
)
def test_other_reasons_are_named(reason: str, error: type[UniLaviraError]) -> None:
    failure = read(answer(reason=reason))
    assert failure.error is error
    assert reason in failure.message
    assert not failure.retryable
    assert failure.usage == COUNTED


def test_a_blocked_prompt_is_a_refusal() -> None:
    failure = read({"promptFeedback": {"blockReason": "PROHIBITED_CONTENT"}})
    assert failure.error is ReplyRefused
    assert "PROHIBITED_CONTENT" in failure.message


@pytest.mark.parametrize("parts", [[], [{"text": "hm", "thought": True}], [{"text": " "}], None])
def test_reasoning_alone_is_no_reply(parts: Any) -> None:
    data = answer()
    data["candidates"][0]["content"]["parts"] = parts
    failure = read(data)
    assert failure.error is ReplyFormatError
    assert failure.usage == COUNTED


@pytest.mark.parametrize(
    "counts",
    [None, [], {"promptTokenCount": -5}, {"promptTokenCount": "9"}, {"promptTokenCount": 1.5},
     {"promptTokenCount": True}, {"promptTokenCount": 10**30}],
)  # fmt: skip
def test_what_is_no_count_counts_nothing(counts: Any) -> None:
    reply = read(answer(usageMetadata=counts))
    assert reply.usage == Usage()


def test_more_cached_than_sent_is_not_believed() -> None:
    counts = {"promptTokenCount": 10, "cachedContentTokenCount": 99}
    assert read(answer(usageMetadata=counts)).usage.cached_tokens == 10


MINUTE = {
    "@type": "type.googleapis.com/google.rpc.QuotaFailure",
    "violations": [{"quotaId": "GenerateRequestsPerMinutePerProjectPerModel", "quotaValue": "5"}],
}
DAY = {
    "@type": "type.googleapis.com/google.rpc.QuotaFailure",
    "violations": [{"quotaId": "GenerateRequestsPerDayPerProjectPerModel-FreeTier"}],
}
DELAY = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "23s"}


@pytest.mark.parametrize("listed", [False, True])
def test_the_delay_stands_in_the_body(listed: bool) -> None:
    data: Any = refusal(429, "RESOURCE_EXHAUSTED", "Slow down.", MINUTE, DELAY)
    failure = read([data] if listed else data, 429, {"retry-after": "1"})
    assert failure == WireFailure(
        MllmQuotaError, "HTTP 429: Slow down.", retryable=True, retry_after=23.0
    )


@pytest.mark.parametrize(
    ("delay", "seconds"),
    [("0.25s", 0.25), ({"seconds": 2, "nanos": 500000000}, 2.5), ("soon", None), (7, None)],
)
def test_forms_of_the_delay(delay: Any, seconds: float | None) -> None:
    data = refusal(503, "UNAVAILABLE", "overloaded", {**DELAY, "retryDelay": delay})
    failure = read(data, 503)
    assert (failure.error, failure.retryable) == (MllmUnreachable, True)
    assert failure.retry_after == seconds


def test_a_quota_of_the_day_is_not_waited_for() -> None:
    failure = read(refusal(429, "RESOURCE_EXHAUSTED", "Quota exceeded", DAY, DELAY), 429)
    assert (failure.error, failure.retryable) == (MllmQuotaError, False)


@pytest.mark.parametrize(
    ("status", "data", "error", "retryable"),
    [
        (400, refusal(400, "INVALID_ARGUMENT", "API key not valid. Pass a valid API key.",
                      {"reason": "API_KEY_INVALID"}), MllmAuthenticationError, False),
        (403, refusal(403, "PERMISSION_DENIED", "no"), MllmAuthenticationError, False),
        (404, refusal(404, "NOT_FOUND", "model is not found"), MllmRequestError, False),
        (400, refusal(400, "INVALID_ARGUMENT", "The input token count (9) exceeds the maximum "
                      "number of tokens allowed (8)."), ContextLengthError, False),
        (500, refusal(500, "INTERNAL", "oops"), MllmUnreachable, True),
        (504, refusal(504, "DEADLINE_EXCEEDED", "late"), MllmUnreachable, True),
        (200, refusal(503, "UNAVAILABLE", "overloaded"), MllmUnreachable, True),
        (200, {"error": {"message": "strange"}}, MllmUnreachable, True),
        (200, {"candidates": []}, MllmUnreachable, True),
        (200, {}, MllmUnreachable, True),
        (200, [], MllmUnreachable, True),
        (200, None, MllmUnreachable, True),
        (200, "text", MllmUnreachable, True),
        (302, None, MllmRequestError, False),
        (503, None, MllmUnreachable, True),
    ],
)  # fmt: skip
def test_refusals(status: int, data: Any, error: type[UniLaviraError], retryable: bool) -> None:
    failure = read(data, status)
    assert (failure.error, failure.retryable, failure.step_down) == (error, retryable, False)


def test_a_schema_that_is_not_taken_is_told_apart() -> None:
    words = 'Invalid JSON payload received. Unknown name "responseJsonSchema"'
    failure = read(refusal(400, "INVALID_ARGUMENT", words), 400)
    assert (failure.error, failure.step_down) == (MllmRequestError, True)


@pytest.mark.parametrize(
    "data",
    [
        {"candidates": [None]},
        {"candidates": [{"content": 3, "finishReason": ["STOP"]}]},
        {"candidates": [{"content": {"parts": [3, None, {"text": 3}, {"functionCall": 3}]}}]},
        {"candidates": 3, "promptFeedback": 3},
        {"error": {"code": True, "message": 3, "details": 3}},
        {"error": {"code": [], "details": [{"@type": "QuotaFailure", "violations": 3}, 4]}},
        {"error": "words"},
    ],
)
@pytest.mark.parametrize("status", [200, 400, 429, 500])
def test_nothing_makes_reading_fail(data: Any, status: int) -> None:
    assert isinstance(read(data, status), WireFailure)


def test_a_page_of_html_is_told_in_words() -> None:
    page = b"<html><head><style>p {}</style></head><body><p>Service\x07 down</p></body></html>"
    failure = DIALECT.read(503, {}, None, page)
    assert failure == WireFailure(MllmUnreachable, "HTTP 503: Service down.", retryable=True)
