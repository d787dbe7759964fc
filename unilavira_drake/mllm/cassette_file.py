"""Reading and writing the files of cassettes."""

from __future__ import annotations

import dataclasses
import json
import os
import threading
from pathlib import Path
from typing import Any

import pydantic

from unilavira_drake.errors import CassetteError, ScenarioError
from unilavira_drake.mllm.cassette import (
    VERSION,
    CassetteHeader,
    Key,
    RecordedModel,
    RecordedReply,
    key_of,
    named,
)
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import MllmRequest

RECORD_MODES = ("record", "record_new")
_NEAREST = 3


class Replies:
    """The replies of a cassette by their key.

    Args:
        place: how messages call the cassette.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self._replies: dict[Key, RecordedReply] = {}

    def __len__(self) -> int:
        return len(self._replies)

    def add(self, reply: RecordedReply) -> None:
        """Adds a reply; it replaces an older one of its key."""
        self._replies[reply.key] = reply

    def find(self, request: MllmRequest) -> RecordedReply | None:
        """Returns the reply with the key of a request, whatever its prompt."""
        return self._replies.get(key_of(request))

    def missing(self, request: MllmRequest) -> CassetteError:
        """Returns the error that says what there is instead of a reply to a request."""
        asked = key_of(request)
        near = sorted(self._replies, key=lambda key: (_distance(key, asked), key))[:_NEAREST]
        nearest = "; ".join(f"{named(key)} ({self._replies[key].call})" for key in near)
        return CassetteError(
            f"{self.place}: no reply to {named(asked)} ({request.call}); "
            f"the nearest of its {len(self)}: {nearest or 'none'}."
        )


def _check_continued(path: Path, old: CassetteHeader, new: CassetteHeader) -> None:
    """One cassette tells of the same models and one preset, or it would name the wrong ones."""
    for what in ("language", "vision", "judge", "preset"):
        recorded, asked = getattr(old, what), getattr(new, what)
        if recorded != asked:
            raise ScenarioError(
                f"record: {str(path)!r} was recorded with {what} {_named(recorded)}, this is "
                f"{_named(asked)}; go on with the same, or name a new file."
            )


def _named(value: RecordedModel | str | None) -> str:
    if isinstance(value, RecordedModel):
        return f"{value.name} ({value.perception})"
    return value or "none"


class CassetteWriter:
    """Appends replies to a cassette, from any thread; the file is made with the first reply.

    ``replies`` are those that the file holds.

    Args:
        path: the file.
        header: of a new file.
        mode: ``record`` makes a new file, ``record_new`` continues one that exists.

    Raises:
        ScenarioError: if the mode is ``record`` and the file exists, if it cannot be written, or
            if the file to continue is no cassette.
        CassetteError: if a line of the file to continue is broken.
    """

    def __init__(self, path: Path, *, header: CassetteHeader, mode: str = "record") -> None:
        self._path = path
        self._header = header
        self._lock = threading.Lock()
        self.replies = Replies(path.name)
        if path.exists():
            if mode == "record":
                raise ScenarioError(
                    f"record: {str(path)!r} exists; name a new file, or set "
                    "record_mode=record_new to add to it."
                )
            _check_continued(path, read_header(path), header)
            self.replies = read_replies(path)
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        if not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
            raise ScenarioError(f"record: {str(path)!r} cannot be written; name another file.")

    def append(self, reply: RecordedReply) -> None:
        """Adds a reply in one write.

        Raises:
            OSError: if the file cannot be written.
        """
        with self._lock:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a+b", buffering=0) as stream:
                new = _cut_torn_line(stream) == 0
                stream.write((_line(self._header) if new else b"") + _line(reply))
                os.fsync(stream.fileno())
            self.replies.add(reply)


def read_header(path: Path) -> CassetteHeader:
    """Returns the header of a cassette.

    Raises:
        ScenarioError: if there is no such file, or it is no cassette of this version.
    """
    place = f"cassette {str(path)!r}"
    try:
        with path.open(encoding="utf-8") as stream:
            data = json.loads(stream.readline())
        version = data["cassette"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else "it is no cassette"
        raise ScenarioError(f"{place}: {why}; name a file that --record has written.") from None
    if version != VERSION:
        raise ScenarioError(f"{place}: its version is {version!r}, this program reads {VERSION}.")
    try:
        return CassetteHeader.model_validate(data)
    except pydantic.ValidationError as error:
        raise ScenarioError(f"{place}: its header is broken: {_first(error)}.") from None


def read_replies(path: Path) -> Replies:
    """Returns the replies of a cassette; a torn last line is left out.

    Raises:
        CassetteError: if the file cannot be read or a line is broken.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise CassetteError(f"{path}: cannot be read: {error.strerror or error}.") from None
    replies = Replies(path.name)
    for number, line in enumerate(lines[1:-1], start=2):
        try:
            replies.add(RecordedReply.model_validate(json.loads(line)))
        except pydantic.ValidationError as error:
            raise CassetteError(f"{path}, line {number}: {_first(error)}.") from None
        except ValueError as error:
            raise CassetteError(f"{path}, line {number}: no JSON: {error}.") from None
    return replies


def _first(error: pydantic.ValidationError) -> str:
    problem = error.errors()[0]
    return f"{'.'.join(map(str, problem['loc'])) or 'the line'}: {problem['msg']}"


def _cut_torn_line(stream: Any) -> int:
    """Cuts off what follows the last whole line and returns the size that is left, in bytes."""
    size: int = stream.seek(0, os.SEEK_END)
    if size == 0:
        return 0
    stream.seek(size - 1)
    if stream.read(1) == b"\n":
        return size
    stream.seek(0)
    whole: int = stream.read().rfind(b"\n") + 1
    stream.truncate(whole)
    return whole


def _line(record: pydantic.BaseModel) -> bytes:
    data = {
        name: dataclasses.asdict(value) if isinstance(value, Usage) else value
        for name, value in record
    }
    text = json.dumps(data, ensure_ascii=False, default=dict)
    # Half a surrogate pair in a reply has no UTF-8; its escape is JSON, too.
    return text.encode("utf-8", "backslashreplace") + b"\n"


def _distance(key: Key, asked: Key) -> int:
    apart = abs(key[1] - asked[1]) + abs(key[2] - asked[2])
    return 1000 * (key[0] != asked[0]) + 1000 * (key[3] != asked[3]) + apart
