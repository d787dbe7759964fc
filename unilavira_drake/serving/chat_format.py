"""The OpenAI-compatible chat format, from the server's side."""

from __future__ import annotations

import re
import time
from typing import Any

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.request import ImagePart
from unilavira_drake.mllm.transfer import EXTRA_FIELD
from unilavira_drake.serving.outcome import STATUS, Answer, Kind, Refusal
from unilavira_drake.serving.question import Question, Turn, integer, picture

_DATA_URL = re.compile(r"data:image/[a-z0-9.+-]+;base64,", re.IGNORECASE)
_DETAIL = {"low": "low", "auto": "medium", "high": "high"}
_CODES: dict[Kind, str] = {
    "invalid": "invalid_request",
    "too_long": "context_length_exceeded",
    "unauthorized": "invalid_api_key",
    "quota": "insufficient_quota",
}


class ChatFormat:
    """``POST /v1/chat/completions``."""

    def question(self, body: dict[str, Any]) -> Question:
        """Returns what a body asks.

        Raises:
            InputError: if it has another form; names the place.
        """
        if body.get("stream"):
            raise InputError("stream: replies are not streamed here; leave it out.")
        messages = body.get("messages")
        if not isinstance(messages, list) or not messages:
            raise InputError("messages: must be a list that is not empty.")
        system, turns = [], []
        for number, message in enumerate(messages):
            place = f"messages[{number}]"
            if not isinstance(message, dict):
                raise InputError(f"{place}: must be an object.")
            parts = _parts(message.get("content"), f"{place}.content")
            speaker = str(message.get("role", "user"))
            if speaker in ("system", "developer"):
                system.append("".join(part for part in parts if isinstance(part, str)))
            else:
                turns.append(Turn(speaker, parts))
        form = body.get("response_format")
        schema = None
        if isinstance(form, dict):
            inner = form.get("json_schema")
            schema = inner.get("schema") if isinstance(inner, dict) else form.get("schema")
        return Question(
            system="\n\n".join(system),
            turns=tuple(turns),
            seed=integer(body.get("seed")),
            schema=schema,
            typed=body.get(EXTRA_FIELD),
        )

    def answer(self, answer: Answer, model: str, number: int) -> dict[str, Any]:
        """Returns the body that tells an answer."""
        refused = answer.ended == "refused"
        message: dict[str, Any] = {"role": "assistant", "content": None if refused else answer.text}
        if refused:
            message["refusal"] = answer.reason
        usage = answer.usage
        return {
            "id": f"chatcmpl-{number}",
            "object": "chat.completion",
            "created": int(time.time()),
            "model": model,
            "choices": [
                {
                    "index": 0,
                    "message": message,
                    "finish_reason": "length" if answer.ended == "truncated" else "stop",
                }
            ],
            "usage": {
                "prompt_tokens": usage.input_tokens,
                "completion_tokens": usage.output_tokens,
                "total_tokens": usage.input_tokens + usage.output_tokens,
                "prompt_tokens_details": {"cached_tokens": usage.cached_tokens},
                "completion_tokens_details": {"reasoning_tokens": usage.reasoning_tokens},
            },
        }

    def refusal(self, refusal: Refusal) -> dict[str, Any]:
        """Returns the body that tells why there is none."""
        status = STATUS[refusal.kind]
        return {
            "error": {
                "message": refusal.message,
                "type": "server_error" if status >= 500 else "invalid_request_error",
                "param": None,
                "code": _CODES.get(refusal.kind, refusal.kind),
            }
        }


def _parts(content: Any, place: str) -> tuple[str | ImagePart, ...]:
    if content is None or isinstance(content, str):
        return (content,) if content else ()
    if not isinstance(content, list):
        raise InputError(f"{place}: must be a text or a list of parts.")
    return tuple(_part(part, f"{place}[{number}]") for number, part in enumerate(content))


def _part(part: Any, place: str) -> str | ImagePart:
    kind = part.get("type") if isinstance(part, dict) else None
    if kind == "text" and isinstance(part.get("text"), str):
        return str(part["text"])
    if kind != "image_url":
        raise InputError(f"{place}: must be a part of type text or image_url.")
    image = part.get("image_url")
    fields: dict[str, Any] = image if isinstance(image, dict) else {"url": image}
    url, detail = fields.get("url"), fields.get("detail")
    head = _DATA_URL.match(url) if isinstance(url, str) else None
    if not isinstance(url, str) or head is None:
        raise InputError(
            f"{place}: pictures are not fetched here; send data:image/jpeg;base64,... instead."
        )
    known = _DETAIL.get(detail, "high") if isinstance(detail, str) else "high"
    return picture(url[head.end() :], place, known)
