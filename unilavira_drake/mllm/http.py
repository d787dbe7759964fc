"""All HTTP of the model layer: one event loop in a daemon thread, and strict limits.

A request ends at its deadline whatever the server does (a read time-out alone lets a server that
sends one byte a second live for ever); a body is unpacked only as far as it is allowed to grow;
redirects are not followed and cookies not kept, so a key goes nowhere but to its own address.
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import logging
import os
import socket
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from http.cookiejar import CookieJar, DefaultCookiePolicy
from typing import Any
from urllib.parse import urlsplit

import anyio
import httpx

from unilavira_drake.errors import MllmError, MllmTimeout, MllmUnreachable
from unilavira_drake.messages import Message
from unilavira_drake.mllm.address import host_of
from unilavira_drake.mllm.http_route import failure_of, proxy_of
from unilavira_drake.mllm.unpacking import BodyError, Unpacker
from unilavira_drake.mllm.wire import WireFailure

_CLOSING_TIME = 2.0
"""Seconds that closing waits for the loop's thread."""
_SOCKET_OPTIONS = [(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)] + [
    # A model may think for minutes without a byte: without probes, routers on the way forget the
    # connection and its reply is lost.
    (socket.IPPROTO_TCP, getattr(socket, name), value)
    for name, value in (("TCP_KEEPIDLE", 20), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 4))
    if hasattr(socket, name)
]


@dataclass(frozen=True)
class HttpResponse(Message):
    """An answer, whatever its status."""

    status: int = 0
    headers: Mapping[str, str] = field(default_factory=dict)
    """Names in lower case."""
    body: bytes = b""
    """Unpacked."""


@dataclass(frozen=True)
class HttpLimits(Message):
    """How long and how large an exchange may be; seconds and bytes."""

    deadline: float = 60.0
    """From the call to the last byte."""
    connect_timeout: float = 10.0
    max_bytes: int = 8_000_000
    """Of the body, unpacked."""


class HttpClient:
    """Exchanges from any thread, all on one event loop; connections are kept for the next one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._closed = False
        self._clients: dict[str | None, httpx.AsyncClient] = {}

    def submit(
        self,
        method: str,
        url: str,
        *,
        headers: Mapping[str, str],
        body: bytes = b"",
        limits: HttpLimits = HttpLimits(),
    ) -> Future[HttpResponse | WireFailure]:
        """Starts an exchange; cancelling the future closes its connection.

        The future holds the answer, or in its place the failure that left none.

        Raises:
            MllmError: if the client is closed.
        """
        exchange = self._exchange(method, url, headers, body, limits)
        try:
            with self._lock:
                return asyncio.run_coroutine_threadsafe(exchange, self._running_loop())
        except BaseException:
            exchange.close()
            raise

    def post(
        self,
        url: str,
        *,
        headers: Mapping[str, str],
        body: bytes,
        limits: HttpLimits = HttpLimits(),
    ) -> HttpResponse:
        """Sends a body and returns the answer.

        Raises:
            MllmTimeout: if the answer is not complete at the deadline.
            MllmUnreachable: if no complete answer can be had: no such host, no connection, no
                TLS, a reset, no HTTP, a larger body than allowed.
        """
        return _raised(self.submit("POST", url, headers=headers, body=body, limits=limits))

    def get(
        self, url: str, *, headers: Mapping[str, str], limits: HttpLimits = HttpLimits()
    ) -> HttpResponse:
        """Returns the answer to a GET; raises as :meth:`post`."""
        return _raised(self.submit("GET", url, headers=headers, limits=limits))

    def close(self) -> None:
        """Breaks off what is under way, closes all connections and ends the thread."""
        with self._lock:
            self._closed = True
            loop, thread = self._loop, self._thread
            self._loop = self._thread = None
        if loop is not None and thread is not None:
            with contextlib.suppress(RuntimeError):  # The loop has ended with its thread.
                loop.call_soon_threadsafe(loop.stop)
            thread.join(_CLOSING_TIME)

    def _running_loop(self) -> asyncio.AbstractEventLoop:
        if self._closed:
            raise MllmError("the HTTP client is closed.")
        if self._loop is None:
            self._loop = _Loop()
            self._thread = threading.Thread(
                target=self._run, args=(self._loop,), name="mllm-http", daemon=True
            )
            self._thread.start()
        return self._loop

    def _run(self, loop: asyncio.AbstractEventLoop) -> None:
        try:
            loop.run_forever()
        finally:
            loop.run_until_complete(self._break_off())
            loop.run_until_complete(loop.shutdown_asyncgens())
            loop.close()

    async def _break_off(self) -> None:
        exchanges = asyncio.all_tasks() - {asyncio.current_task()}
        for exchange in exchanges:
            exchange.cancel()
        await asyncio.gather(*exchanges, return_exceptions=True)
        for client in self._clients.values():
            await client.aclose()

    async def _exchange(
        self, method: str, url: str, headers: Mapping[str, str], body: bytes, limits: HttpLimits
    ) -> HttpResponse | WireFailure:
        try:
            with anyio.fail_after(limits.deadline):
                return await self._receive(method, url, headers, body, limits)
        except TimeoutError:
            return WireFailure(
                MllmTimeout,
                f"{host_of(url)} gave no complete answer within {limits.deadline:.3g} s.",
                retryable=True,
            )
        except BodyError as error:
            return WireFailure(MllmUnreachable, f"{host_of(url)}: {error}", error.retryable)
        # An ImportError is a SOCKS proxy without its package; the others are malformed addresses.
        except (httpx.HTTPError, httpx.InvalidURL, ImportError, OSError, ValueError) as error:
            return failure_of(error, url, limits.connect_timeout)

    async def _receive(
        self, method: str, url: str, headers: Mapping[str, str], body: bytes, limits: HttpLimits
    ) -> HttpResponse:
        _ = urlsplit(url).port  # A ValueError if there is no such port.
        # In HTTPX these are limits between two bytes; the total is the caller's.
        timeout = httpx.Timeout(None, connect=limits.connect_timeout)
        asked = {"accept": "application/json", "accept-encoding": "gzip, deflate", **headers}
        client = self._client(proxy_of(url))
        async with client.stream(
            method, url, headers=asked, content=body, timeout=timeout
        ) as response:
            unpacker = Unpacker(response.headers.get("content-encoding", ""), limits.max_bytes)
            unpacker.announce(response.headers.get("content-length", ""))
            async for chunk in response.aiter_raw():
                unpacker.feed(chunk)
            return HttpResponse(response.status_code, dict(response.headers), unpacker.finish())

    def _client(self, proxy: str | None) -> httpx.AsyncClient:
        """Returns the client for a proxy or none; called on the loop only."""
        if proxy not in self._clients:
            endless = httpx.Limits(max_connections=None, keepalive_expiry=30.0)
            self._clients[proxy] = httpx.AsyncClient(
                transport=httpx.AsyncHTTPTransport(
                    limits=endless, proxy=proxy, socket_options=_SOCKET_OPTIONS
                ),
                follow_redirects=False,
                cookies=CookieJar(DefaultCookiePolicy(allowed_domains=[])),
                trust_env=False,
            )
        return self._clients[proxy]


class _Loop(asyncio.SelectorEventLoop):
    """Looks names up in daemon threads: a resolver that hangs must not hold up the exit."""

    async def getaddrinfo(self, host: Any, port: Any, **options: int) -> Any:
        found: asyncio.Future[Any] = self.create_future()

        def settle(answer: Any, error: Exception | None) -> None:
            if found.done():
                return
            if error is not None:
                found.set_exception(error)
            else:
                found.set_result(answer)

        def resolve() -> None:
            answer, error = None, None
            try:
                answer = socket.getaddrinfo(host, port, **options)
            except OSError as raised:
                error = raised
            except UnicodeError:  # Empty, or too long for a name.
                error = socket.gaierror(socket.EAI_NONAME, "no host name")
            with contextlib.suppress(RuntimeError):  # The loop has been closed meanwhile.
                self.call_soon_threadsafe(settle, answer, error)

        threading.Thread(target=resolve, name="mllm-dns", daemon=True).start()
        return await found


def _hide_headers(record: logging.LogRecord) -> bool:
    """Takes header values out of HTTPCore's debug messages: a server may echo a key in them."""
    text = record.getMessage()
    if "response_headers.complete" in text:
        record.msg, record.args = text.partition("[")[0] + "headers not shown", ()
    return True


for _name in ("http11", "http2", "proxy"):
    logging.getLogger(f"httpcore.{_name}").addFilter(_hide_headers)


def _raised(exchange: Future[HttpResponse | WireFailure]) -> HttpResponse:
    try:
        outcome = exchange.result()
    except BaseException:
        exchange.cancel()
        raise
    if isinstance(outcome, WireFailure):
        raise outcome.error(outcome.message)
    return outcome


_shared_lock = threading.Lock()
_shared: HttpClient | None = None


def shared_client() -> HttpClient:
    """Returns the client that all models of this process share; it is closed at exit."""
    global _shared
    with _shared_lock:
        if _shared is None:
            _shared = HttpClient()
            atexit.register(_shared.close)
        return _shared


def _forget_shared() -> None:
    """In a forked child, which has no thread to run the parent's loop."""
    global _shared, _shared_lock
    if _shared is not None:
        atexit.unregister(_shared.close)
    _shared, _shared_lock = None, threading.Lock()


os.register_at_fork(after_in_child=_forget_shared)
