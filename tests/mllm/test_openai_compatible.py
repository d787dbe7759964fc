"""The OpenAI-compatible format: bodies for each server's habits, and what each answer means.

The answers are constructed from documentation and from what the servers were seen to send.
"""

from __future__ import annotations

import base64
import datetime
import email.utils
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
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.profile import Profile, RoleSettings, StructuredMode
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.mllm.wire import WireFailure, WireReply

DIALECT = OpenAiDialect()
PROFILE = Profile(
    name="q",
    description="",
    dialect="openai",
    base_url="http://127.0.0.1:8080/v1/",
    model="qwen3.5-27b",
    body={"enable_thinking": False},
)
PICTURE = ImagePart("view front", b"\xff\xd8view", "medium")
PROMPT = Prompt("The rules.", ("view front:\n", PICTURE, "größer ☂ \ud800"))
REQUEST = MllmRequest(n=4, call="decide", seed=2**40 + 7, images=(PICTURE,))
USAGE = {
    "prompt_tokens": 990,
    "completion_tokens": 110,
    "prompt_tokens_details": {"cached_tokens": 640},
    "completion_tokens_details": {"reasoning_tokens": 30},
}
COUNTED = Usage(990, 110, cached_tokens=640, reasoning_tokens=30)


def body(
    request: MllmRequest = REQUEST,
    profile: Profile = PROFILE,
    structured: StructuredMode = "json_schema",
    prompt: Prompt = PROMPT,
) -> dict[str, Any]:
    data = DIALECT.body(
        prompt, request, profile, structured=structured, temperature=0.3, max_output_tokens=1024
    )
    value = json.loads(data.decode())
    assert isinstance(value, dict)
    return value


def read(data: Any, status: int = 200, headers: dict[str, str] | None = None) -> Any:
    return DIALECT.read(status, headers or {}, data, json.dumps(data).encode())


def answer(
    content: Any = '{"a": 1}', reason: Any = "stop", usage: Any = USAGE, **message: Any
) -> dict[str, Any]:
    message = {"role": "assistant", "content": content, **message}
    return {
        "model": "qwen3.5-27b-2026",
        "choices": [{"index": 0, "message": message, "finish_reason": reason}],
        "usage": usage,
    }


def test_address_and_key() -> None:
    assert DIALECT.url(PROFILE) == "http://127.0.0.1:8080/v1/chat/completions"
    assert DIALECT.headers("SECRET")["authorization"] == "Bearer SECRET"
    assert DIALECT.headers(None) == {"content-type": "application/json"}


def test_the_body_has_the_documented_form() -> None:
    value = body()
    form = value.pop("response_format")
    assert form["type"] == "json_schema"
    assert (form["json_schema"]["name"], form["json_schema"]["strict"]) == ("decide", True)
    assert form["json_schema"]["schema"]["additionalProperties"] is False
    url = "data:image/jpeg;base64," + base64.b64encode(PICTURE.jpeg).decode()
    assert value == {
        "model": "qwen3.5-27b",
        "temperature": 0.3,
        "max_tokens": 1024,
        "seed": 7,
        "stream": False,
        "enable_thinking": False,
        "messages": [
            {"role": "system", "content": "The rules."},
            {
                "role": "user",
                "content": [
                    {"type": "text", "text": "view front:\n"},
                    {"type": "image_url", "image_url": {"url": url, "detail": "auto"}},
                    {"type": "text", "text": "größer ☂ ?"},
                ],
            },
        ],
    }


def test_the_same_request_gives_the_same_bytes() -> None:
    assert body() == body()


def test_each_mode_asks_in_its_own_way() -> None:
    typed = body(structured="json_object_schema")
    assert typed["response_format"]["type"] == "json_object"
    assert typed["response_format"]["schema"]["required"][0] == "progress_analysis"
    assert body(structured="json_object")["response_format"] == {"type": "json_object"}
    assert "response_format" not in body(structured="prompt")
    modes: tuple[StructuredMode, ...] = ("json_object_schema", "json_object", "prompt")
    for mode in modes:
        last = body(structured=mode)["messages"][-1]["content"][-1]["text"]
        # Some servers insist on the word where they are asked for JSON.
        assert "JSON" in last
        assert '"progress_analysis"' in last


def test_a_free_request_asks_for_no_form() -> None:
    free = MllmRequest(role="vision", call="free", variables=FreeVariables("Hello."))
    profile = PROFILE.model_copy(update={"vision": RoleSettings(thinking="low")})
    value = body(free, profile, prompt=Prompt(parts=("Hello.",)))
    assert "response_format" not in value
    assert value["reasoning_effort"] == "low"
    assert value["messages"] == [{"role": "user", "content": [{"type": "text", "text": "Hello."}]}]


def test_a_profile_takes_fields_out() -> None:
    profile = PROFILE.model_copy(update={"body": {"seed": None, "max_tokens": None, "top_k": 3}})
    value = body(profile=profile)
    assert not {"seed", "max_tokens"} & set(value)
    assert value["top_k"] == 3


def test_a_reply_with_its_costs() -> None:
    assert read(answer()) == WireReply('{"a": 1}', COUNTED, "qwen3.5-27b-2026")


@pytest.mark.parametrize("reason", ["stop", "tool_calls", "eos_token", "end_turn", "", None, 3])
def test_complete_replies(reason: Any) -> None:
    assert isinstance(read(answer(reason=reason)), WireReply)


@pytest.mark.parametrize(
    "content", [[{"type": "text", "text": '{"a"'}, {"type": "text", "text": ": 1}"}], ['{"a": 1}']]
)
def test_lists_of_parts_are_joined(content: Any) -> None:
    assert read(answer(content)).text == '{"a": 1}'


@pytest.mark.parametrize("arguments", ['{"a": 1}', {"a": 1}])
@pytest.mark.parametrize("old", [False, True])
def test_arguments_of_a_tool_call_are_a_text(arguments: Any, old: bool) -> None:
    call = {"name": "reply", "arguments": arguments}
    more: dict[str, Any] = {"function_call": call} if old else {"tool_calls": [{"function": call}]}
    assert json.loads(read(answer(None, "tool_calls", **more)).text) == {"a": 1}


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (answer('{"a"', "length"), ReplyTruncated),
        (answer(None, "content_filter"), ReplyRefused),
        (answer(None, refusal="I cannot help with that."), ReplyRefused),
        (answer([{"type": "refusal", "refusal": "No."}]), ReplyRefused),
        (answer(""), ReplyFormatError),
        (answer(None), ReplyFormatError),
        (answer(None, reasoning_content='{"a": 1}'), ReplyFormatError),
        (answer("", reasoning="hm"), ReplyFormatError),
        (answer(reason="of_next_year"), ReplyFormatError),
    ],
)
def test_replies_that_are_none(data: Any, error: type[UniLaviraError]) -> None:
    failure = read(data)
    assert (failure.error, failure.retryable) == (error, False)
    assert failure.usage == COUNTED


def test_a_filter_or_reason_is_named() -> None:
    assert "of_next_year" in read(answer(reason="of_next_year")).message
    assert "I cannot" in read(answer(None, refusal="I cannot.")).message


@pytest.mark.parametrize(
    "usage",
    [None, 3, {}, {"prompt_tokens": -1}, {"prompt_tokens": "9"}, {"prompt_tokens": 10**4000}],
)
def test_what_is_no_count_counts_nothing(usage: Any) -> None:
    assert read(answer(usage=usage)).usage == Usage()


def error(message: str, **more: Any) -> dict[str, Any]:
    return {"error": {"message": message, **more}}


@pytest.mark.parametrize(
    ("status", "data", "kind", "retryable"),
    [
        (401, error("Incorrect API key"), MllmAuthenticationError, False),
        (403, error("forbidden"), MllmAuthenticationError, False),
        (403, error("Your input was flagged: requires moderation"), ReplyRefused, False),
        (402, error("Insufficient credits"), MllmQuotaError, False),
        (429, error("You exceeded your quota", code="insufficient_quota"), MllmQuotaError, False),
        (429, error("Rate limit", code="Throttling.RateQuota"), MllmQuotaError, True),
        (400, error("overdue", code="Arrearage"), MllmQuotaError, False),
        (400, error("too long", type="exceed_context_size_error", n_ctx=4096),
         ContextLengthError, False),
        (400, error("This model's maximum context length is 8192 tokens.",
                    code="context_length_exceeded"), ContextLengthError, False),
        (400, error("Range of input length should be [1, 9]"), ContextLengthError, False),
        (400, error("Input data may contain inappropriate content.",
                    code="DataInspectionFailed"), ReplyRefused, False),
        (400, error("x", code="data_inspection_failed"), ReplyRefused, False),
        (400, error("Failed to load image or audio file"), MllmRequestError, False),
        (404, error("model 'x' not found"), MllmRequestError, False),
        (413, error("Request Entity Too Large"), MllmRequestError, False),
        (307, None, MllmRequestError, False),
        (408, error("slow"), MllmUnreachable, True),
        (500, error("oops"), MllmUnreachable, True),
        (502, None, MllmUnreachable, True),
        (503, error("Loading model", type="unavailable_error", code=503), MllmUnreachable, True),
        (200, error("Provider returned error", code=502), MllmUnreachable, True),
        (200, error("Rate limited upstream", code=429), MllmQuotaError, True),
        (200, error("no more", code="insufficient_quota"), MllmQuotaError, False),
        (200, {"error": "words"}, MllmUnreachable, True),
        (200, {"choices": []}, MllmUnreachable, True),
        (200, {}, MllmUnreachable, True),
        (200, answer(reason="error"), MllmUnreachable, True),
        (200, None, MllmUnreachable, True),
        (200, [1, 2], MllmUnreachable, True),
    ],
)  # fmt: skip
def test_refusals(status: int, data: Any, kind: type[UniLaviraError], retryable: bool) -> None:
    failure = read(data, status)
    assert (failure.error, failure.retryable, failure.step_down) == (kind, retryable, False)


@pytest.mark.parametrize(
    ("status", "data"),
    [
        (400, error("Unable to generate parser: JSON schema error at #/properties/a")),
        (400, error("'response_format.type' must be text or json_object", param="response_format")),
        (400, error("failed to parse grammar")),
        (422, {"detail": [{"type": "extra_forbidden", "loc": ["body", "response_format"],
                           "msg": "Extra inputs are not permitted"}]}),
        (404, error("No endpoints found that can handle the requested parameters.")),
        # llama-cpp-python.
        (500, error("[{'type': 'literal_error', 'loc': ('body', 'response_format', 'type'), "
                    "'msg': \"Input should be 'text' or 'json_object'\"}]")),
    ],
)  # fmt: skip
def test_a_way_of_asking_that_is_not_known(status: int, data: Any) -> None:
    failure = read(data, status)
    assert (failure.error, failure.step_down) == (MllmRequestError, True)
    assert not failure.retryable


def test_a_server_error_that_merely_names_json_is_retried() -> None:
    failure = read(error("json_schema worker crashed"), 500)
    assert (failure.error, failure.step_down) == (MllmUnreachable, False)


LATER = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(seconds=600)


@pytest.mark.parametrize(
    ("headers", "low", "high"),
    [
        ({"retry-after": "1"}, 1.0, 1.0),
        ({"retry-after": "600"}, 600.0, 600.0),
        ({"retry-after-ms": "250", "retry-after": "9"}, 0.25, 0.25),
        ({"retry-after": email.utils.format_datetime(LATER, usegmt=True)}, 300.0, 601.0),
        ({"retry-after": "Sun, 06 Nov 1994 08:49:37 GMT"}, 0.0, 0.0),
    ],
)
def test_times_to_wait(headers: dict[str, str], low: float, high: float) -> None:
    failure = read(error("slow down"), 429, headers)
    assert failure.retryable
    assert low <= failure.retry_after <= high


@pytest.mark.parametrize("text", ["", "soon", "-3", "nan", "inf", "Xxx, 99 Foo 1 99:99:99"])
def test_what_is_no_time_is_none(text: str) -> None:
    assert read(error("slow down"), 429, {"retry-after": text}).retry_after is None


@pytest.mark.parametrize(
    "data",
    [
        {"choices": [None]},
        {"choices": [{"message": None}]},
        {"choices": [{"message": {"content": {"a": 1}, "tool_calls": [3]}}]},
        {"choices": [{"message": {"content": [3, {"text": 3}], "tool_calls": {}}}]},
        {"choices": [{"message": {"function_call": {"arguments": 3}}, "finish_reason": [1]}]},
        {"error": {"code": [], "message": {}, "metadata": {"raw": 3}}},
        {"error": [3]},
        {"detail": [3, {"loc": 3}]},
    ],
)
@pytest.mark.parametrize("status", [200, 400, 422, 429, 500])
def test_nothing_makes_reading_fail(data: Any, status: int) -> None:
    assert isinstance(read(data, status), WireFailure)
