"""One question to a model outside of any Diagram: asked, read and re-asked as the ring does it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from unilavira_drake.errors import MllmError, ReplyFormatError
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.messages import LanguageAction, VisionAction
from unilavira_drake.mllm.reply import Completion, Mllm
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.vision.reply import parse_vision_reply

MAX_REASKS = 1
"""A reply that cannot be used is asked for once more, with what was wrong with it."""

ReplyListener = Callable[[MllmRequest, Completion], None]
"""Called with each request that was answered, and its reply before anyone has read it."""


def ask(
    backend: Mllm, request: MllmRequest, *, on_reply: ReplyListener | None = None
) -> LanguageAction | VisionAction:
    """Returns the action that a model's reply to a request means.

    A reply that cannot be used, an empty one too, is asked for once more with what was wrong.
    One that was refused, or cut off although there was room for twice as much, is not.

    Args:
        request: a call of one of the two roles; not a free text, to which any reply is right.

    Raises:
        MllmError: if no reply can be had.
        ReplyFormatError: if the reply to the re-ask cannot be used either, or at once if it was
            refused or cut off.  Both kinds carry the ``attempts`` of all requests.
    """
    attempts: tuple[Any, ...] = ()
    while True:
        try:
            completion = backend.complete(request)
            attempts += completion.attempts
            if on_reply is not None:
                on_reply(request, completion)
            return _parsed(completion.text, request)
        except (MllmError, ReplyFormatError) as error:
            attempts += error.attempts
            error.attempts = attempts
            hopeless = isinstance(error, MllmError) or not error.worth_a_reask
            if hopeless or request.attempt >= MAX_REASKS:
                raise
            request = dataclasses.replace(request, attempt=request.attempt + 1, feedback=str(error))


def _parsed(text: str, request: MllmRequest) -> LanguageAction | VisionAction:
    parse = parse_vision_reply if request.role == "vision" else parse_language_reply
    return parse(text, request)
