"""What can go wrong between a question and its answer, one coroutine each, in both dialects.

The answers are constructed from the providers' documentation, not recorded.
"""

from __future__ import annotations

import asyncio
import functools
import gzip
import json
from typing import Any

from fault_server import COUNTS, USAGE, Exchange, Fault, answer

GROUND = {
    "target_desc": "white door",
    "box": [100, 200, 300, 400],
    "point": None,
    "confidence": 0.9,
    "reason": "it leads on",
}
DECIDE = {
    "progress_analysis": "In the hall.",
    "reasoning_todo": "The first item is done.",
    "todo_updates": [{"op": "update", "index": 1, "status": "completed", "result": "left it"}],
    "reasoning_action": "The door is on the left.",
    "action": {"tool": "turn", "direction": "left"},
    "scene": "a hall with two doors",
}
GOOD = json.dumps(GROUND)
MEBIBYTE = 2**20


def ground(**changes: Any) -> str:
    return json.dumps({**GROUND, **changes})


def decide(**changes: Any) -> str:
    return json.dumps({**DECIDE, **changes})


TEXTS = {
    # Name -> what the model writes.  Replies to `decide`, those about boxes to `ground`.
    "markdown_fence": f"```json\n{decide()}\n```",
    "prose_around": f"Sure, here it is:\n{decide()}\nI hope this helps.",
    "think_prefix": f"<think>left {{or}} right?</think>\n{decide()}",
    "malformed": decide()[:-20] + "}",
    "python_literal": decide().replace('"reasoning_todo": "', '"flag": True, "reasoning_todo": "'),
    "not_a_number": decide().replace('"index": 1', '"index": NaN'),
    "infinite_number": decide().replace('"index": 1', '"index": 1e999'),
    "wrong_types": decide(action="left", scene=["hall"]),
    "number_as_text": decide().replace('"index": 1', '"index": "1"'),
    "duplicate_keys": decide()[:-1] + ', "scene": "another"}',
    "unknown_index": decide().replace('"index": 1', '"index": 7'),
    "unknown_waypoint": decide(action={"tool": "backtrack", "waypoint": 99}),
    "deep_nesting": decide()[:-1] + f', "more": {"[" * 5000}{"]" * 5000}}}',
    "huge_integer": decide().replace('"index": 1', f'"index": {"9" * 10_000}'),
    "lone_surrogate": decide().replace("a hall", "a \\ud800 hall"),
    "box_far_outside": ground(box=[100, 200, 3000, 400]),
    "box_just_outside": ground(box=[100, 200, 1010, 400]),
    "swapped_corners": ground(box=[300, 400, 100, 200]),
    "three_numbers": ground(box=[100, 200, 300]),
}


def wire_fault(function: Fault) -> Fault:
    WIRE[function.__name__] = function
    return function


WIRE: dict[str, Fault] = {}


@wire_fault
async def good(exchange: Exchange) -> None:
    await exchange.text(GOOD)


@wire_fault
async def empty_text(exchange: Exchange) -> None:
    await exchange.text("")


@wire_fault
async def null_text(exchange: Exchange) -> None:
    await exchange.text(None)


@wire_fault
async def reasoning_only(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        await exchange.text("", reasoning_content="I think it is the door.")
    else:
        parts = [{"text": "I think it is the door.", "thought": True}]
        await exchange.text(None, parts=parts)


@wire_fault
async def truncated(exchange: Exchange) -> None:
    finish = {"openai": "length", "gemini": "MAX_TOKENS"}[exchange.dialect]
    await exchange.text(GOOD[:30], finish=finish)


@wire_fault
async def truncated_once(exchange: Exchange) -> None:
    await (truncated if exchange.n == 1 else good)(exchange)


@wire_fault
async def refusal(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        await exchange.text(None, refusal="I cannot help with that.")
    else:
        await exchange.text(None, finish="PROHIBITED_CONTENT")


@wire_fault
async def content_filter(exchange: Exchange) -> None:
    finish = {"openai": "content_filter", "gemini": "SAFETY"}[exchange.dialect]
    await exchange.text("", finish=finish)


@wire_fault
async def blocked_prompt(exchange: Exchange) -> None:
    if exchange.dialect == "openai":  # Qwen's way.
        words = "Input data may contain inappropriate content."
        await exchange.refuse(400, words, kind="data_inspection_failed")
    else:
        usage = {"promptTokenCount": 1000}
        blocked = {"promptFeedback": {"blockReason": "SAFETY"}, "usageMetadata": usage}
        await exchange.json(blocked)


@wire_fault
async def tool_call(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        call = {"id": "1", "type": "function", "function": {"name": "ground", "arguments": GOOD}}
        await exchange.text(None, tool_calls=[call], finish="tool_calls")
    else:
        await exchange.text(None, parts=[{"functionCall": {"name": "ground", "args": GROUND}}])


@wire_fault
async def no_choices(exchange: Exchange) -> None:
    empty: dict[str, Any] = {"choices": [], "candidates": []}
    await exchange.json({**empty, USAGE[exchange.dialect]: COUNTS[exchange.dialect]})


@wire_fault
async def error_in_200(exchange: Exchange) -> None:
    inner = {"code": 502, "message": "The provider returned an error.", "status": "INTERNAL"}
    await exchange.json({"error": inner})


async def _too_many(exchange: Exchange, seconds: int) -> None:
    words = "Too many requests."
    if exchange.dialect == "openai":
        headers = {"retry-after": str(seconds)}
        await exchange.refuse(429, words, kind="rate_limit_exceeded", headers=headers)
    else:
        info = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": f"{seconds}s"}
        await exchange.refuse(429, words, kind="RESOURCE_EXHAUSTED", details=[info])


@wire_fault
async def retry_after_1(exchange: Exchange) -> None:
    await (_too_many(exchange, 1) if exchange.n == 1 else good(exchange))


@wire_fault
async def retry_after_600(exchange: Exchange) -> None:
    await _too_many(exchange, 600)


@wire_fault
async def quota(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        await exchange.refuse(429, "You exceeded your quota.", kind="insufficient_quota")
    else:
        spent = {
            "@type": "type.googleapis.com/google.rpc.QuotaFailure",
            "violations": [{"quotaId": "GenerateRequestsPerDayPerProjectPerModel"}],
        }
        words = "You exceeded your current quota."
        await exchange.refuse(429, words, kind="RESOURCE_EXHAUSTED", details=[spent])


@wire_fault
async def error_500_once(exchange: Exchange) -> None:
    await (exchange.refuse(500, "Internal error.") if exchange.n == 1 else good(exchange))


@wire_fault
async def html_503(exchange: Exchange) -> None:
    page = b"<html><body><h1>503 Service Unavailable</h1></body></html>"
    await exchange.send(page, status=503, content_type="text/html")


@wire_fault
async def loading_503(exchange: Exchange) -> None:
    if exchange.n <= 5:  # More often than there are tries.
        await exchange.refuse(503, "Loading model", kind="unavailable_error")
    else:
        await good(exchange)


@wire_fault
async def context_400(exchange: Exchange) -> None:
    words = "The input token count (40960) exceeds the maximum number of tokens allowed (8192)."
    kind = {"openai": "exceed_context_size_error", "gemini": "INVALID_ARGUMENT"}[exchange.dialect]
    await exchange.refuse(400, words, kind=kind)


@wire_fault
async def error_401(exchange: Exchange) -> None:
    given = exchange.headers.get("x-goog-api-key") or exchange.headers.get("authorization", "none")
    # It echoes the key, as some gateways do, where a long message may be cut.
    await exchange.refuse(401, "Invalid key. " * 22 + given, headers={"x-echo": given})


@wire_fault
async def error_413(exchange: Exchange) -> None:
    await exchange.refuse(413, "Request entity too large.")


@wire_fault
async def error_404(exchange: Exchange) -> None:
    await exchange.refuse(404, "The model 'tiny' does not exist.", kind="model_not_found")


@wire_fault
async def reset(exchange: Exchange) -> None:
    await exchange.raw(b"HTTP/1.1 200 OK\r\ncontent-length: 1000\r\n\r\n" + GOOD[:20].encode())
    exchange.reset()


@wire_fault
async def reset_once(exchange: Exchange) -> None:
    await (reset if exchange.n == 1 else good)(exchange)


@wire_fault
async def cut_stream(exchange: Exchange) -> None:
    await exchange.raw(b'HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n4\r\n{"ch\r\n')
    exchange.writer.close()


@wire_fault
async def slow_drip(exchange: Exchange) -> None:
    body = json.dumps(answer(exchange.dialect, GOOD)).encode() + b" " * 1000
    await exchange.raw(f"HTTP/1.1 200 OK\r\ncontent-length: {len(body)}\r\n\r\n".encode())
    for byte in body:
        await exchange.raw(bytes([byte]))
        await asyncio.sleep(0.05)


@wire_fault
async def slow_headers(exchange: Exchange) -> None:
    await exchange.raw(b"HTTP/1.1 200 OK\r\n")
    for n in range(1000):
        await exchange.raw(f"x-{n}: 1\r\n".encode())
        await asyncio.sleep(0.05)


@wire_fault
async def hang(exchange: Exchange) -> None:
    await exchange.until_the_client_leaves()


@wire_fault
async def body_of_64_mib(exchange: Exchange) -> None:
    await exchange.raw(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n")
    for _ in range(64):
        await exchange.raw(b"100000\r\n" + bytes(MEBIBYTE) + b"\r\n")
    await exchange.raw(b"0\r\n\r\n")


@functools.lru_cache(maxsize=1)
def bomb() -> bytes:
    """One MiB that unfolds to one GiB: packed pieces may follow each other."""
    return gzip.compress(bytes(16 * MEBIBYTE)) * 64


@wire_fault
async def gzip_bomb(exchange: Exchange) -> None:
    await exchange.send(bomb(), headers={"content-encoding": "gzip"})


@wire_fault
async def gzip_body(exchange: Exchange) -> None:
    packed = gzip.compress(json.dumps(answer(exchange.dialect, GOOD)).encode())
    await exchange.send(packed, headers={"content-encoding": "gzip"})


@wire_fault
async def unknown_encoding(exchange: Exchange) -> None:
    await exchange.send(b"\x1b\x03", headers={"content-encoding": "br"})


@wire_fault
async def invalid_utf8(exchange: Exchange) -> None:
    body = json.dumps(answer(exchange.dialect, "caf")).encode()
    await exchange.send(body.replace(b"caf", b"caf\xe9"))


@wire_fault
async def no_json(exchange: Exchange) -> None:
    await exchange.send(b"OK")


@wire_fault
async def empty_body(exchange: Exchange) -> None:
    await exchange.send(b"")


@wire_fault
async def no_http(exchange: Exchange) -> None:
    await exchange.raw(b"220 mail.example.org ESMTP\r\n")
    exchange.writer.close()


@wire_fault
async def huge_headers(exchange: Exchange) -> None:
    await exchange.raw(b"HTTP/1.1 200 OK\r\n" + b"x-more: " + b"1" * MEBIBYTE + b"\r\n\r\n")


@wire_fault
async def redirect(exchange: Exchange) -> None:
    target = f"http://localhost:{exchange.port}/good/0"
    await exchange.send(b"", status=307, headers={"location": target})


@wire_fault
async def wrong_content_type(exchange: Exchange) -> None:
    body = json.dumps(answer(exchange.dialect, GOOD)).encode()
    await exchange.send(body, content_type="text/html; charset=latin-1")


@wire_fault
async def byte_order_mark(exchange: Exchange) -> None:
    await exchange.send(b"\xef\xbb\xbf" + json.dumps(answer(exchange.dialect, GOOD)).encode())


@wire_fault
async def body_nested_deeply(exchange: Exchange) -> None:
    await exchange.send(b'{"choices": ' + b"[" * 100_000 + b"]" * 100_000 + b"}")


@wire_fault
async def body_with_huge_integer(exchange: Exchange) -> None:
    body = json.dumps(answer(exchange.dialect, GOOD))
    await exchange.send(body.replace(": 1000", ": 1" + "0" * 10_000).encode())


@wire_fault
async def body_with_lone_surrogate(exchange: Exchange) -> None:
    # Half a pair in the server's own JSON, so in the text itself.
    await exchange.text(GOOD.replace("white", "wh\ud800ite"))


@wire_fault
async def unknown_finish(exchange: Exchange) -> None:
    await exchange.text(GOOD, finish="REACHED_NIRVANA")


@wire_fault
async def negative_usage(exchange: Exchange) -> None:
    counts = {name: -count for name, count in COUNTS[exchange.dialect].items()}
    await exchange.json({**answer(exchange.dialect, GOOD), USAGE[exchange.dialect]: counts})


@wire_fault
async def no_usage(exchange: Exchange) -> None:
    data = answer(exchange.dialect, GOOD)
    del data[USAGE[exchange.dialect]]
    await exchange.json(data)


@wire_fault
async def other_model(exchange: Exchange) -> None:
    name = {"openai": "model", "gemini": "modelVersion"}[exchange.dialect]
    await exchange.json({**answer(exchange.dialect, GOOD), name: "tiny-2026-11"})


@wire_fault
async def no_json_schema(exchange: Exchange) -> None:
    knows = "json_schema" not in str(exchange.body.get("response_format"))
    if knows and "responseJsonSchema" not in exchange.body.get("generationConfig", {}):
        await good(exchange)
    else:
        words = "response_format json_schema (response_schema) is not supported by this model."
        await exchange.refuse(400, words, kind="INVALID_ARGUMENT")


@wire_fault
async def no_structure(exchange: Exchange) -> None:
    await exchange.refuse(400, "response_format (response_schema) is not supported.")


@wire_fault
async def echo_key(exchange: Exchange) -> None:
    given = exchange.headers.get("x-goog-api-key") or exchange.headers["authorization"]
    await exchange.json(
        answer(exchange.dialect, ground(target_desc=given)), headers={"x-echo": given}
    )


@wire_fault
async def away_7_times(exchange: Exchange) -> None:
    await (reset if exchange.n <= 7 else good)(exchange)


@wire_fault
async def slow_seed(exchange: Exchange) -> None:
    await asyncio.sleep(0.3)
    seed = exchange.body.get("seed") or exchange.body.get("generationConfig", {}).get("seed")
    await exchange.text(ground(target_desc=f"door {seed}"))


def saying(text: str) -> Fault:
    async def say(exchange: Exchange) -> None:
        await exchange.text(text)

    return say


FAULTS: dict[str, Fault] = {**WIRE, **{name: saying(text) for name, text in TEXTS.items()}}
