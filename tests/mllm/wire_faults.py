"""What can go wrong between a question and its answer, one coroutine each, in both dialects.

The answers are constructed from the providers' documentation, not recorded.
"""

from __future__ import annotations

import asyncio
import functools
import gzip
import json

from fault_server import Exchange, Fault, answer
from reply_faults import GOOD, REPLY_FAULTS, good, ground

MEBIBYTE = 2**20
FAULTS: dict[str, Fault] = {**REPLY_FAULTS}


def wire_fault(function: Fault) -> Fault:
    FAULTS[function.__name__] = function
    return function


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
async def echo_key(exchange: Exchange) -> None:
    given = exchange.headers.get("x-goog-api-key") or exchange.headers["authorization"]
    body = json.dumps(answer(exchange.dialect, ground(target_desc=given)))
    # As PHP writes JSON.
    await exchange.send(body.replace("/", "\\/").encode(), headers={"x-echo": given})


@wire_fault
async def away_7_times(exchange: Exchange) -> None:
    await (reset if exchange.n <= 7 else good)(exchange)


@wire_fault
async def hang_twice(exchange: Exchange) -> None:
    await (hang if exchange.n <= 2 else good)(exchange)
