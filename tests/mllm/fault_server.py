"""A model server on loopback that can do anything wrong: raw sockets, one thread, both dialects.

``base_url(fault)`` gives an address of its own for one test; what arrives there is counted and
kept.  What a fault does is a coroutine over an ``Exchange``, see ``wire_faults.py``.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import socket
import struct
import threading
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

USAGE = {"openai": "usage", "gemini": "usageMetadata"}
COUNTS = {
    "openai": {"prompt_tokens": 1000, "completion_tokens": 50, "total_tokens": 1050},
    "gemini": {"promptTokenCount": 1000, "candidatesTokenCount": 50, "totalTokenCount": 1050},
}


def answer(
    dialect: str, text: str | None, *, finish: str | None = None, **message: Any
) -> dict[str, Any]:
    """Returns the body of a successful answer; ``message`` are further fields beside the text."""
    if dialect == "openai":
        told = {"role": "assistant", "content": text, **message}
        choice = {"index": 0, "message": told, "finish_reason": finish or "stop"}
        return {"id": "1", "model": "tiny", "choices": [choice], "usage": COUNTS["openai"]}
    parts = [] if text is None else [{"text": text}]
    content = {"role": "model", "parts": parts, **message}
    candidate = {"content": content, "finishReason": finish or "STOP"}
    return {"candidates": [candidate], "usageMetadata": COUNTS["gemini"], "modelVersion": "tiny"}


def error(
    dialect: str, status: int, message: str, *, kind: str = "", details: Any = ()
) -> dict[str, Any]:
    """Returns the body of a refusal."""
    if dialect == "openai":
        return {"error": {"message": message, "type": kind, "code": kind or status}}
    return {"error": {"code": status, "message": message, "status": kind, "details": list(details)}}


@dataclass
class Visit:
    """What one address has seen."""

    posts: list[dict[str, Any]] = field(default_factory=list)
    """The JSON bodies."""
    headers: list[dict[str, str]] = field(default_factory=list)
    left: threading.Event = field(default_factory=threading.Event)
    """Set when a client has closed its connection while it was still owed an answer."""


@dataclass
class Exchange:
    """One request, and what a fault can do with it."""

    dialect: str
    n: int
    """Counts the requests at this address from 1."""
    headers: dict[str, str]
    body: dict[str, Any]
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    port: int
    left: threading.Event

    async def raw(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def send(
        self,
        body: bytes,
        *,
        status: int = 200,
        headers: dict[str, str] | None = None,
        content_type: str = "application/json",
    ) -> None:
        fields = {"content-type": content_type, "content-length": str(len(body)), **(headers or {})}
        lines = [f"HTTP/1.1 {status} Said", *(f"{name}: {text}" for name, text in fields.items())]
        await self.raw("\r\n".join([*lines, "", ""]).encode() + body)

    async def json(
        self, data: Any, *, status: int = 200, headers: dict[str, str] | None = None
    ) -> None:
        await self.send(json.dumps(data).encode(), status=status, headers=headers)

    async def text(self, text: str | None, **options: Any) -> None:
        await self.json(answer(self.dialect, text, **options))

    async def refuse(
        self, status: int, message: str, *, headers: dict[str, str] | None = None, **options: Any
    ) -> None:
        data = error(self.dialect, status, message, **options)
        await self.json(data, status=status, headers=headers)

    async def until_the_client_leaves(self) -> None:
        with contextlib.suppress(OSError):
            await self.reader.read()
        self.left.set()

    def reset(self) -> None:
        """Closes with a reset instead of a goodbye."""
        raw = self.writer.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.writer.transport.abort()


Fault = Callable[[Exchange], Awaitable[None]]


class FaultServer:
    """Use as a context manager."""

    def __init__(self, faults: dict[str, Fault]) -> None:
        self._faults = faults
        self._serial = itertools.count(1)
        self._visits: dict[str, Visit] = {}
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._connections: set[asyncio.Task[None]] = set()
        self.port = 0
        self.connections = 0

    def __enter__(self) -> FaultServer:
        self._thread.start()
        assert self._ready.wait(10)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)

    def base_url(self, fault: str) -> str:
        """Returns a fresh address behind which the fault waits."""
        assert fault in self._faults
        return f"http://127.0.0.1:{self.port}/{fault}/{next(self._serial)}"

    def visit(self, base_url: str) -> Visit:
        return self._visits.setdefault(base_url.split("/", 3)[3], Visit())

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._connected, "127.0.0.1", 0, limit=2**24)
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        await self._stop.wait()
        server.close()
        for task in list(self._connections):
            task.cancel()
        await asyncio.gather(*self._connections, return_exceptions=True)
        await server.wait_closed()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._connections.add(task)
        self.connections += 1
        try:
            while await self._exchange(reader, writer):
                pass
        except (OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
            pass
        finally:
            self._connections.discard(task)
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()

    async def _exchange(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        first = await reader.readexactly(1)
        if first == b"\x16":  # A client that wants TLS.
            writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            return False
        head = (first + await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        path = head[0].split()[1]
        if not path.startswith("/"):  # As a proxy is asked.
            path = "/" + path.split("/", 3)[3]
        headers = {
            name.lower(): text.strip()
            for name, _, text in (line.partition(":") for line in head[1:] if line)
        }
        body = await reader.readexactly(int(headers.get("content-length", 0)))
        fault, serial = path.split("/")[1:3]
        visit = self.visit(f"http://x/{fault}/{serial}")
        visit.posts.append(json.loads(body) if body else {})
        visit.headers.append(headers)
        dialect = "openai" if path.endswith("/chat/completions") else "gemini"
        await self._faults[fault](
            Exchange(
                dialect,
                len(visit.posts),
                headers,
                visit.posts[-1],
                reader,
                writer,
                self.port,
                visit.left,
            )
        )
        return not writer.is_closing()


@contextlib.contextmanager
def a_free_port() -> Iterator[int]:
    """Gives a port at which nobody listens."""
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        yield holder.getsockname()[1]
