"""A typed request as JSON, for the one kind of peer that reads it: our own ``serve``.

It holds everything, also the ground-truth evidence.  Pictures are named by their position among
those of the prompt, which travel in the same body.
"""

from __future__ import annotations

import base64
import binascii
import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any

import pydantic

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.profile import Profile
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.request import (
    FreeVariables,
    ImagePart,
    LanguageVariables,
    MllmRequest,
    VisionVariables,
)
from unilavira_drake.mllm.wire_json import json_bytes

EXTRA_FIELD = "unilavira_request"
"""The member of a body that carries the typed request."""
_VARIABLES: dict[str, type[LanguageVariables | VisionVariables | FreeVariables]] = {
    "language": LanguageVariables,
    "vision": VisionVariables,
    "free": FreeVariables,
}


def typed_member(request: MllmRequest, prompt: Prompt, profile: Profile) -> bytes:
    """Returns the member that is added to a body, ``,"unilavira_request":{...}``.

    Empty but for a peer declared as ``rules``: the only place where ground truth is written.
    """
    if profile.peer != "rules":
        return b""
    return b"," + json_bytes({EXTRA_FIELD: request_to_json(request, prompt)})[1:-1]


def request_to_json(request: MllmRequest, prompt: Prompt) -> dict[str, Any]:
    """Returns a request as a JSON value, its pictures by their position in the prompt.

    A picture that the prompt does not show is written out in base64.
    """
    positions: dict[bytes, int] = {}
    for position, image in enumerate(prompt.images):
        positions.setdefault(image.jpeg, position)
    kind = next(name for name, form in _VARIABLES.items() if type(request.variables) is form)
    value = {
        field.name: _plain(getattr(request, field.name))
        for field in dataclasses.fields(request)
        if field.name not in ("images", "variables")
    }
    images = []
    for image in request.images:
        note: dict[str, Any] = {"label": image.label, "detail": image.detail}
        if image.jpeg in positions:
            note["picture"] = positions[image.jpeg]
        else:
            note["jpeg"] = base64.b64encode(image.jpeg).decode("ascii")
        images.append(note)
    return {**value, "kind": kind, "variables": _plain(request.variables), "images": images}


def request_from_json(value: Any, pictures: Sequence[bytes]) -> MllmRequest:
    """Returns the request that :func:`request_to_json` has written.

    Args:
        pictures: the JPEG images of the body, in their order.

    Raises:
        InputError: if the value has another form; names the place.
    """
    if not isinstance(value, dict):
        raise InputError(f"{EXTRA_FIELD}: must be an object.")
    kind = value.get("kind")
    if not isinstance(kind, str) or kind not in _VARIABLES:
        raise InputError(f"{EXTRA_FIELD}: kind must be one of {', '.join(_VARIABLES)}.")
    listed = value.get("images", [])
    if not isinstance(listed, list):
        raise InputError(f"{EXTRA_FIELD}: images must be a list.")
    images = tuple(_image(note, pictures) for note in listed)
    variables = _read(_VARIABLES[kind], value.get("variables"), "variables")
    evidence = value.get("evidence")
    views = None if evidence is None else _read(tuple[ViewEvidence, ...], evidence, "evidence")
    handled = ("kind", "variables", "images", "evidence")
    plain = {key: item for key, item in value.items() if key not in handled}
    request = _read(MllmRequest, plain, "request")
    assert isinstance(request, MllmRequest)
    return dataclasses.replace(request, variables=variables, images=images, evidence=views)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no infinity; reading takes the word.
    return value


@functools.cache
def _adapter(form: Any) -> pydantic.TypeAdapter[Any]:
    return pydantic.TypeAdapter(form)


def _read(form: Any, value: Any, place: str) -> Any:
    try:
        return _adapter(form).validate_python(value)
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(step) for step in (place, *first["loc"]))
        raise InputError(f"{EXTRA_FIELD}: {where}: {first['msg']}.") from None


def _image(note: Any, pictures: Sequence[bytes]) -> ImagePart:
    if not isinstance(note, dict):
        raise InputError(f"{EXTRA_FIELD}: each of images must be an object.")
    label, detail = str(note.get("label", "")), str(note.get("detail", "high"))
    position = note.get("picture")
    if position is None:
        return ImagePart(label, _unpacked(note.get("jpeg")), detail)
    if isinstance(position, bool) or not isinstance(position, int):
        raise InputError(f"{EXTRA_FIELD}: picture must be a number.")
    if not 0 <= position < len(pictures):
        raise InputError(
            f"{EXTRA_FIELD}: picture {position} is none of the {len(pictures)} of this body; "
            "positions count from 0."
        )
    return ImagePart(label, pictures[position], detail)


def _unpacked(text: Any) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (TypeError, ValueError, binascii.Error):
        raise InputError(f"{EXTRA_FIELD}: jpeg must be base64.") from None
