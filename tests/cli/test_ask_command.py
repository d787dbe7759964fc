"""``unilavira ask``: the reply or the named error, against real servers on loopback."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from PIL import Image

from unilavira_drake.cli.ask import cost_line
from unilavira_drake.cli.main import main
from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmError,
    ReplyRefused,
    ReplyTruncated,
)
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import FreeVariables, MllmRequest
from unilavira_drake.serving import ModelServer

Served = Callable[["Listener"], str]
SECRET = "sk-0123456789abcdef"


class Listener:
    """A model that keeps what it is asked, and answers or raises what it was given."""

    name = "listener"
    perception = "images"
    reasoning = "model"
    description = "a test peer"
    box_space = "pixels"
    deadline = 30.0

    def __init__(self, answer: str | Exception = "Two doors.") -> None:
        self.answer = answer
        self.asked: list[MllmRequest] = []

    def complete(self, request: MllmRequest) -> Completion:
        """Answers any request."""
        self.asked.append(request)
        if isinstance(self.answer, Exception):
            raise self.answer
        return Completion(self.answer, Usage(7, 2))

    def close(self) -> None:
        """Does nothing."""


@pytest.fixture(autouse=True)
def _alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    for name in (*ROLE_KEYS.values(), SHARED_KEY):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(params=["openai", "gemini"])
def served(request: pytest.FixtureRequest) -> Iterator[Served]:
    """Puts a model behind a server and gives the spec of a profile for it."""
    with ExitStack() as stack:

        def serve(model: Listener) -> str:
            backends = {"language": model, "vision": model}
            server = stack.enter_context(ModelServer(backends, name="peer", port=0).running())
            url = server.chat_address if request.param == "openai" else server.address
            Path("peer.yaml").write_text(
                f"description: a peer\ndialect: {request.param}\nbase_url: {url}\nmodel: peer\n"
                "prices: {input: 1.0, output: 2.0, date: 2026-11}\n"
                "max_attempts: 1\noutage_patience: 60\n"
            )
            return "peer.yaml"

        yield serve


def test_the_reply_goes_to_stdout_and_its_cost_to_stderr(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    model = Listener()
    spec = served(model)
    assert main(["ask", "--model", spec, "--role", "language", "--text", "How many\ndoors?"]) == 0
    captured = capsys.readouterr()
    assert captured.out == "Two doors.\n"
    assert captured.err.startswith("peer: 7 tokens in, 2 out, $0.000011, ")
    assert captured.err.count("\n") == 1
    variables = model.asked[0].variables
    assert isinstance(variables, FreeVariables)
    assert variables.text == "How many\ndoors?"


def test_pictures_are_sent_in_their_order_and_jpeg_files_as_they_are(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    Image.new("RGB", (40, 30), "red").save("a.jpg", quality=40)
    Image.new("RGBA", (20, 10), (0, 0, 255, 255)).save("b.png")
    model = Listener()
    pictures = ["--image", "a.jpg", "--image", "b.png"]
    spec = served(model)
    assert main(["ask", "--model", spec, "--role", "vision", "--text", "Colours?", *pictures]) == 0
    first, second = (image.jpeg for image in model.asked[0].images)
    assert first == Path("a.jpg").read_bytes()
    assert second[:2] == b"\xff\xd8"
    assert "2 pictures" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "name"),
    [
        (ReplyRefused("not this"), "ReplyRefused"),
        (ReplyTruncated("too long"), "ReplyTruncated"),
        (ContextLengthError("too many tokens in the prompt"), "ContextLengthError"),
        (MllmAuthenticationError("bad key"), "MllmAuthenticationError"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_error_is_named(
    served: Served,
    error: Exception,
    name: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(SHARED_KEY, SECRET)
    assert main(["ask", "--model", served(Listener(error)), "--text", "Hello."]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    # The endpoint is named where it is at fault.
    where = "127.0.0.1:" if isinstance(error, MllmError) else ""
    assert captured.err.startswith(f"{name}: {where}")
    assert "Traceback" not in captured.err
    assert SECRET not in captured.err


def test_a_server_that_is_not_there_is_told_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    Path("away.yaml").write_text(
        "description: away\ndialect: openai\nbase_url: http://127.0.0.1:9/v1\nmodel: m\n"
        "max_attempts: 1\noutage_patience: 600\n"
    )
    assert main(["ask", "--model", "away.yaml", "--text", "Hello."]) == 3
    assert capsys.readouterr().err.startswith("MllmUnreachable: 127.0.0.1:9 refuses")


def test_a_missing_key_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ask", "--model", "gemini-3.1-pro", "--role", "vision", "--text", "Hello."]) == 3
    error = capsys.readouterr().err
    assert error.startswith("MllmAuthenticationError: ")
    assert "UNILAVIRA_VISION_API_KEY" in error


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "rules"], "'rules' answers the requests of an episode only"),
        (["--model", "random"], "ask a PROFILE"),
        (["--model", "frontier"], "mailbox:DIR"),
        (["--model", "served-rules"], "'served-rules' answers the requests of an episode only"),
        (["--model", "local-9"], "did you mean 'local-9b'"),
        (["--model", "local-9b", "--role", "vison"], "did you mean 'vision'"),
        (["--model", "local-9b", "--text", " "], "--text: is empty"),
        (["--model", "local-9b", "--image", "no.jpg"], "--image: 'no.jpg': no such file"),
        (["--model", "local-9b", "--image", "."], "--image: '.' cannot be read"),
        (["--model", "local-9b", "--image", "text.jpg"], "'text.jpg' is no picture"),
        (["--model", "local-9b", "--image", "cut.jpg"], "'cut.jpg' is a damaged picture"),
        ([], "--model"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_told(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("text.jpg").write_text("no picture")
    Image.new("RGB", (64, 64), "red").save("whole.jpg")
    Path("cut.jpg").write_bytes(Path("whole.jpg").read_bytes()[:-80])
    text = [] if "--text" in arguments else ["--text", "Hello."]
    assert main(["ask", *arguments, *text]) == 2
    captured = capsys.readouterr()
    assert words in " ".join(captured.err.split())
    assert captured.out == ""
    assert "Traceback" not in captured.err


def test_a_mailbox_answers_a_free_text(capsys: pytest.CaptureFixture[str]) -> None:
    def answer() -> None:
        place = Path("box") / "001-language-free"
        while not place.exists():
            threading.Event().wait(0.02)
        assert (place / "prompt.txt").read_text().endswith("Who is there?")
        (place / "reply.txt").write_text('{"a": "person"}')

    person = threading.Thread(target=answer)
    person.start()
    assert main(["ask", "--model", "mailbox:box", "--text", "Who is there?"]) == 0
    person.join()
    captured = capsys.readouterr()
    assert captured.out == '{"a": "person"}\n'
    assert captured.err.startswith("mailbox: tokens not counted, cost not known, ")


def test_an_interrupt_ends_the_wait() -> None:
    program = "import sys; from unilavira_drake.cli.main import main; sys.exit(main())"
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        spec = f"openai:m@http://127.0.0.1:{silent.getsockname()[1]}/v1"
        command = [sys.executable, "-c", program, "ask", "--model", spec, "--text", "Hello."]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            connection, _ = silent.accept()
            assert connection.recv(4) == b"POST"
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=20.0)
            while connection.recv(65536):  # Until the client has closed it.
                pass
            connection.close()
    assert process.returncode == 130
    assert (out, err) == (b"", b"")


def test_what_a_terminal_would_obey_is_shown_harmless(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], served: Served
) -> None:
    spec = served(Listener("\x1b[31mred\x07\n"))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert main(["ask", "--model", spec, "--text", "Hello."]) == 0
    assert capsys.readouterr().out == "\ufffd[31mred\ufffd\n"


def test_the_cost_line_says_what_is_hidden_and_what_is_not_known() -> None:
    usage = Usage(1200, 340, 4, None, 1000, 300)
    words = "1200 tokens in (1000 cached), 340 out (300 reasoning), 4 pictures, cost not known"
    assert cost_line(usage, 2.04, 2) == f"{words}, 2.0 s, 2 tries"
