"""Gemini's own REST format: ``POST .../models/MODEL:generateContent``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from unilavira_drake.errors import (
    MllmQuotaError,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
)
from unilavira_drake.mllm.profile import Profile, StructuredMode
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.reply_schema import gemini_schema, request_schema, schema_prompt
from unilavira_drake.mllm.request import ImagePart, MllmRequest
from unilavira_drake.mllm.transfer import typed_member
from unilavira_drake.mllm.wire import WireFailure, WireReply
from unilavira_drake.mllm.wire_failures import (
    as_json_text,
    failure_of_status,
    header_delay,
    marks_of,
    status_words,
    tokens,
    told_status,
    unusable,
    words_of,
    words_of_body,
)
from unilavira_drake.mllm.wire_json import base64_of, json_bytes, listed, merged, opened

_COMPLETE = frozenset({"STOP", "FINISH_REASON_UNSPECIFIED", ""})
_REFUSED = frozenset(
    {
        "SAFETY",
        "RECITATION",
        "BLOCKLIST",
        "PROHIBITED_CONTENT",
        "SPII",
        "IMAGE_SAFETY",
        "IMAGE_PROHIBITED_CONTENT",
        "IMAGE_RECITATION",
        "MODEL_ARMOR",
    }
)
_NO_SCHEMA = re.compile(
    r"response_?(json_?)?schema|response_?format|json schema|specified schema|json mode",
    re.IGNORECASE,
)
_VERSION = re.compile(r"/v\d+[a-z0-9]*$")
_SEED_BITS = 0x7FFFFFFF
"""Seeds are 32-bit integers there."""


class GeminiDialect:
    """Pure functions between requests and Gemini's REST format."""

    def url(self, profile: Profile) -> str:
        """Returns the address to which a request is posted.

        ``base_url`` may end in a version of the API; without one it is ``v1beta``.
        """
        base = profile.base_url.rstrip("/")
        if not _VERSION.search(base):
            base += "/v1beta"
        return f"{base}/models/{quote(profile.model, safe='/')}:generateContent"

    def headers(self, key: str | None) -> dict[str, str]:
        """Returns the headers that carry the key; an address would end up in logs."""
        headers = {"content-type": "application/json"}
        return headers if key is None else {**headers, "x-goog-api-key": key}

    def body(
        self,
        prompt: Prompt,
        request: MllmRequest,
        profile: Profile,
        *,
        structured: StructuredMode,
        temperature: float,
        max_output_tokens: int,
    ) -> bytes:
        """Returns the JSON body of a request."""
        generation: dict[str, Any] = {
            "temperature": temperature,
            "maxOutputTokens": max_output_tokens,
            "seed": request.seed & _SEED_BITS,
            "candidateCount": 1,
        }
        schema = request_schema(request)
        tail = ""
        if schema is not None:
            if structured != "prompt":
                generation["responseMimeType"] = "application/json"
            if structured == "json_schema":
                generation["responseJsonSchema"] = gemini_schema(schema)
            else:
                tail = schema_prompt(schema)
        level = profile.settings(request.role).thinking
        if level:
            generation["thinkingConfig"] = {"thinkingLevel": level, "includeThoughts": False}
        envelope: dict[str, Any] = {}
        if prompt.system:
            envelope["systemInstruction"] = {"parts": [{"text": prompt.system}]}
        envelope = merged({**envelope, "generationConfig": generation}, profile.body)
        parts: list[str | ImagePart] = [*prompt.parts, *([tail] if tail else [])]
        pieces = [
            opened(envelope),
            b'"contents":[{"role":"user","parts":[',
            *listed(map(_part, parts)),
            b"]}]",
        ]
        return b"".join([*pieces, typed_member(request, prompt, profile), b"}"])

    def read(
        self, status: int, headers: Mapping[str, str], data: Any, body: bytes
    ) -> WireReply | WireFailure:
        """Returns what an answer means; never raises."""
        if isinstance(data, list) and len(data) == 1:  # Errors come in a list at times.
            data = data[0]
        error = data.get("error") if isinstance(data, dict) else None
        if isinstance(error, dict):
            return _error(status, headers, error)
        if not 200 <= status < 300:
            said = words_of_body(body)
            return failure_of_status(status, said, retry_after=header_delay(headers))
        if not isinstance(data, dict):
            return unusable(f"an answer that is no JSON object: {words_of_body(body)!r}.")
        return _reply(data)


def _part(part: str | ImagePart) -> tuple[bytes, ...]:
    if isinstance(part, str):
        return (json_bytes({"text": part}),)
    resolution = json_bytes({"level": f"MEDIA_RESOLUTION_{part.detail.upper()}"})
    return (
        b'{"inlineData":{"mimeType":"image/jpeg","data":"',
        base64_of(part.jpeg),
        b'"},"mediaResolution":' + resolution + b"}",
    )


def _reply(data: dict[str, Any]) -> WireReply | WireFailure:
    usage = _usage(data)
    candidates = data.get("candidates")
    if not (isinstance(candidates, list) and candidates and isinstance(candidates[0], dict)):
        feedback = data.get("promptFeedback")
        blocked = feedback.get("blockReason") if isinstance(feedback, dict) else None
        if isinstance(blocked, str) and blocked:
            words = f"the provider blocked the prompt ({words_of(blocked)})."
            return WireFailure(ReplyRefused, words, usage=usage)
        return unusable("an answer without candidates.")
    candidate = candidates[0]
    named = candidate.get("finishReason")
    reason = named if isinstance(named, str) else ""
    if reason == "MAX_TOKENS":
        words = "the reply was cut off at the limit of output tokens (MAX_TOKENS)."
        return WireFailure(ReplyTruncated, words, usage=usage)
    if reason in _REFUSED:
        words = f"the provider withheld the reply ({reason})."
        return WireFailure(ReplyRefused, words, usage=usage)
    if reason not in _COMPLETE:
        said = words_of(candidate.get("finishMessage"))
        words = f"the reply ended with {words_of(reason)}" + (f": {said}" if said else "") + "."
        return WireFailure(ReplyFormatError, words, usage=usage)
    text = _text(candidate)
    if not text.strip():
        words = "the reply holds no text besides hidden reasoning."
        return WireFailure(ReplyFormatError, words, usage=usage)
    version = data.get("modelVersion")
    return WireReply(text, usage, words_of(version))


def _text(candidate: dict[str, Any]) -> str:
    """The visible texts of a candidate, or the arguments of its call of a function."""
    content = candidate.get("content")
    texts, calls = [], []
    for part in _objects(content.get("parts") if isinstance(content, dict) else None):
        if part.get("thought") is True:
            continue
        if isinstance(part.get("text"), str):
            texts.append(part["text"])
        call = part.get("functionCall")
        if isinstance(call, dict):
            calls.append(as_json_text(call.get("args")))
    text = "".join(texts)
    return text if text.strip() or not calls else calls[0]


def _usage(data: dict[str, Any]) -> Usage:
    counts = data.get("usageMetadata")
    thoughts = tokens(counts, "thoughtsTokenCount")
    read = tokens(counts, "promptTokenCount") + tokens(counts, "toolUsePromptTokenCount")
    return Usage(
        input_tokens=read,
        output_tokens=tokens(counts, "candidatesTokenCount") + thoughts,
        cached_tokens=min(tokens(counts, "cachedContentTokenCount"), read),
        reasoning_tokens=thoughts,
    )


def _error(status: int, headers: Mapping[str, str], error: dict[str, Any]) -> WireFailure:
    code = error.get("code")
    if status < 300:
        status = told_status(code) or status
    details = _objects(error.get("details"))
    delay = next((d for d in map(_retry_delay, details) if d is not None), header_delay(headers))
    message = words_of(error.get("message"))
    marks = marks_of(error.get("status"), *(item.get("reason") for item in details))
    if status == 429 and any(map(_is_spent, details)):
        return WireFailure(MllmQuotaError, status_words(status, message))
    failure = failure_of_status(status, message, marks=marks, retry_after=delay)
    if status == 400 and not failure.retryable and _NO_SCHEMA.search(message):
        return WireFailure(failure.error, failure.message, step_down=True)
    return failure


def _objects(value: Any) -> list[dict[str, Any]]:
    """The objects of what should be a list of them."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def _retry_delay(detail: dict[str, Any]) -> float | None:
    """The seconds of a ``RetryInfo``: ``"23s"``, or seconds and nanoseconds."""
    if not str(detail.get("@type", "")).endswith("RetryInfo"):
        return None
    delay = detail.get("retryDelay")
    if isinstance(delay, dict):
        return tokens(delay, "seconds") + tokens(delay, "nanos") / 1e9
    match = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)s", delay) if isinstance(delay, str) else None
    return float(match[1]) if match else None


def _is_spent(detail: dict[str, Any]) -> bool:
    """Whether a ``QuotaFailure`` names a quota of a day, or one of nothing at all."""
    for violation in _objects(detail.get("violations")):
        name = f"{violation.get('quotaId', '')} {violation.get('quotaMetric', '')}".lower()
        if "perday" in name or "per_day" in name or violation.get("quotaValue") == "0":
            return True
    return False
