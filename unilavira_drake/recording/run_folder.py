"""The folder of one run: every file whole or not there."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Any

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.ledger import LEDGER, Ledger
from unilavira_drake.mllm.reply import Attempt
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.recording.occupancy_picture import PNG_MAGIC
from unilavira_drake.recording.transcript import transcript_line

TRANSCRIPT = "transcript.jsonl"
FRAMES = "frames"
MAPS = "maps"


class RunFolder:
    """Writes the files of a run; as a context manager it closes them, come what may.

    Args:
        path: the folder itself; made if need be.

    Raises:
        InputError: if the folder holds anything already, or cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        _prepare(self.path)
        self._partial = self.path / f"{TRANSCRIPT}.partial"
        # Half a surrogate pair in a reply has no UTF-8; its escape is JSON, too.
        self._stream = self._partial.open(
            "w", encoding="utf-8", errors="backslashreplace", newline="\n"
        )
        self._ledger = Ledger(self.path / LEDGER)
        self._pictures: set[str] = set()
        self._decision = 0

    def __enter__(self) -> RunFolder:
        """Returns itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the files, also after an error or an interrupt."""
        self.close()

    def record(self, t: float, system: str, event: str, message: Any) -> None:
        """Appends a message to the transcript and keeps its pictures.

        Args:
            t: simulated seconds.
        """
        pictures: dict[str, bytes] = {}
        self._decision = getattr(message, "n", self._decision)
        line = transcript_line(t, self._decision, system, event, message, pictures)
        for digest, picture in pictures.items():
            if digest not in self._pictures:
                is_map = picture.startswith(PNG_MAGIC)
                name = f"{MAPS}/{digest}.png" if is_map else f"{FRAMES}/{digest}.jpg"
                self.write(name, picture)
                self._pictures.add(digest)
        self._stream.write(line + "\n")
        self._stream.flush()

    def record_attempt(self, request: MllmRequest, tries: int, attempt: Attempt) -> None:
        """Appends how a try (a number from 1) at a model call went; from any thread."""
        self._ledger.record(request, tries, attempt)

    def write(self, name: str, content: str | bytes) -> Path:
        """Writes a file in one step and returns its path; it replaces an older one."""
        path = self.path / name
        path.parent.mkdir(exist_ok=True)
        beside = path.with_name(f".{path.name}.partial")
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(beside, path)
        return path

    def close(self) -> None:
        """Closes the ledger and gives the transcript its name; a second call does nothing."""
        self._ledger.close()
        if not self._stream.closed:
            self._stream.close()
            os.replace(self._partial, self.path / TRANSCRIPT)


def fresh_folder(parent: str | Path, name: str) -> Path:
    """Makes and returns ``parent/NAME-1``, or the first free number after it.

    Raises:
        InputError: if ``parent`` cannot be written.
    """
    parent = Path(parent)
    number = 1
    while True:
        path = parent / f"{name}-{number}"
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            if not parent.is_dir():
                raise _unusable(parent, "is a file") from None
            number += 1
        except OSError as error:
            raise _unusable(path, error.strerror or str(error)) from None
        else:
            return path


def _prepare(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
        entries = next(path.iterdir(), None)
    except OSError as error:
        raise _unusable(path, error.strerror or str(error)) from None
    if entries is not None:
        raise InputError(
            f"--out: the folder {str(path)!r} is not empty (it holds {entries.name!r}); "
            "name a new or an empty one: results are never overwritten."
        )
    if not os.access(path, os.W_OK | os.X_OK):
        raise _unusable(path, "permission denied")


def _unusable(path: Path, why: str) -> InputError:
    return InputError(
        f"--out: the folder {str(path)!r} cannot be used ({why}); name one that can be written."
    )
