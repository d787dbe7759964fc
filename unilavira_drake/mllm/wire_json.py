"""Bodies of requests as bytes: cheap, and the same for the same request.

A picture goes over the wire as base64.  It is encoded once for each picture, not for each
request that shows it, and is spliced between the parts of the body as it is: a JSON encoder
would look at every character of it again.
"""

from __future__ import annotations

import base64
import functools
import json
from collections.abc import Iterable, Mapping
from typing import Any

_PICTURES = 256
"""How many encoded pictures are remembered; a picture of 640 x 480 pixels takes some 100 kB."""


@functools.lru_cache(maxsize=_PICTURES)
def base64_of(data: bytes) -> bytes:
    """Returns the base64 form of a picture's bytes, without line breaks."""
    return base64.b64encode(data)


def json_bytes(value: Any) -> bytes:
    """Returns compact JSON in UTF-8; half of a surrogate pair becomes a question mark."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode("utf-8", "replace")


def opened(members: Mapping[str, Any]) -> bytes:
    """Returns a JSON object with these members, left open so that another one may follow."""
    text = json_bytes(members)
    return b"{" if text == b"{}" else text[:-1] + b","


def listed(items: Iterable[tuple[bytes, ...]]) -> list[bytes]:
    """Returns the pieces of the items of a JSON array, with commas between the items.

    Pieces are joined once, at the very end: to copy megabytes costs more than all the rest.
    """
    pieces: list[bytes] = []
    for item in items:
        if pieces:
            pieces.append(b",")
        pieces.extend(item)
    return pieces


def merged(base: Mapping[str, Any], extra: Mapping[str, Any]) -> dict[str, Any]:
    """Returns ``base`` with the fields of ``extra``, which win; objects are merged field by field.

    A field that ``extra`` sets to None is left out of the result.
    """
    result = dict(base)
    for key, value in extra.items():
        known = result.get(key)
        if value is None:
            result.pop(key, None)
        elif isinstance(value, Mapping):
            result[key] = merged(known if isinstance(known, Mapping) else {}, value)
        else:
            result[key] = value
    return result
