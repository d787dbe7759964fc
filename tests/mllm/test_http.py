"""The HTTP client by itself: limits, connections, proxies, and the unpacking of bodies."""

from __future__ import annotations

import gzip
import json
import socket
import threading
import time
import tracemalloc
import zlib
from collections.abc import Iterator

import pytest
from fault_server import Exchange, FaultServer
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_faults import bomb

from unilavira_drake.errors import MllmError, MllmTimeout, MllmUnreachable
from unilavira_drake.mllm.http import HttpClient, HttpLimits
from unilavira_drake.mllm.http_route import proxy_of
from unilavira_drake.mllm.unpacking import BodyError, Unpacker

PATH = "/chat/completions"


async def echo(exchange: Exchange) -> None:
    await exchange.json({"headers": exchange.headers}, headers={"set-cookie": "a=b; path=/"})


async def last(exchange: Exchange) -> None:
    await exchange.send(b"{}")
    exchange.writer.close()


async def hang(exchange: Exchange) -> None:
    await exchange.until_the_client_leaves()


@pytest.fixture(scope="module")
def server() -> Iterator[FaultServer]:
    with FaultServer({"echo": echo, "last": last, "hang": hang}) as running:
        yield running


@pytest.fixture
def http() -> Iterator[HttpClient]:
    client = HttpClient()
    yield client
    client.close()


def test_an_answer_comes_as_it_is(server: FaultServer, http: HttpClient) -> None:
    url = server.base_url("echo") + PATH
    sent = {"content-type": "application/json", "x-key": "1"}
    answer = http.post(url, headers=sent, body=b'{"a": 1}')
    assert (answer.status, answer.headers["content-type"]) == (200, "application/json")
    headers = json.loads(answer.body)["headers"]
    assert headers["x-key"] == "1"
    assert headers["accept-encoding"] == "gzip, deflate"
    assert server.visit(url[: -len(PATH)]).posts == [{"a": 1}]
    assert http.get(url, headers={}).status == 200


def test_connections_are_kept_and_cookies_are_not(server: FaultServer, http: HttpClient) -> None:
    before = server.connections
    url = server.base_url("echo") + PATH
    for _ in range(3):
        answer = http.post(url, headers={}, body=b"{}")
        assert "cookie" not in json.loads(answer.body)["headers"]
    assert server.connections == before + 1


def test_a_connection_that_the_server_has_closed_is_replaced(
    server: FaultServer, http: HttpClient
) -> None:
    url = server.base_url("last") + PATH
    for _ in range(3):
        assert http.post(url, headers={}, body=b"{}").status == 200
        time.sleep(0.02)


def test_the_deadline_is_for_everything(server: FaultServer, http: HttpClient) -> None:
    begin = time.monotonic()
    with pytest.raises(MllmTimeout, match=r"127.0.0.1:\d+ gave no complete answer within 0.2 s"):
        http.post(
            server.base_url("hang") + PATH, headers={}, body=b"{}", limits=HttpLimits(deadline=0.2)
        )
    assert 0.2 <= time.monotonic() - begin < 1.0


def test_a_resolver_that_hangs_does_not_hold_up_the_call(
    http: HttpClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    freed = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: freed.wait(30.0))
    begin = time.monotonic()
    with pytest.raises(MllmTimeout):
        http.post("http://far.invalid/", headers={}, body=b"", limits=HttpLimits(deadline=0.2))
    http.close()
    assert time.monotonic() - begin < 1.5
    freed.set()


def test_closing_breaks_off_what_is_under_way(server: FaultServer, http: HttpClient) -> None:
    base_url = server.base_url("hang")
    exchange = http.submit("POST", base_url + PATH, headers={}, body=b"{}")
    while not server.visit(base_url).posts:
        time.sleep(0.01)
    thread = http._thread
    assert thread is not None
    http.close()
    assert exchange.cancelled()
    assert server.visit(base_url).left.wait(2.0)
    assert not thread.is_alive()
    with pytest.raises(MllmError, match="closed"):
        http.post(base_url + PATH, headers={}, body=b"{}")
    http.close()


def test_a_name_that_is_none_is_not_found(http: HttpClient) -> None:
    with pytest.raises(MllmUnreachable, match="cannot be resolved"):
        http.post(f"http://{'a' * 70}.invalid/", headers={}, body=b"")


@pytest.mark.parametrize(
    ("url", "headers"),
    [
        ("ftp://127.0.0.1/", {}),
        ("no address", {}),
        ("http://127.0.0.1:99999/", {}),
        ("http://127.0.0.1:1/", {"x-key": "secret\nx"}),
        ("http://127.0.0.1:1/", {"x-key": "secret\u2028"}),
    ],
)
def test_what_cannot_be_asked_is_named(url: str, headers: dict[str, str], http: HttpClient) -> None:
    with pytest.raises(MllmUnreachable) as caught:
        http.post(url, headers=headers, body=b"{}")
    assert "secret" not in repr(caught.value)


def test_a_proxy_is_for_other_machines_only(
    server: FaultServer, http: HttpClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("http_proxy", "https_proxy", "all_proxy", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{server.port}")
    monkeypatch.setenv("all_proxy", "socks5://127.0.0.1:1")
    monkeypatch.setenv("no_proxy", "near.example")
    assert proxy_of("http://127.0.0.1:8080/v1") is None
    assert proxy_of("http://localhost/v1") is None
    assert proxy_of("http://near.example/v1") is None
    assert proxy_of("https://far.example/v1") == "socks5://127.0.0.1:1"
    path = server.base_url("echo").partition(str(server.port))[2]
    assert http.post(f"http://far.example{path}{PATH}", headers={}, body=b"{}").status == 200
    with pytest.raises(MllmUnreachable, match="socksio"):
        http.post("https://far.example/v1", headers={}, body=b"{}")


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    body=st.binary(max_size=3000),
    encoding=st.sampled_from(["", "identity", "GZIP", "x-gzip", "deflate", "bare", "two"]),
    step=st.integers(1, 700),
)
def test_unpacking_undoes_packing_in_any_pieces(body: bytes, encoding: str, step: int) -> None:
    bare = zlib.compressobj(wbits=-15)
    packed = {
        "": body,
        "identity": body,
        "deflate": zlib.compress(body),
        "bare": bare.compress(body) + bare.flush(),
        "two": gzip.compress(body[:100]) + gzip.compress(body[100:]),
    }.get(encoding, gzip.compress(body))
    name = {"bare": "deflate", "two": "gzip"}.get(encoding, encoding)
    unpacker = Unpacker(name, len(body))
    for start in range(0, len(packed), step):
        unpacker.feed(packed[start : start + step])
    assert unpacker.finish() == body


def test_a_bomb_never_unfolds() -> None:
    packed = bomb()
    tracemalloc.start()
    unpacker = Unpacker("gzip", 100_000)
    with pytest.raises(BodyError, match="more than 100000 bytes") as caught:
        unpacker.feed(packed)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * 2**20
    assert not caught.value.retryable


def test_bodies_that_cannot_be_read() -> None:
    with pytest.raises(BodyError, match="'zstd'"):
        Unpacker("zstd", 10)
    with pytest.raises(BodyError, match="more than 10 bytes"):
        Unpacker("", 10).announce("11")
    with pytest.raises(BodyError, match="more than 10 bytes"):
        Unpacker("", 10).announce("9" * 5000)
    with pytest.raises(BodyError, match="damaged"):
        Unpacker("gzip", 10).feed(b"no gzip at all")
    half = Unpacker("gzip", 1000)
    half.feed(gzip.compress(b"text" * 100)[:-9])
    with pytest.raises(BodyError, match="cut off"):
        half.finish()
