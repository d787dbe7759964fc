"""The ledger of an episode, ``ledger.jsonl``: one row for each attempt at each model call.

It is the only place where the wall-clock latency of a call stands, and what each attempt cost;
nothing of the simulation reads it.  A row is one write of one line, so of a killed run at most
the last row is torn.
"""

from __future__ import annotations

import dataclasses
import json
import threading
from dataclasses import dataclass
from pathlib import Path

from unilavira_drake.errors import InputError
from unilavira_drake.messages import Message
from unilavira_drake.mllm.reply import Attempt
from unilavira_drake.mllm.request import MllmRequest

LEDGER = "ledger.jsonl"
ANSWERED = ("ok", "replayed")
"""The statuses of an attempt that has brought a reply."""


@dataclass(frozen=True)
class LedgerRow(Message):
    """One attempt, as it stands in the file."""

    role: str
    call: str
    n: int
    attempt: int
    """0, or which re-ask with the complaint about the last reply it is."""
    try_: int
    """Number of the request on the wire within this attempt, from 1; ``try`` in the file."""
    model: str
    status: str
    """``ok``, ``replayed`` (by a cassette), ``cancelled`` or the name of the error."""
    http_status: int | None
    input_tokens: int
    cached_tokens: int
    output_tokens: int
    """The visible ones."""
    reasoning_tokens: int
    images: int
    latency_s: float
    """Wall-clock seconds, or as recorded."""
    cost_usd: float | None
    """None when the price is not known."""
    detail: str
    """The error in words."""


_COLUMNS = tuple(field.name for field in dataclasses.fields(LedgerRow))


class Ledger:
    """Appends rows to a file, from any thread; made empty, or continued.

    Raises:
        OSError: if the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._stream = path.open("ab", buffering=0)
        self._lock = threading.Lock()

    def record(self, request: MllmRequest, tries: int, attempt: Attempt) -> None:
        """Appends how a try (a number from 1) at a request went."""
        usage = attempt.usage
        row = LedgerRow(
            role=request.role,
            call=request.call,
            n=request.n,
            attempt=request.attempt,
            try_=tries,
            model=attempt.model,
            status=attempt.status,
            http_status=attempt.http_status,
            input_tokens=usage.input_tokens,
            cached_tokens=usage.cached_tokens,
            output_tokens=usage.output_tokens - usage.reasoning_tokens,
            reasoning_tokens=usage.reasoning_tokens,
            images=usage.images,
            latency_s=round(attempt.latency, 6),
            cost_usd=usage.cost_usd,
            detail=attempt.detail,
        )
        fields = {name.rstrip("_"): value for name, value in dataclasses.asdict(row).items()}
        # Half a surrogate pair in an error's words has no UTF-8; its escape is JSON, too.
        line = json.dumps(fields, ensure_ascii=False) + "\n"
        with self._lock:
            if not self._stream.closed:
                self._stream.write(line.encode("utf-8", "backslashreplace"))

    def close(self) -> None:
        """Closes the file; later rows are dropped."""
        with self._lock:
            self._stream.close()


def read_ledger(path: Path) -> tuple[LedgerRow, ...]:
    """Returns the rows of a ledger; a torn last line is left out.

    Raises:
        InputError: if the file cannot be read or is no ledger.
    """
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a ledger: {error}.") from None
    rows = []
    for number, line in enumerate(lines[:-1], start=1):
        try:
            fields = json.loads(line)
            fields["try_"] = fields["try"]
            rows.append(LedgerRow(**{name: fields[name] for name in _COLUMNS}))
        except (ValueError, KeyError, TypeError, AttributeError):
            raise InputError(f"{path}, line {number}: no row of a ledger.") from None
    return tuple(rows)
