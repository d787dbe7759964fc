"""What the server refuses, and what no client can do to it."""

from __future__ import annotations

import base64
import io
import socket
import threading
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from PIL import Image
from scripted_backend import Scripted, jpeg, serving

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.request import FreeVariables, MllmRequest
from unilavira_drake.serving import ModelServer
from unilavira_drake.serving import server as server_module

PATHS = {"gemini": "/v1beta/models/m:generateContent", "openai": "/v1/chat/completions"}
PNG = base64.b64encode(jpeg("blue", "PNG")).decode()


def say(client: httpx.Client, server: ModelServer, **more: Any) -> httpx.Response:
    body = {"messages": [{"role": "user", "content": "Hello."}]}
    return client.post(server.address + PATHS["openai"], json=body, **more)


@pytest.mark.parametrize("dialect", PATHS)
@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"\xff", b"[" * 100_000, b"{}", b'{"contents": [], "messages": []}',
     b'{"contents": [3], "messages": [3]}',
     b'{"contents": [{"parts": [3]}], "messages": [{"content": [3]}]}',
     b'{"contents": [{"parts": [{"inlineData": {"data": "?"}}]}], "messages": [{"content": '
     b'[{"type": "image_url", "image_url": {"url": "data:image/png;base64,?"}}]}]}',
     b'{"contents": [{"parts": [{"fileData": {}}]}], "messages": [{"content": '
     b'[{"type": "image_url", "image_url": {"url": "https://example.com/a.png"}}]}]}',
     b'{"contents": [{"parts": []}], "messages": [{"content": ""}]}',
     b'{"contents": [{"parts": []}], "messages": [{}], "unilavira_request": 3}'],
)  # fmt: skip
def test_wrong_bodies_are_told_in_the_clients_format(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], dialect: str, body: bytes
) -> None:
    backend, server = echo
    answer = client.post(server.address + PATHS[dialect], content=body)
    assert answer.status_code == 400
    error = answer.json()["error"]
    assert error["message"]
    assert error["code"] == (400 if dialect == "gemini" else "invalid_request")
    assert not backend.asked


def test_pictures_of_other_kinds_and_several_turns(
    client: httpx.Client, echo: tuple[Scripted, ModelServer]
) -> None:
    backend, server = echo
    image = {"type": "image_url", "image_url": {"url": f"data:image/png;base64,{PNG}"}}
    messages = [
        {"role": "system", "content": "Be brief."},
        {"role": "user", "content": "Hello."},
        {"role": "assistant", "content": None},
        {"role": "user", "content": [{"type": "text", "text": "And this?"}, image]},
    ]
    url = server.chat_address + "/chat/completions"
    answer = client.post(url, json={"messages": messages})
    assert answer.json()["choices"][0]["message"]["content"] == '{"said": 1}'
    asked = backend.asked[0]
    assert asked.variables == FreeVariables(
        "Be brief.\n\nuser: Hello.\n\nassistant: \n\nuser: And this?\n[picture 1]"
    )
    with Image.open(io.BytesIO(asked.images[0].jpeg)) as shown:
        assert (shown.format, shown.size) == ("JPEG", (64, 48))
    streamed = client.post(url, json={"messages": messages, "stream": True})
    assert streamed.status_code == 400
    assert "streamed" in streamed.json()["error"]["message"]


def test_what_can_be_read(client: httpx.Client, echo: tuple[Scripted, ModelServer]) -> None:
    _, server = echo
    assert client.get(server.address + "/health").json() == {"status": "ok"}
    models = client.get(server.chat_address + "/models").json()
    assert models["data"][0]["id"] == "served"
    assert client.get(server.address + "/v1beta/models").json()["models"][0]["name"]
    for answer in (
        client.get(server.address + "/"),
        client.post(server.address + "/v1/embeddings", json={}),
    ):
        assert answer.status_code == 404
        assert answer.json()["error"]["code"] == "not_found"
    assert client.delete(server.address + "/v1/models").status_code == 501


def test_too_large_a_body_is_refused(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    backend, server = echo
    monkeypatch.setattr(server_module, "MAX_BODY", 1000)
    answer = client.post(server.address + PATHS["openai"], content=b" " * 3_000_000)
    assert answer.status_code == 413
    assert answer.json()["error"]["code"] == "too_large"

    def chunks() -> Iterator[bytes]:
        yield b"{}"

    answer = client.post(server.address + PATHS["openai"], content=chunks())
    assert answer.status_code == 400
    assert "Content-Length" in answer.json()["error"]["message"]
    assert not backend.asked


@pytest.mark.parametrize(
    "headers",
    [{"Host": "example.com"}, {"Host": "["}, {"Origin": "https://example.com"}, {"Origin": "null"}],
)
def test_web_pages_cannot_ask(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], headers: dict[str, str]
) -> None:
    backend, server = echo
    assert say(client, server, headers=headers).status_code == 403
    assert client.get(server.address + "/health", headers=headers).status_code == 403
    assert not backend.asked
    assert say(client, server, headers={"Origin": "http://localhost:3000"}).is_success


def test_calls_do_not_wait_for_each_other(client: httpx.Client) -> None:
    meeting = threading.Barrier(2, timeout=10.0)

    def act(request: MllmRequest) -> str:
        meeting.wait()
        return "met"

    with serving(Scripted(act)) as server:
        replies: list[Any] = []
        other = threading.Thread(target=lambda: replies.append(say(client, server)))
        other.start()
        replies.append(say(client, server))
        other.join()
    assert [reply.status_code for reply in replies] == [200, 200]


def test_a_client_that_leaves_does_no_harm(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], capfd: pytest.CaptureFixture[str]
) -> None:
    _, server = echo
    port = int(server.address.rpartition(":")[2])
    for data in (b"", b"nonsense\r\n\r\n", b"POST /v1/chat/completions HTTP/1.1\r\n"
                 b"Host: localhost\r\nContent-Length: 99\r\n\r\nhalf"):  # fmt: skip
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as connection:
            connection.sendall(data)
    assert say(client, server).is_success
    assert "Traceback" not in capfd.readouterr().err


def test_the_backends_are_closed_and_the_port_is_freed(client: httpx.Client) -> None:
    backend = Scripted(lambda request: "x")
    with serving(backend) as server:
        port = int(server.address.rpartition(":")[2])
        with pytest.raises(InputError, match=f"port {port} cannot be had"):
            ModelServer({}, name="second", port=port)
    assert backend.closed
    with ModelServer({}, name="next", port=port).running() as following:
        assert client.get(following.address + "/health").is_success


def test_only_this_machine_can_connect(echo: tuple[Scripted, ModelServer]) -> None:
    assert echo[1]._http.server_address[0] == "127.0.0.1"
