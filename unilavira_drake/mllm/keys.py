"""Keys: out of the environment only, over TLS only, and into no text that anyone reads."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from urllib.parse import quote

import pydantic

from unilavira_drake.errors import MllmAuthenticationError
from unilavira_drake.mllm.address import host_of, is_loopback, is_plain

SHARED_KEY = "UNILAVIRA_API_KEY"
ROLE_KEYS = {
    "language": "UNILAVIRA_LANGUAGE_API_KEY",
    "vision": "UNILAVIRA_VISION_API_KEY",
}
"""Role -> the environment variable that goes before the shared one; empty means no key."""

_SHORTEST_SECRET = 8
"""A shorter key is a placeholder: to take it out of a text would only spoil the text."""
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")


def find_key(
    role: str, url: str, environment: Mapping[str, str] = os.environ
) -> pydantic.SecretStr | None:
    """Returns the key of a role for an address, or None where the address needs none.

    An address on this machine needs none, and neither does a plain ``http`` one in one's own
    network, which may not be given any.

    Raises:
        MllmAuthenticationError: if an ``https`` address elsewhere has no key, or as
            :func:`check_key`.  The message names the variables, never a value.
    """
    name = ROLE_KEYS[role]
    if name not in environment:
        name = SHARED_KEY
    text = environment.get(name, "").strip()
    if text:
        return check_key(text, url, name)
    if name not in environment and not is_plain(url) and not is_loopback(url):
        raise MllmAuthenticationError(
            f"{host_of(url)} needs a key: set {ROLE_KEYS[role]} or {SHARED_KEY} "
            "(to an empty text if it needs none)."
        )
    return None


def check_key(text: str, url: str, name: str) -> pydantic.SecretStr:
    """Returns a key that may be sent to an address.

    Args:
        name: where the key comes from, for the message.

    Raises:
        MllmAuthenticationError: if it would go unencrypted to another machine, or holds a
            character that no HTTP header can carry.
    """
    if not all("!" <= character <= "~" for character in text):
        raise MllmAuthenticationError(
            f"{name}: the key holds a blank, a line break or another character that no HTTP "
            "header can carry; was it copied in full and without its quotes?"
        )
    if is_plain(url) and not is_loopback(url):
        raise MllmAuthenticationError(
            f"{name}: the key is not sent to {host_of(url)} over plain http, where others could "
            f"read it; use https, or set the role's own variable ({', '.join(ROLE_KEYS.values())}) "
            "to an empty text if this endpoint needs no key."
        )
    return pydantic.SecretStr(text)


def redact(text: str, key: pydantic.SecretStr | None) -> str:
    """Returns a text without the key, which a server may have echoed."""
    for form in _forms(key):
        text = text.replace(form, "***")
    return text


def redact_bytes(body: bytes, key: pydantic.SecretStr | None) -> bytes:
    """Returns a body without the key."""
    for form in _forms(key):
        body = body.replace(form.encode(), b"***")
    return body


def _forms(key: pydantic.SecretStr | None) -> list[str]:
    """How a key may be written: as it is, in an address, and in the JSON of some languages."""
    secret = key.get_secret_value() if key is not None else ""
    if len(secret) < _SHORTEST_SECRET:
        return []
    return [secret, quote(secret, safe=""), secret.replace("/", "\\/")]


def plain_line(text: str, key: pydantic.SecretStr | None, limit: int = 400) -> str:
    """Returns what a server said as one short line: no key, no control characters."""
    line = " ".join(_CONTROL.sub(" ", redact(text, key)).split())
    line = line.encode("utf-8", "backslashreplace").decode()
    return line if len(line) <= limit else f"{line[: limit - 3]}..."
