"""``unilavira serve``: a model backend behind both wire formats, on this machine only."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import Annotated

import typer

from unilavira_drake.mllm.backends import make_backend, profile_of
from unilavira_drake.mllm.mailbox import MailboxModel
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.serving import DEFAULT_PORT, ModelServer
from unilavira_drake.serving.server import log


def serve(
    model: Annotated[
        str, typer.Option(help="The model to serve, e.g. rules or mailbox:DIR.", metavar="SPEC")
    ],
    port: Annotated[
        int, typer.Option(help="Where to listen; 0 takes a free port.", metavar="N")
    ] = DEFAULT_PORT,
) -> None:
    """Serves a model in the formats of OpenAI and Gemini, to programs of this machine.

    Ctrl-C ends it, with exit code 0.
    """
    backends = {
        role: make_backend(model, role=role, place="--model") for role in ("language", "vision")
    }
    server = ModelServer(backends, name=model, port=port)
    with _request_lines(), contextlib.closing(server), contextlib.suppress(KeyboardInterrupt):
        print(f"serving {model}: {backends['language'].description}; Ctrl-C ends it")
        print(f"OpenAI-compatible base URL: {server.chat_address}")
        print(f"Gemini base URL: {server.address}")
        talks = _answers_free_text(model, backends["language"])
        print(_hint(server.chat_address, talks, port == DEFAULT_PORT), flush=True)
        server.serve_forever()
    print("ended")


def _answers_free_text(spec: str, backend: Mllm) -> bool:
    """Whether it answers more than the requests of an episode."""
    profile = profile_of(spec, place="--model")
    if profile is not None:
        return profile.peer == "model"
    return isinstance(backend, MailboxModel)


def _hint(address: str, talks: bool, usual_port: bool) -> str:
    """Returns how to try it."""
    if talks:
        spec = f"openai:served@{address}"
        return f"in another terminal: unilavira ask --model {spec} --role language --text 'Hello.'"
    if usual_port:
        return "in another terminal: unilavira run --model served-rules"
    return (
        "it answers typed requests only: copy the profile served-rules, set its "
        f"base_url: {address}, and name the copy, e.g. unilavira run --model my.yaml"
    )


@contextlib.contextmanager
def _request_lines() -> Iterator[None]:
    """Shows one line for each request, on stderr."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    level = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
