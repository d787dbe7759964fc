"""An HTTP server on this machine's loopback address, with a model backend behind it."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import logging
import re
import threading
from collections.abc import Iterator, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote, urlsplit

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.address import is_loopback
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.serving.chat_format import ChatFormat
from unilavira_drake.serving.gemini_format import GeminiFormat
from unilavira_drake.serving.outcome import STATUS, Answer, Format, Refusal, outcome_of

DEFAULT_PORT = 8750
"""That of the profile ``served-rules``."""
MAX_BODY = 64_000_000
"""Largest body of a request, bytes."""
_DRAIN = 4 * MAX_BODY
"""How much of a refused body is read to its end."""
_IDLE = 60.0
"""Seconds after which a silent connection is closed."""
_CHAT = re.compile(r"(?:/v1)?/chat/completions")
_GEMINI = re.compile(r"/v1(?:beta|alpha)?/models/(?P<model>.+):generateContent")
_MODELS = re.compile(r"/v1(?:beta|alpha)?/models")

log = logging.getLogger(__name__)


class ModelServer:
    """Serves a backend in both wire formats on 127.0.0.1; any key is accepted and none is read.

    A body with the member ``unilavira_request`` is our own typed request and goes to the backend
    of its role.  Any other body becomes a free text for the language backend: sampling settings
    are the backend's own, and a schema is added to the text.  Only this machine can connect, and
    web pages opened here cannot: requests for or from another host name are refused.

    Args:
        backends: role, ``language`` and ``vision``, -> the model that answers for it.
        name: what the model is called.
        port: 0 chooses a free one.

    Raises:
        InputError: if the port cannot be had.
    """

    def __init__(
        self, backends: Mapping[str, Mllm], *, name: str, port: int = DEFAULT_PORT
    ) -> None:
        self.name = name
        self._backends = dict(backends)
        self._numbers = itertools.count(1)
        handler = type("_Handler", (_Handler,), {"model_server": self})
        try:
            self._http = _Http(("127.0.0.1", port), handler)
        except (OSError, OverflowError) as error:
            said = getattr(error, "strerror", None) or error
            raise InputError(f"port {port} cannot be had ({said}); 0 takes a free one.") from None

    @property
    def address(self) -> str:
        """Where it listens: the base address of the Gemini format."""
        return f"http://127.0.0.1:{self._http.server_address[1]}"

    @property
    def chat_address(self) -> str:
        """The base address of the OpenAI-compatible format."""
        return f"{self.address}/v1"

    def serve_forever(self) -> None:
        """Answers requests until :meth:`close` is called from another thread, or Ctrl-C."""
        self._http.serve_forever(poll_interval=0.05)

    def close(self) -> None:
        """Gives up calls under way and frees the port; ``serve_forever`` must have ended."""
        for backend in self._backends.values():
            backend.close()
        self._http.server_close()

    @contextlib.contextmanager
    def running(self) -> Iterator[ModelServer]:
        """Serves from a thread of its own as long as the ``with`` block lasts."""
        thread = threading.Thread(target=self.serve_forever, name="model-server", daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self._http.shutdown()
            self.close()
            thread.join()

    def reply(self, form: Format, body: bytes, model: str) -> tuple[int, dict[str, Any]]:
        """Returns the status and the body that answer a body."""
        number = next(self._numbers)
        outcome = self._outcome(form, body, number)
        if isinstance(outcome, Refusal):
            return STATUS[outcome.kind], form.refusal(outcome)
        return 200, form.answer(outcome, model or self.name, number)

    def _outcome(self, form: Format, body: bytes, number: int) -> Answer | Refusal:
        try:
            question = form.question(_object_of(body))
            request = question.request(number)
            backend = self._backends[request.role]
            if backend.perception != "ground_truth":
                request = dataclasses.replace(request, evidence=None)
            elif request.evidence is None:
                raise InputError(
                    f"{self.name} reasons on labels and reads typed requests only; they come from "
                    "a profile with 'peer: rules', e.g. --model served-rules."
                )
            completion = backend.complete(request)
            return Answer(completion.text, question.usage(completion))
        except Exception as error:
            outcome = outcome_of(error)
            if outcome is None:
                log.exception("a request ended in a bug")
                return Refusal("internal", f"the backend failed: {type(error).__name__}.")
            return outcome


class _Http(ThreadingHTTPServer):
    daemon_threads = True
    # A call may last minutes; whoever ends the server does not wait for it.
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Says nothing of clients that have gone."""
        log.debug("a client has gone", exc_info=True)


class _Handler(BaseHTTPRequestHandler):
    model_server: ModelServer
    protocol_version = "HTTP/1.1"
    server_version = "unilavira"
    sys_version = ""
    timeout = _IDLE

    def do_GET(self) -> None:
        path = urlsplit(self.path).path
        if not self._is_local():
            self._refuse(Refusal("forbidden", _FOREIGN))
        elif path == "/health":
            self._send(200, {"status": "ok"})
        elif _MODELS.fullmatch(path):
            name = self.model_server.name
            listed = {"id": name, "object": "model", "owned_by": "unilavira"}
            models = [{"name": f"models/{name}"}]
            self._send(200, {"object": "list", "data": [listed], "models": models})
        else:
            self._refuse(Refusal("not_found", f"there is no {path}."))

    def do_POST(self) -> None:
        path = unquote(urlsplit(self.path).path)
        gemini = _GEMINI.fullmatch(path)
        if not self._is_local():
            self._refuse(Refusal("forbidden", _FOREIGN))
            return
        if gemini is None and not _CHAT.fullmatch(path):
            self._refuse(Refusal("not_found", f"there is no {path}."))
            return
        body = self._body()
        if isinstance(body, Refusal):
            self._refuse(body)
            return
        form: Format = GeminiFormat() if gemini else ChatFormat()
        self._send(*self.model_server.reply(form, body, gemini["model"] if gemini else ""))

    def _is_local(self) -> bool:
        """Whether a request was meant for this machine, by something that runs on it.

        Any page in a browser can have it send requests here, also under a name of its own that
        leads here; both kinds name another host.
        """
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        try:
            return is_loopback(f"http://{host}") and (origin is None or is_loopback(origin))
        except ValueError:
            return False

    def _body(self) -> bytes | Refusal:
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch(r"[0-9]{1,18}", length):
            return Refusal("invalid", "a body with its Content-Length is needed.")
        if int(length) > MAX_BODY:
            return Refusal("too_large", f"the body has {length} bytes; the most is {MAX_BODY:,}.")
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            raise ConnectionAbortedError("the client has gone")
        return body

    def _refuse(self, refusal: Refusal) -> None:
        # What is left of the body would be read as the next request; a client that still sends
        # it would not read the answer.
        self.close_connection = True
        length = self.headers.get("Content-Length", "")
        left = min(int(length), _DRAIN) if re.fullmatch(r"[0-9]{1,18}", length) else 0
        while left > 0 and (piece := self.rfile.read(min(left, 65536))):
            left -= len(piece)
        form: Format = GeminiFormat() if "/models/" in self.path else ChatFormat()
        self._send(STATUS[refusal.kind], form.refusal(refusal))

    def _send(self, status: int, value: dict[str, Any]) -> None:
        data = json.dumps(value).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        with contextlib.suppress(ConnectionError, TimeoutError):
            self.wfile.write(data)

    def log_request(self, code: Any = "-", size: Any = "-") -> None:
        """Logs a request without its headers and its query, where keys may stand."""
        log.info("%s %s: %s", self.command, urlsplit(self.path).path, int(code))

    def log_message(self, format: str, *args: Any) -> None:
        """Logs what the base class complains about."""
        log.debug(format, *args)


_FOREIGN = "only this machine is served: Host and Origin must be 127.0.0.1 or localhost."


def _object_of(body: bytes) -> dict[str, Any]:
    try:
        value = json.loads(body)
    except (ValueError, RecursionError):
        raise InputError("the body is no JSON.") from None
    if not isinstance(value, dict):
        raise InputError("the body must be a JSON object.")
    return value
