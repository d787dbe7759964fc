"""What a body asks, whatever its format: texts and pictures in their order."""

from __future__ import annotations

import base64
import binascii
import json
from dataclasses import dataclass
from typing import Any

from unilavira_drake.errors import InputError
from unilavira_drake.messages import Message
from unilavira_drake.mllm.picture_files import as_jpeg
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.mllm.tokens import picture_tokens, text_tokens
from unilavira_drake.mllm.transfer import request_from_json


@dataclass(frozen=True)
class Turn(Message):
    """What one speaker of a conversation says."""

    speaker: str = "user"
    parts: tuple[str | ImagePart, ...] = ()


@dataclass(frozen=True)
class Question(Message):
    """A conversation, and the typed request if the client has sent one."""

    system: str = ""
    turns: tuple[Turn, ...] = ()
    seed: int = 0
    schema: Any = None
    """A JSON schema that the reply is to keep to, or None."""
    typed: Any = None
    """``transfer.request_to_json`` of our own client, or None."""

    @property
    def pictures(self) -> tuple[ImagePart, ...]:
        """All pictures in their order."""
        parts = (part for turn in self.turns for part in turn.parts)
        return tuple(part for part in parts if isinstance(part, ImagePart))

    @property
    def text(self) -> str:
        """The whole conversation as one text; ``[picture 2]`` stands where a picture was."""
        blocks, number = [self.system] if self.system else [], 0
        for turn in self.turns:
            said = []
            for part in turn.parts:
                if isinstance(part, ImagePart):
                    number += 1
                    said.append(f"\n[picture {number}]\n")
                else:
                    said.append(part)
            words = "".join(said).strip()
            blocks.append(f"{turn.speaker}: {words}" if len(self.turns) > 1 else words)
        if self.schema is not None:
            schema = json.dumps(self.schema, ensure_ascii=False)
            blocks.append(f"Reply with one JSON object of this JSON schema:\n{schema}")
        return "\n\n".join(block for block in blocks if block)

    def request(self, number: int) -> MllmRequest:
        """Returns the request to the backend; a plain conversation becomes a free text.

        Args:
            number: of the call, for a conversation.

        Raises:
            InputError: if the typed request has another form, or there is nothing to answer.
        """
        if self.typed is not None:
            request = request_from_json(self.typed, [part.jpeg for part in self.pictures])
            if request.role not in ("language", "vision"):
                raise InputError(f"role {request.role!r}: must be language or vision.")
            return request
        text = self.text
        if not text and not self.pictures:
            raise InputError("there is nothing to answer: no text and no picture.")
        return MllmRequest(
            n=number,
            seed=self.seed,
            call="free",
            variables=FreeVariables(text),
            images=self.pictures,
        )

    def usage(self, completion: Completion) -> Usage:
        """Returns what the backend has counted, or an estimate where it counts nothing."""
        counted = completion.usage
        if counted.input_tokens or counted.output_tokens:
            return counted
        pictures = sum(picture_tokens(part, None) for part in self.pictures)
        return Usage(text_tokens(self.text) + pictures, text_tokens(completion.text))


def picture(data: Any, label: str, detail: str) -> ImagePart:
    """Returns a picture from its base64 text; other formats than JPEG are converted.

    Raises:
        InputError: if the text is no base64, or its bytes are no picture.
    """
    try:
        content = base64.b64decode(data, validate=True)
    except (TypeError, ValueError, binascii.Error):
        raise InputError(f"{label}: its data must be base64.") from None
    try:
        return ImagePart(label, as_jpeg(content), detail)
    except InputError as error:
        raise InputError(f"{label}: it {error}") from None


def integer(value: Any) -> int:
    """Returns a seed as it may stand in a request; 0 for anything else."""
    return value if isinstance(value, int) and not isinstance(value, bool) else 0
