"""``unilavira ask``: one text and some pictures to one model."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from unilavira_drake.errors import InputError, MllmError, ReplyFormatError, unknown_name
from unilavira_drake.mllm.backends import make_backend, profile_of
from unilavira_drake.mllm.mailbox import MailboxModel
from unilavira_drake.mllm.picture_files import read_picture
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Mllm, Usage
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.mllm.usage import paid

ROLES = ("language", "vision")
NO_REPLY, INTERRUPTED = 3, 130


def ask(
    model: Annotated[str, typer.Option(help="The model.", metavar="SPEC")],
    text: Annotated[str, typer.Option(help="What to ask, sent word for word.", metavar="TEXT")],
    role: Annotated[
        str,
        typer.Option(help="Whose key, settings and deadline count.", metavar="language|vision"),
    ] = "language",
    image: Annotated[
        list[Path] | None,
        typer.Option(help="A picture, sent before the text; may be repeated.", metavar="FILE"),
    ] = None,
) -> None:
    """Asks a model one thing: the reply on stdout, its cost on stderr.

    No episode, no prompt of ours, and the reply is shown as it is.  Exit code 3 with the error's
    name if no reply can be had, or if the model refused or was cut off.
    """
    if role not in ROLES:
        raise InputError(unknown_name("role", role, ROLES, "--role"))
    if not text.strip():
        raise InputError("--text: is empty; say what to ask.")
    backend = _backend(model, role)
    request = MllmRequest(
        role=role, n=1, call="free", variables=FreeVariables(text), images=_pictures(image or ())
    )
    began = time.monotonic()
    try:
        completion = backend.complete(request)
    except (MllmError, ReplyFormatError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        _print_cost(backend, paid(error.attempts), time.monotonic() - began, len(error.attempts))
        raise typer.Exit(NO_REPLY) from None
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    finally:
        backend.close()
    print(_printable(completion.text))
    seconds = completion.latency if completion.latency is not None else time.monotonic() - began
    _print_cost(backend, completion.usage, seconds, len(completion.attempts))


def _backend(spec: str, role: str) -> Mllm:
    profile = profile_of(spec, place="--model")
    if profile is not None and profile.peer != "rules":
        # Whoever sits here is told at once that the endpoint is away.
        return RemoteModel(profile.model_copy(update={"outage_patience": 0.0}), role=role)
    backend = make_backend(spec, role=role, place="--model")
    if isinstance(backend, MailboxModel):
        return backend
    raise InputError(
        f"--model: {spec!r} answers the requests of an episode only, no free text; "
        "ask a PROFILE, PROFILE.yaml, openai:MODEL@BASE_URL or mailbox:DIR."
    )


def _pictures(files: Iterable[Path]) -> tuple[ImagePart, ...]:
    parts = []
    for file in files:
        try:
            parts.append(ImagePart(file.name, read_picture(file)))
        except InputError as error:
            raise InputError(f"--image: {error}") from None
    return tuple(parts)


def _printable(text: str) -> str:
    """Returns a model's words without what a terminal would obey; a pipe gets them as they are."""
    if sys.stdout.isatty():
        text = "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)
    return text.encode("utf-8", "backslashreplace").decode().removesuffix("\n")


def _print_cost(backend: Mllm, usage: Usage, seconds: float, tries: int) -> None:
    print(f"{backend.name}: {cost_line(usage, seconds, tries)}", file=sys.stderr)


def cost_line(usage: Usage, seconds: float, tries: int) -> str:
    """Returns in words what a call took: tokens, pictures, money, time."""
    words = ["tokens not counted"]
    if usage.input_tokens or usage.output_tokens:
        cached = f" ({usage.cached_tokens} cached)" if usage.cached_tokens else ""
        hidden = f" ({usage.reasoning_tokens} reasoning)" if usage.reasoning_tokens else ""
        words = [f"{usage.input_tokens} tokens in{cached}", f"{usage.output_tokens} out{hidden}"]
    if usage.images:
        words.append(f"{usage.images} picture{'s' if usage.images > 1 else ''}")
    words.append("cost not known" if usage.cost_usd is None else f"${usage.cost_usd:.6f}")
    words.append(f"{seconds:.1f} s")
    if tries > 1:
        words.append(f"{tries} tries")
    return ", ".join(words)
