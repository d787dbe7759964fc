"""What an endpoint's address tells: whether it is this machine, and how it is named to people."""

from __future__ import annotations

import ipaddress
from urllib.parse import urlsplit


def is_loopback(url: str) -> bool:
    """Returns whether an address is this machine's own, so that nothing sent there leaves it."""
    host = (urlsplit(url).hostname or "").rstrip(".").lower()
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_plain(url: str) -> bool:
    """Returns whether what is sent to an address can be read on the way there."""
    return urlsplit(url).scheme.lower() != "https"


def host_of(url: str) -> str:
    """Returns ``host`` or ``host:port``: without a path, a query or a name and password."""
    return urlsplit(url).netloc.rpartition("@")[2]
