"""The models of a cassette: one that replays it, and a wrapper that records any other."""

from __future__ import annotations

import dataclasses
import functools
import time
from pathlib import Path

from unilavira_drake.errors import ReplyFormatError, ScenarioError
from unilavira_drake.mllm.cassette import (
    CassetteHeader,
    RecordedModel,
    RecordedReply,
    recorded_reply,
)
from unilavira_drake.mllm.cassette_file import CassetteWriter, Replies, read_header, read_replies
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.reply import Attempt, Completion, Mllm
from unilavira_drake.mllm.request import MllmRequest

_DEADLINE = 60.0


class CassetteModel:
    """Gives the recorded replies, with what they cost and how long they took.

    It declares what the recorded model declared: its box space, and its perception, so that an
    episode with ``ground_truth`` is repeated with the same requests.

    Args:
        path: the cassette.
        role: ``language`` | ``vision`` | ``judge``.

    Raises:
        ScenarioError: if there is no such file, it is no cassette, or nobody judged when it was
            recorded.
    """

    deadline = _DEADLINE

    def __init__(self, path: Path, *, role: str) -> None:
        self._path = path
        self._header: CassetteHeader = read_header(path)
        model = self._header.model(role)
        if model is None:
            raise ScenarioError(
                f"cassette {str(path)!r}: holds no reply of a {role}; record an episode with a "
                f"{role}_model, or name another model."
            )
        self._model: RecordedModel = model
        self._answered_by = model.name if role == "judge" else self._header.answered_by

    @property
    def preset(self) -> str:
        """The ``prompt_preset`` of the recorded episode."""
        return self._header.preset

    @property
    def name(self) -> str:
        """The recorded model's, marked as a replay."""
        return f"cassette ({self._model.name})"

    @property
    def answered_by(self) -> str:
        """Who answered when it was recorded."""
        return self._answered_by or self._model.name

    @property
    def perception(self) -> str:
        """As recorded."""
        return self._model.perception

    @property
    def reasoning(self) -> str:
        """As recorded."""
        return self._model.reasoning

    @property
    def box_space(self) -> str:
        """As recorded."""
        return self._model.box_space

    @property
    def description(self) -> str:
        """Who answered, and when."""
        date = f" on {self._header.date}" if self._header.date else ""
        return f"replies of {self.answered_by}, recorded{date} and replayed without a model"

    def complete(self, request: MllmRequest) -> Completion:
        """Returns the recorded reply to a request.

        Raises:
            CassetteError: if there is none, or the prompt or a picture is not the recorded one;
                says what differs.
            ReplyFormatError: if the recorded model refused, or its reply was cut off.
        """
        recorded = self._replies.find(request)
        if recorded is None:
            raise self._replies.missing(request)
        return _replayed(recorded, request, self._replies.place)

    def close(self) -> None:
        """Does nothing: there are no connections."""

    @functools.cached_property
    def _replies(self) -> Replies:
        return read_replies(self._path)


class RecordingModel:
    """Asks another model and writes every reply to a cassette.

    What the cassette holds already is replayed; the model is asked for the rest.  Errors of the
    service are not kept: the next recording asks again.

    Args:
        backend: the model that is asked.
        cassette: shared by all roles.
    """

    def __init__(self, backend: Mllm, cassette: CassetteWriter) -> None:
        self._backend = backend
        self._cassette = cassette

    @property
    def name(self) -> str:
        """The asked model's, as all that it declares."""
        return self._backend.name

    @property
    def perception(self) -> str:
        """The asked model's."""
        return self._backend.perception

    @property
    def reasoning(self) -> str:
        """The asked model's."""
        return self._backend.reasoning

    @property
    def description(self) -> str:
        """The asked model's."""
        return self._backend.description

    @property
    def box_space(self) -> str:
        """The asked model's."""
        return self._backend.box_space

    @property
    def deadline(self) -> float:
        """The asked model's."""
        return self._backend.deadline

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request and records the reply.

        Raises:
            CassetteError: if the cassette holds a reply under this key to another prompt.
            MllmError: as the asked model does.
            ReplyFormatError: as the asked model does.
        """
        recorded = self._cassette.replies.find(request)
        if recorded is not None:
            return _replayed(recorded, request, self._cassette.replies.place)
        prompt = compose_prompt(request)
        began = time.monotonic()
        try:
            completion = self._backend.complete(request)
        except ReplyFormatError as error:
            # The figure that is kept must be the one that the episode goes by.
            error.latency = _seconds(error.latency, began)
            self._cassette.append(recorded_reply(request, prompt, error, error.latency))
            raise
        latency = _seconds(completion.latency, began)
        self._cassette.append(recorded_reply(request, prompt, completion, latency))
        return dataclasses.replace(completion, latency=latency)

    def close(self) -> None:
        """Closes the asked model; the cassette is whole after each reply."""
        self._backend.close()


def declared(model: Mllm) -> RecordedModel:
    """Returns what a model declares about itself, for the header of a cassette."""
    return RecordedModel.model_validate(
        {
            "name": model.name,
            "perception": model.perception,
            "reasoning": model.reasoning,
            "box_space": model.box_space,
        }
    )


def answered_by(model: Mllm) -> str:
    """Returns who answers: a person where the model tells of one, else the model's name."""
    return str(getattr(model, "answered_by", "") or model.name)


def _replayed(recorded: RecordedReply, request: MllmRequest, place: str) -> Completion:
    recorded.check(compose_prompt(request), place)
    attempt = Attempt(
        model=place, status="replayed", usage=recorded.usage, latency=recorded.latency
    )
    if recorded.error:
        error = recorded.own_error()
        error.attempts, error.latency = (attempt,), recorded.latency
        raise error
    return Completion(recorded.text, recorded.usage, recorded.latency, (attempt,))


def _seconds(told: float | None, began: float) -> float:
    return round(time.monotonic() - began if told is None else told, 6)
