"""The way to an address: through which proxy, and in words what went wrong on it."""

from __future__ import annotations

import socket
import ssl
import urllib.request
from collections.abc import Iterator, Sequence

import httpx

from unilavira_drake.errors import MllmUnreachable
from unilavira_drake.mllm.address import host_of, is_loopback
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.wire import WireFailure


def proxy_of(url: str) -> str | None:
    """Returns the proxy that the environment names for an address; never one for loopback."""
    if is_loopback(url) or urllib.request.proxy_bypass(host_of(url)):
        return None
    proxies = urllib.request.getproxies()
    proxy = proxies.get(httpx.URL(url).scheme) or proxies.get("all")
    return proxy if not proxy or "://" in proxy else f"http://{proxy}"


def failure_of(error: Exception, url: str, connect_timeout: float) -> WireFailure:
    """Returns what went wrong on the way, in words that hold no header.

    Where no request has left, its usage tells that it has cost nothing.
    """
    sent = isinstance(
        error, httpx.ReadError | httpx.WriteError | httpx.CloseError | httpx.RemoteProtocolError
    )
    host, causes = host_of(url), list(_causes(error))
    if isinstance(error, httpx.ConnectTimeout):
        words = f"no connection to {host} within {connect_timeout:g} s."
    else:
        words = _words_of_cause(causes, host) or _words_of_error(error, host)
    if not words:
        # Its own words may quote a header.
        words = f"{url.partition('?')[0]!r} cannot be asked ({type(error).__name__})."
    hopeless = isinstance(error, ImportError | ValueError | httpx.InvalidURL) or any(
        isinstance(cause, ssl.SSLCertVerificationError | httpx.LocalProtocolError)
        for cause in causes
    )
    usage = Usage() if sent else Usage(cost_usd=0.0)
    return WireFailure(MllmUnreachable, words, retryable=not hopeless, usage=usage)


def _words_of_cause(causes: Sequence[BaseException], host: str) -> str:
    """What the system says, however deep it is wrapped."""
    for cause in causes:
        if isinstance(cause, socket.gaierror):
            return f"the host name of {host} cannot be resolved (DNS)."
        if isinstance(cause, ssl.SSLCertVerificationError):
            return f"TLS: the certificate of {host} is not accepted: {cause}"
        if isinstance(cause, ssl.SSLError):
            return f"TLS with {host} failed: {cause}"
        if isinstance(cause, ConnectionRefusedError):
            return f"{host} refuses the connection; is the server running?"
    return ""


def _words_of_error(error: Exception, host: str) -> str:
    """What HTTPX says; empty where its words may quote a header."""
    if isinstance(error, httpx.ProxyError):
        return f"the proxy that the environment names does not let {host} through: {error}"
    if isinstance(error, httpx.RemoteProtocolError):
        return f"{host} broke off its answer or does not speak HTTP: {error}"
    if isinstance(error, httpx.NetworkError):
        return f"the connection to {host} broke ({type(error).__name__})."
    if isinstance(error, ImportError):
        return (
            f"the environment names a SOCKS proxy for {host}: 'pip install socksio', or set "
            "NO_PROXY."
        )
    return ""


def _causes(error: BaseException) -> Iterator[BaseException]:
    yield error
    for inner in (error.__cause__, error.__context__, *getattr(error, "exceptions", ())):
        if inner is not None:
            yield from _causes(inner)
