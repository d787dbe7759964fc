"""The mailbox: a folder where each request waits for a reply, by a person or any other process.

A request becomes the folder ``NNN-ROLE-CALL`` (``-again`` for a re-ask) with ``prompt.txt``, the
pictures in their order and ``request.json``; it appears there whole.  The reply is read from
``reply.json``, or ``reply.txt``, in that folder as soon as it is there.  An episode that is begun
again finds the replies to the requests that are still the same.
"""

from __future__ import annotations

import functools
import json
import os
import re
import shutil
import threading
import time
from pathlib import Path
from typing import Literal

import pydantic
import yaml

from unilavira_drake.errors import MllmError, MllmRequestError, MllmTimeout, ScenarioError
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.likeness import content_digest
from unilavira_drake.mllm.prompt import Prompt, compose_prompt
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.reply_schema import request_schema
from unilavira_drake.mllm.request import MllmRequest

SETTINGS = "mailbox.yaml"
REQUEST = "request.json"
REPLIES = ("reply.json", "reply.txt")
POLL = 0.2
"""Wall-clock seconds between two looks for a reply."""
SETTLED = 0.6
"""A reply that is no JSON object is whole when it is the same for so long, wall-clock seconds."""


class MailboxSettings(pydantic.BaseModel):
    """What ``mailbox.yaml`` in the folder may say."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    answered_by: str = ""
    """Who answers; for results and cassettes."""
    reasoning: Literal["human", "model"] = "human"
    timeout_s: float = pydantic.Field(default=3600.0, gt=0.0)
    """Wall-clock seconds that each reply is waited for."""
    box_space: str = "pixels"
    """A key of ``boxes.BOX_SPACES``."""


class MailboxModel:
    """Puts each request into a folder and waits for the reply there.

    Nothing is written before the first request.

    Args:
        folder: of the mailbox; made with the first request.

    Raises:
        ScenarioError: if the folder is a file, or its ``mailbox.yaml`` cannot be used.
    """

    name = "mailbox"
    perception = "images"

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._settings = _read_settings(folder)
        self._closed = threading.Event()

    @property
    def answered_by(self) -> str:
        """Who answers; empty when the mailbox does not say."""
        return self._settings.answered_by

    @property
    def reasoning(self) -> str:
        """``human`` | ``model``."""
        return self._settings.reasoning

    @property
    def box_space(self) -> str:
        """How a reply names places in a picture."""
        return self._settings.box_space

    @property
    def deadline(self) -> float:
        """Wall-clock seconds that a reply is waited for."""
        return self._settings.timeout_s

    @property
    def description(self) -> str:
        """Who answers, and where."""
        who = self._settings.answered_by or f"a {self._settings.reasoning}"
        return f"{who} answers through the folder {self._folder}"

    def place(self, request: MllmRequest) -> Path:
        """Returns the folder of a request."""
        again = {0: "", 1: "-again"}.get(request.attempt, f"-again{request.attempt}")
        return self._folder / f"{request.n:03d}-{request.role}-{request.call}{again}"

    def complete(self, request: MllmRequest) -> Completion:
        """Puts the request down, unless it lies there already, and waits for its reply.

        Raises:
            MllmRequestError: if the place holds another request.
            MllmTimeout: if no reply comes before the deadline.
            MllmError: if the mailbox is closed first.
            OSError: if the folder cannot be written.
        """
        prompt = compose_prompt(request)
        place = self.place(request)
        if not place.exists():
            _put(place, request, prompt)
        elif _digest_at(place) != content_digest(prompt):
            raise MllmRequestError(
                f"{place} holds another request than this one; name an empty mailbox, or remove "
                "that folder and those after it."
            )
        text = self._awaited(place)
        return Completion(text, Usage(images=len(prompt.images), cost_usd=None))

    def close(self) -> None:
        """Ends all waiting."""
        self._closed.set()

    def _awaited(self, place: Path) -> str:
        until = time.monotonic() + self.deadline
        seen: tuple[str, float] = ("", 0.0)
        while True:
            text = _reply_at(place)
            now = time.monotonic()
            if text.strip():
                if text != seen[0]:
                    seen = (text, now)
                if _is_object(text) or now - seen[1] >= SETTLED:
                    return text
            if now >= until:
                raise MllmTimeout(f"no reply in {place} within {self.deadline:g} s.")
            if self._closed.wait(POLL):
                raise MllmError(f"the mailbox was closed before a reply was in {place}.")


def _read_settings(folder: Path) -> MailboxSettings:
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)):
        raise ScenarioError(f"mailbox {str(folder)!r}: is no folder that can be written.")
    path = folder / SETTINGS
    if not path.exists():
        return MailboxSettings()
    try:
        settings = MailboxSettings.model_validate(yaml.safe_load(path.read_text("utf-8")) or {})
    except pydantic.ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(map(str, problem["loc"])) or "the file"
        names = ", ".join(MailboxSettings.model_fields)
        raise ScenarioError(f"{path}: {place}: {problem['msg']}; it may set {names}.") from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}.") from None
    if settings.box_space not in BOX_SPACES:
        raise ScenarioError(f"{path}: box_space must be one of {', '.join(BOX_SPACES)}.")
    return settings


def _put(place: Path, request: MllmRequest, prompt: Prompt) -> None:
    """Writes a request beside its place and moves it there in one step."""
    beside = place.with_name(f".{place.name}.partial")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    names = []
    for number, image in enumerate(prompt.images, start=1):
        label = re.sub(r"[^A-Za-z0-9]+", "-", image.label).strip("-")[:60]
        names.append(f"{number:02d}-{label}.jpg")
        (beside / names[-1]).write_bytes(image.jpeg)
    pictures = [
        {"file": name, "label": image.label}
        for name, image in zip(names, prompt.images, strict=True)
    ]
    about = {
        "role": request.role,
        "call": request.call,
        "n": request.n,
        "attempt": request.attempt,
        "seed": request.seed,
        "feedback": request.feedback,
        "pictures": pictures,
        "reply_to": list(REPLIES),
        "reply_schema": request_schema(request),
        "digest": content_digest(prompt),
    }
    (beside / "prompt.txt").write_bytes(prompt.text.encode("utf-8", "backslashreplace"))
    text = json.dumps(about, ensure_ascii=False, indent=2) + "\n"
    (beside / REQUEST).write_bytes(text.encode("utf-8", "backslashreplace"))
    os.replace(beside, place)


def _digest_at(place: Path) -> str:
    try:
        return str(json.loads((place / REQUEST).read_text("utf-8"))["digest"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _reply_at(place: Path) -> str:
    for name in REPLIES:
        path = place / name
        try:
            return path.read_bytes().decode("utf-8-sig", "replace")
        except OSError:  # Not there yet, or being replaced just now.
            continue
    return ""


@functools.lru_cache(maxsize=8)
def _is_object(text: str) -> bool:
    """Whether the text is a JSON object; no part of one is."""
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False
