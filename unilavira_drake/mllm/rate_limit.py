"""Requests and tokens per minute, shared by all processes of a user that ask one endpoint.

Each request books a place in a small file: the earliest moment at which no window of a minute
holds more than is allowed.  Places are given in the order of asking, so no process starves.  The
file needs no server and no clean-up: a place whose process has died is forgotten with its minute.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import hashlib
import json
import os
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from unilavira_drake.errors import InfrastructureError, MllmQuotaError, MllmTimeout
from unilavira_drake.messages import Message

_WINDOW = 60.0
_HORIZON = 600.0
"""Places further ahead were booked before the machine's clock was set back."""
_LOCK_POLL = 0.005


@dataclass(frozen=True)
class Booking(Message):
    """A place in the queue."""

    id: str = ""
    moment: float = 0.0
    """When the request may be sent, in the limit's clock."""
    wait: float = 0.0
    """Seconds until then, when it was booked."""
    tokens: int = 0


class RateLimit:
    """The limits of one endpoint.

    Args:
        endpoint: what names it; those who give the same name share the limits.
        requests_per_minute: None for no limit; may be less than 1.
        tokens_per_minute: None for no limit.  A request larger than this is sent alone.
        folder: where the file is kept; None for the user's cache folder.
        clock: seconds that all processes agree on.
    """

    def __init__(
        self,
        endpoint: str,
        *,
        requests_per_minute: float | None,
        tokens_per_minute: float | None,
        folder: Path | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._requests = requests_per_minute
        self._allowed = max(int(requests_per_minute or 1), 1)
        self._span = _WINDOW / min(requests_per_minute or 1.0, 1.0)
        self._tokens = tokens_per_minute
        self._folder = folder
        self._file = hashlib.sha256(endpoint.encode()).hexdigest()[:24] + ".json"
        self._clock = clock

    def book(self, tokens: int, *, within: float) -> Booking:
        """Books a place for a request and returns it; the caller waits ``wait`` seconds.

        Args:
            tokens: how many the request will probably cost.
            within: the longest wait in seconds that is of use.

        Raises:
            MllmQuotaError: if the wait would be longer; nothing is booked then.
            MllmTimeout: if another process holds the file for so long.
        """
        if self._requests is None and self._tokens is None:
            return Booking(tokens=tokens)
        with self._locked(within) as path:
            now = self._clock()
            queue = self._queue(path, now)
            moment = self._earliest(queue, now, tokens)
            if moment - now > within:
                raise MllmQuotaError(
                    f"our own limit of {self._words()} allows the next request only in "
                    f"{moment - now:.0f} s; the call has {max(within, 0.0):.0f} s left."
                )
            booking = Booking(uuid.uuid4().hex, moment, moment - now, tokens)
            _write(path, [*queue, booking])
        return booking

    def correct(self, booking: Booking, tokens: int, *, within: float = 1.0) -> None:
        """Notes what a request has really cost; a lock that is not to be had is no harm."""
        if not booking.id or self._tokens is None or tokens == booking.tokens:
            return
        with contextlib.suppress(MllmTimeout), self._locked(within) as path:
            queue = self._queue(path, self._clock())
            right = [
                dataclasses.replace(place, tokens=tokens) if place.id == booking.id else place
                for place in queue
            ]
            _write(path, right)

    def _earliest(self, queue: list[Booking], now: float, tokens: int) -> float:
        """Returns the first moment, not before those in the queue, that keeps both limits."""
        moment = max([now, *(place.moment for place in queue)])
        if self._requests is not None and len(queue) >= self._allowed:
            moment = max(moment, queue[-self._allowed].moment + self._span)
        if self._tokens is not None:
            room = self._tokens - tokens
            for place in reversed(queue):
                room -= place.tokens
                if room < 0:
                    moment = max(moment, place.moment + _WINDOW)
                    break
        return moment

    def _queue(self, path: Path, now: float) -> list[Booking]:
        """Returns the places that still count, in their order; a damaged file counts as empty."""
        try:
            rows = json.loads(path.read_text(encoding="utf-8"))
            queue = [Booking(str(name), float(at), 0.0, int(tokens)) for name, at, tokens in rows]
        except (OSError, ValueError, TypeError):
            return []
        oldest = now - self._span
        counting = [place for place in queue if oldest < place.moment < now + _HORIZON]
        return sorted(counting, key=lambda place: place.moment)

    def _words(self) -> str:
        limits = []
        if self._requests is not None:
            limits.append(f"{self._requests:g} requests")
        if self._tokens is not None:
            limits.append(f"{self._tokens:g} tokens")
        return f"{' and '.join(limits)} a minute"

    @contextlib.contextmanager
    def _locked(self, within: float) -> Iterator[Path]:
        """Holds the file's lock, which the kernel frees if the process dies."""
        folder = self._folder or _user_folder()
        path = folder / self._file
        handle = os.open(path.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        until = time.monotonic() + max(within, 0.1)
        try:
            while True:
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if time.monotonic() > until:
                        raise MllmTimeout(f"{path}: locked by another process.") from None
                    time.sleep(_LOCK_POLL)
            yield path
        finally:
            os.close(handle)


def _write(path: Path, queue: list[Booking]) -> None:
    rows = [(place.id, place.moment, place.tokens) for place in queue]
    new = path.with_suffix(f".{os.getpid()}.new")
    new.write_text(json.dumps(rows), encoding="utf-8")
    os.replace(new, path)


def _user_folder() -> Path:
    """Returns a folder of this user's own, which all their processes find."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    wanted = (
        Path(cache) / "unilavira" / "rates",
        Path(tempfile.gettempdir()) / f"unilavira-{os.getuid()}" / "rates",
    )
    for folder in wanted:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if folder.stat().st_uid == os.getuid() and os.access(folder, os.W_OK):
                return folder
    raise InfrastructureError(
        f"the rate limit needs a folder of its own; neither {wanted[0]} nor {wanted[1]} can be "
        "written; set XDG_CACHE_HOME."
    )
