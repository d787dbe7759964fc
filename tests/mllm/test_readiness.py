"""What is told of an endpoint before it is asked: a missing key, an address without a server."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from fault_server import a_free_port
from tiny_model import profile_of

from unilavira_drake.errors import MllmAuthenticationError, MllmUnreachable
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.readiness import check_ready


@pytest.fixture(autouse=True)
def _no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*ROLE_KEYS.values(), SHARED_KEY):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_nothing_is_sent_to_a_server_that_listens(listener: socket.socket) -> None:
    port = listener.getsockname()[1]
    check_ready(profile_of("openai", f"http://127.0.0.1:{port}/v1"), role="language")
    listener.settimeout(5.0)
    connection, _ = listener.accept()
    with connection:
        assert connection.recv(1) == b""


def test_an_address_where_nobody_listens() -> None:
    with a_free_port() as port:
        profile = profile_of("openai", f"http://127.0.0.1:{port}/v1", outage_patience=600.0)
        with pytest.raises(MllmUnreachable, match=rf"^127\.0\.0\.1:{port} refuses the connection"):
            check_ready(profile, role="vision")


@pytest.mark.parametrize("role", ROLE_KEYS)
def test_a_key_that_is_missing_is_told_without_a_connection(
    role: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def connected(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(socket, "create_connection", connected)
    profile = profile_of("gemini", "https://model.invalid/v1beta")
    with pytest.raises(MllmAuthenticationError, match=f"set {ROLE_KEYS[role]} or {SHARED_KEY}"):
        check_ready(profile, role=role)


@pytest.mark.parametrize(
    "error", [socket.gaierror(socket.EAI_AGAIN, "again"), TimeoutError(), UnicodeError()]
)
def test_what_may_be_there_in_a_moment_is_left_to_the_calls(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(socket, "create_connection", fails)
    check_ready(profile_of("openai", "http://model.invalid:8080/v1"), role="language")


def test_behind_a_proxy_nothing_is_certain(monkeypatch: pytest.MonkeyPatch) -> None:
    with a_free_port() as port:
        monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{port}")
        check_ready(profile_of("openai", "http://model.invalid/v1"), role="language")
