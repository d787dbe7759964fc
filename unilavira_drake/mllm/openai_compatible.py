"""The chat format of OpenAI, which most other servers speak: ``POST .../chat/completions``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from unilavira_drake.errors import (
    MllmRequestError,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
)
from unilavira_drake.mllm.profile import Profile, StructuredMode
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.reply_schema import (
    Schema,
    openai_schema,
    request_schema,
    schema_prompt,
)
from unilavira_drake.mllm.request import ImagePart, MllmRequest
from unilavira_drake.mllm.transfer import typed_member
from unilavira_drake.mllm.wire import WireFailure, WireReply
from unilavira_drake.mllm.wire_failures import (
    as_json_text,
    failure_of_status,
    header_delay,
    marks_of,
    tokens,
    told_status,
    unusable,
    words_of,
    words_of_body,
)
from unilavira_drake.mllm.wire_json import base64_of, json_bytes, listed, merged, opened

_DETAIL = {"low": "low", "medium": "auto", "high": "high"}
_COMPLETE = frozenset(
    {"", "stop", "tool_calls", "function_call", "eos", "eos_token", "stop_sequence", "end_turn"}
)
_BROKEN_OFF = frozenset({"error", "abort"})
_NO_STRUCTURE = re.compile(
    r"response_?format|json_?schema|json schema|json_?object|structured_?outputs?|guided_json"
    r"|grammar|literal_error|requested parameters",
    re.IGNORECASE,
)
_SEED_BITS = 0x7FFFFFFF
"""Some servers keep seeds in 32 bits."""


class OpenAiDialect:
    """Pure functions between requests and the OpenAI-compatible chat format."""

    def url(self, profile: Profile) -> str:
        """Returns the address to which a request is posted."""
        return profile.base_url.rstrip("/") + "/chat/completions"

    def headers(self, key: str | None) -> dict[str, str]:
        """Returns the headers that carry the key."""
        headers = {"content-type": "application/json"}
        return headers if key is None else {**headers, "authorization": f"Bearer {key}"}

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
        envelope: dict[str, Any] = {
            "model": profile.model,
            "temperature": temperature,
            "max_tokens": max_output_tokens,
            "seed": request.seed & _SEED_BITS,
            "stream": False,
        }
        schema = request_schema(request)
        tail = ""
        if schema is not None:
            envelope.update(_response_format(structured, request.call, schema))
            if structured != "json_schema":
                tail = schema_prompt(schema)
        effort = profile.settings(request.role).thinking
        if effort:
            envelope["reasoning_effort"] = effort
        parts: list[str | ImagePart] = [*prompt.parts, *([tail] if tail else [])]
        system = json_bytes({"role": "system", "content": prompt.system}) + b","
        pieces = [
            opened(merged(envelope, profile.body)),
            b'"messages":[' + (system if prompt.system else b""),
            b'{"role":"user","content":[',
            *listed(map(_part, parts)),
            b"]}]",
        ]
        return b"".join([*pieces, typed_member(request, prompt, profile), b"}"])

    def read(
        self, status: int, headers: Mapping[str, str], data: Any, body: bytes
    ) -> WireReply | WireFailure:
        """Returns what an answer means; never raises."""
        if isinstance(data, list) and len(data) == 1:  # Google's own compatible endpoint.
            data = data[0]
        refused = not 200 <= status < 300
        if isinstance(data, dict) and (data.get("error") or refused):
            return _error(status, headers, data)
        if refused:
            said = words_of_body(body)
            failure = failure_of_status(status, said, retry_after=header_delay(headers))
            return _stepped(failure, status, said)
        if not isinstance(data, dict):
            return unusable(f"an answer that is no JSON object: {words_of_body(body)!r}.")
        return _reply(data)


def _response_format(structured: StructuredMode, call: str, schema: Schema) -> dict[str, Any]:
    if structured == "json_schema":
        form = {"name": call, "strict": True, "schema": openai_schema(schema)}
        return {"response_format": {"type": "json_schema", "json_schema": form}}
    if structured == "json_object_schema":
        return {"response_format": {"type": "json_object", "schema": openai_schema(schema)}}
    if structured == "json_object":
        return {"response_format": {"type": "json_object"}}
    return {}


def _part(part: str | ImagePart) -> tuple[bytes, ...]:
    if isinstance(part, str):
        return (json_bytes({"type": "text", "text": part}),)
    detail = json_bytes(_DETAIL.get(part.detail, "auto"))
    return (
        b'{"type":"image_url","image_url":{"detail":' + detail,
        b',"url":"data:image/jpeg;base64,',
        base64_of(part.jpeg),
        b'"}}',
    )


def _reply(data: dict[str, Any]) -> WireReply | WireFailure:
    usage = _usage(data)
    choices = data.get("choices")
    choice = choices[0] if isinstance(choices, list) and choices else None
    message = choice.get("message") if isinstance(choice, dict) else None
    if not (isinstance(choice, dict) and isinstance(message, dict)):
        return unusable("an answer without a choice.")
    named = choice.get("finish_reason")
    reason = named if isinstance(named, str) else ""
    if reason == "length":
        words = "the reply was cut off at the limit of output tokens (length)."
        return WireFailure(ReplyTruncated, words, usage=usage)
    text, refusal = _content(message)
    if reason == "content_filter":
        words = "the provider withheld the reply (content_filter)."
        return WireFailure(ReplyRefused, words, usage=usage)
    if refusal and not text.strip():
        return WireFailure(ReplyRefused, f"the model refused: {words_of(refusal)}", usage=usage)
    if reason in _BROKEN_OFF:
        return unusable(f"the server broke the reply off ({reason}).")
    if reason not in _COMPLETE:
        words = f"the reply ended with {words_of(reason)}."
        return WireFailure(ReplyFormatError, words, usage=usage)
    text = text if text.strip() else _arguments(message)
    if not text.strip():
        words = "the reply holds no text besides hidden reasoning."
        return WireFailure(ReplyFormatError, words, usage=usage)
    return WireReply(text, usage, words_of(data.get("model")))


def _content(message: dict[str, Any]) -> tuple[str, str]:
    """The text of a message and its refusal; either may be empty."""
    content, refusal = message.get("content"), message.get("refusal")
    texts = [content] if isinstance(content, str) else []
    refusals = [refusal] if isinstance(refusal, str) else []
    for part in content if isinstance(content, list) else ():
        if isinstance(part, str):
            texts.append(part)
        elif isinstance(part, dict):
            if isinstance(part.get("text"), str) and part.get("type") in (None, "text"):
                texts.append(part["text"])
            if isinstance(part.get("refusal"), str):
                refusals.append(part["refusal"])
    return "".join(texts), "".join(refusals).strip()


def _arguments(message: dict[str, Any]) -> str:
    """The arguments of the first call of a tool; models give their record like this at times."""
    calls = message.get("tool_calls")
    first = calls[0] if isinstance(calls, list) and calls else None
    called = first.get("function") if isinstance(first, dict) else message.get("function_call")
    return as_json_text(called.get("arguments")) if isinstance(called, dict) else ""


def _usage(data: dict[str, Any]) -> Usage:
    counts = data.get("usage")
    read, written = tokens(counts, "prompt_tokens"), tokens(counts, "completion_tokens")
    cached = tokens(counts, "prompt_tokens_details", "cached_tokens")
    reasoning = tokens(counts, "completion_tokens_details", "reasoning_tokens")
    return Usage(
        input_tokens=read,
        output_tokens=written,
        cached_tokens=min(cached, read),
        reasoning_tokens=min(reasoning, written),
    )


def _error(status: int, headers: Mapping[str, str], data: dict[str, Any]) -> WireFailure:
    """What an error object means; FastAPI calls it ``detail``, older servers give a bare text."""
    error = data.get("error") or data.get("detail") or data.get("message") or data
    inner = error if isinstance(error, dict) else {"message": _bare_words(error)}
    code = inner.get("code", data.get("code"))
    if status < 300:
        status = told_status(code) or status
    message = words_of(inner.get("message"))
    extra = inner.get("metadata")
    raw = extra.get("raw") if isinstance(extra, dict) else None
    marks = marks_of(code, inner.get("type"), inner.get("param"), inner.get("status"), raw)
    failure = failure_of_status(status, message, marks=marks, retry_after=header_delay(headers))
    return _stepped(failure, status, f"{marks} {message}")


def _bare_words(error: Any) -> str:
    if isinstance(error, str):
        return error
    # A list of pydantic's complaints.
    return marks_of(
        *(
            f"{item.get('type', '')} {item.get('loc', '')} {item.get('msg', '')};"
            for item in (error if isinstance(error, list) else ())
            if isinstance(item, dict)
        )
    )


def _stepped(failure: WireFailure, status: int, said: str) -> WireFailure:
    """Marks a failure that names our way of asking for JSON.

    Status 500 counts only with the complaint of llama-cpp-python: others name their own troubles.
    """
    asked_wrongly = failure.error is MllmRequestError or (status == 500 and "literal_error" in said)
    if asked_wrongly and _NO_STRUCTURE.search(said):
        return WireFailure(MllmRequestError, failure.message, step_down=True)
    return failure
