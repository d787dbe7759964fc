"""A backend that a test tells what to do, behind a real server."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from PIL import Image

from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.serving import ModelServer


class Scripted:
    """A backend that keeps what it is asked and does what a test says."""

    name = description = "scripted"
    perception = "images"
    reasoning = "model"
    box_space = "pixels"
    deadline = 10.0

    def __init__(self, act: Callable[[MllmRequest], str]) -> None:
        self.act = act
        self.asked: list[MllmRequest] = []
        self.closed = False

    def complete(self, request: MllmRequest) -> Completion:
        self.asked.append(request)
        return Completion(self.act(request))

    def close(self) -> None:
        self.closed = True


def failing(error: Exception) -> Callable[[MllmRequest], str]:
    def act(request: MllmRequest) -> str:
        raise error

    return act


def serving(backend: Any) -> AbstractContextManager[ModelServer]:
    return ModelServer({"language": backend, "vision": backend}, name="served", port=0).running()


def jpeg(color: str = "red", form: str = "JPEG") -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (64, 48), color).save(out, form)
    return out.getvalue()
