"""``unilavira doctor``: is this machine able, and is a model's endpoint?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Annotated

import typer

from unilavira_drake.endpoint_check import FAILED, OK, Check, check_endpoint
from unilavira_drake.errors import RenderingError
from unilavira_drake.mllm.backends import SPECS, make_backend, profile_of
from unilavira_drake.recording.result import installed_versions
from unilavira_drake.rendering_check import check_rendering
from unilavira_drake.resources import models_path, prompts_path
from unilavira_drake.scenario import RENDERERS

NOT_ABLE = 3


def doctor(
    model: Annotated[
        str | None,
        typer.Option(
            help=f"Checks this model's endpoint, too, with two small calls: {SPECS}.",
            metavar="SPEC",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Checks that episodes can run here, and says how to repair what cannot.

    One line a check: ok, FAILED or unknown.  Exit code 3 if one has failed.
    """
    if model is not None:
        make_backend(model, role="language", place="--model")
    failed = False
    for check in itertools.chain(_machine(), _rendering(), () if model is None else _model(model)):
        print(check.line, flush=True)
        failed = failed or check.state == FAILED
    if failed:
        raise typer.Exit(NOT_ABLE)


def _machine() -> Iterator[Check]:
    for name, version in installed_versions().items():
        yield Check(OK, name, version)
    for what, folder in (("models", models_path()), ("prompts", prompts_path())):
        yield Check(OK, what, str(folder))


def _rendering() -> Iterator[Check]:
    for renderer in RENDERERS:
        try:
            check_rendering(renderer=renderer)
            yield Check(OK, f"rendering with {renderer}", "a test picture is right")
        except RenderingError as error:
            words = str(error).removeprefix("rendering: ")
            yield Check(FAILED, f"rendering with {renderer}", words)


def _model(spec: str) -> Iterator[Check]:
    profile = profile_of(spec, place="--model")
    backend = make_backend(spec, role="language", place="--model")
    yield Check(OK, f"model {spec}", backend.description)
    if profile is not None:
        yield from check_endpoint(profile)
