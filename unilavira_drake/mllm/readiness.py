"""What can be told of an endpoint before anything is asked: its key, and whether anyone listens."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

from unilavira_drake.errors import MllmUnreachable
from unilavira_drake.mllm.http_route import failure_of, proxy_of
from unilavira_drake.mllm.keys import find_key
from unilavira_drake.mllm.profile import Profile

_CONNECT_TIMEOUT = 2.0
"""Seconds.  A refusal comes at once; an address that is silent is left to the calls."""
_PORTS = {"http": 80, "https": 443}


def check_ready(profile: Profile, *, role: str) -> None:
    """Returns if nothing speaks against asking an endpoint for a role; sends it nothing.

    Only what is certain is raised: a name that is not resolved or a silent address may be
    there in a moment, and a proxy answers for what is behind it.

    Raises:
        MllmAuthenticationError: if the key is missing or not to be sent there.
        MllmUnreachable: if the connection is refused: nothing listens at the address.
    """
    url = profile.base_url
    find_key(role, url)
    if proxy_of(url) is not None:
        return
    parts = urlsplit(url)
    port = parts.port or _PORTS[parts.scheme]
    try:
        socket.create_connection((parts.hostname or "", port), _CONNECT_TIMEOUT).close()
    except ConnectionRefusedError as error:
        raise MllmUnreachable(failure_of(error, url, _CONNECT_TIMEOUT).message) from None
    except (OSError, UnicodeError):  # Of a name that is none; told by the first call.
        return
