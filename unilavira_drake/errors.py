"""Every exception this library raises on purpose.

The tree::

    UniLaviraError
    ├── InputError            a person's input is wrong (exit code 2)
    │   ├── ScenarioError     a scenario file, overlay or flag
    │   ├── GeometryError     a geometry that a camera cannot draw
    │   └── TaskError         a task text, start or goal
    ├── InfrastructureError   the machine or a service is not able (exit code 3)
    │   ├── RenderingError    no usable renderer
    │   └── MllmError         the model could not be reached or answered with an error
    │       ├── MllmTimeout               no reply before the deadline
    │       ├── MllmUnreachable           no connection, or no usable answer from the server
    │       ├── MllmAuthenticationError   the key is missing or refused
    │       ├── MllmQuotaError            the quota is used up, or the next try is too far off
    │       ├── MllmRequestError          the server refuses this request
    │       │   └── ContextLengthError    the prompt is longer than the model takes
    │       └── CassetteError             the cassette holds no reply to this request
    ├── ReplyFormatError      a model's reply is not what was asked for (handled by a re-ask)
    │   ├── ReplyTruncated    it was cut off at the limit of tokens
    │   └── ReplyRefused      the model or its provider refused to answer (never asked again)
    └── PortTypeError         a port carries another type than its reader expects (a wiring bug)

Inside the control loop expected failures are values (a status on a port); only bugs raise.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


class UniLaviraError(Exception):
    """Base class of every deliberate error of this library."""


class InputError(UniLaviraError):
    """A person's input is wrong: the message names the place, the value and the remedy."""


class ScenarioError(InputError):
    """A scenario file, overlay or command-line flag cannot be used."""


class GeometryError(InputError):
    """A geometry cannot be drawn: a broken or missing file, or an unsupported shape."""


class TaskError(InputError):
    """A task text, start or goal cannot be used."""


class InfrastructureError(UniLaviraError):
    """The machine or a service is not able to run the episode; never the agent's failure."""


class RenderingError(InfrastructureError):
    """No renderer works on this machine."""


class MllmError(InfrastructureError):
    """A model could not be reached, or answered with an error instead of a reply."""

    attempts: tuple[Any, ...] = ()
    """The ``mllm.reply.Attempt`` of each request on the wire before the error."""
    latency: float | None = None
    """Wall-clock seconds from the call to the error, or as recorded; None when not told."""


class MllmTimeout(MllmError):
    """A model gave no reply before its deadline."""


class MllmUnreachable(MllmError):
    """No connection, or no usable answer: DNS, TLS, a reset, 5xx, a body that is no JSON."""


class MllmAuthenticationError(MllmError):
    """The key is missing or refused."""


class MllmQuotaError(MllmError):
    """The quota is used up, or the provider allows the next try too late."""


class MllmRequestError(MllmError):
    """The server refuses this very request, so trying again would not help."""


class ContextLengthError(MllmRequestError):
    """The prompt is longer than the model takes."""


class CassetteError(MllmError):
    """A cassette holds no reply to this request; the message says what differs."""


class ReplyFormatError(UniLaviraError):
    """A model's reply does not have the form that was asked for."""

    worth_a_reask = True
    """Whether the model may do better when it is told what was wrong."""

    attempts: tuple[Any, ...] = ()
    """The ``mllm.reply.Attempt`` of each request on the wire, when a backend raises it."""
    latency: float | None = None
    """As for ``MllmError``."""


class ReplyTruncated(ReplyFormatError):
    """A reply was cut off at the limit of tokens, also where twice as many were allowed."""

    worth_a_reask = False


class ReplyRefused(ReplyFormatError):
    """The model, or its provider's filter, refused to answer."""

    worth_a_reask = False


class PortTypeError(UniLaviraError, TypeError):
    """A port is unconnected, or carries another type than its reader expects."""


MOST_NAMES = 30
"""Names that a message lists at most."""


def unknown_name(kind: str, name: str, valid: Iterable[str], place: str) -> str:
    """Returns a message for an unknown name, with the nearest valid one as the remedy.

    Of more names than a person would read it lists the nearest ones.
    """
    names = sorted(valid)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    if not near and len(name) > 1:
        longer = [valid_name for valid_name in names if name.casefold() in valid_name.casefold()]
        near = difflib.get_close_matches(name, longer, n=1, cutoff=0.0)
    remedy = f"did you mean {near[0]!r}? " if near else ""
    rest = ""
    if len(names) > MOST_NAMES:
        rest = f" ... ({len(names)} in all)"
        names = sorted(difflib.get_close_matches(name, names, n=MOST_NAMES // 2, cutoff=0.0))
    return f"{place}: unknown {kind} {name!r}; {remedy}valid: {', '.join(names) or 'none'}{rest}."
