"""From the lines of a transcript back to messages, as far as they can be read."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pydantic

from unilavira_drake.errors import InputError
from unilavira_drake.messages import Frame, Intrinsics, Message, OccupancyMap, Outcome, Panorama
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables
from unilavira_drake.recording.recorder import GROUNDER_PORTS, PORTS
from unilavira_drake.recording.run_folder import TRANSCRIPT

_TYPES = {
    (system, event): type(default) for system, event, default in (PORTS | GROUNDER_PORTS).values()
}
_TOLD = 3
"""Broken lines that are told one by one."""


@dataclass(frozen=True)
class MapNote(Message):
    """Where the occupancy map of panorama ``n`` lies, and its picture's SHA-256."""

    n: int = 0
    resolution: float = 0.05
    origin: tuple[float, float] = (0.0, 0.0)
    shape: tuple[int, int] = (0, 0)
    image: str = ""


@dataclass(frozen=True)
class Entry:
    """One line: simulated seconds, who said it, and the message.

    The pictures of a panorama stand as their SHA-256, in ASCII; requests are without theirs.
    """

    t: float
    system: str
    event: str
    message: Any


@dataclass(frozen=True)
class Transcript:
    """What could be read, and sentences about what could not."""

    entries: tuple[Entry, ...] = ()
    problems: tuple[str, ...] = ()


def read_transcript(folder: Path) -> Transcript:
    """Reads the transcript of a run folder, also that of a run that was killed.

    Lines of systems that this version does not know are left out.

    Raises:
        InputError: if the folder holds no transcript, or one without a readable line.
    """
    path, problems = _find(folder)
    try:
        text = path.read_bytes().decode("utf-8", "replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from None
    # Not splitlines: a text may hold other line ends, which JSON leaves as they are.
    lines = text.removesuffix("\n").split("\n") if text else []
    entries, broken = [], []
    for number, line in enumerate(lines, start=1):
        try:
            entry = _entry(json.loads(line))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            broken.append(f"{path.name}, line {number}: {_reason(error)}; it is left out.")
            continue
        if entry is not None:
            entries.append(entry)
    if lines and len(broken) == len(lines):
        raise InputError(
            f"{path}: none of its {len(lines)} lines is one of a transcript; give the folder of a "
            "run."
        )
    problems += broken[:_TOLD]
    if len(broken) > _TOLD:
        problems.append(f"{path.name}: {len(broken) - _TOLD} more lines cannot be read.")
    return Transcript(tuple(entries), tuple(problems))


def _find(folder: Path) -> tuple[Path, list[str]]:
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "does not exist"
        raise InputError(
            f"report: {str(folder)!r} {what}; give the run folder that 'unilavira run' printed."
        )
    path, partial = folder / TRANSCRIPT, folder / f"{TRANSCRIPT}.partial"
    if path.is_file():
        return path, []
    if partial.is_file():
        return partial, [
            f"The run did not end: it was killed or still goes on ({partial.name} is there, "
            f"{TRANSCRIPT} is not)."
        ]
    raise InputError(
        f"report: {str(folder)!r} is no run folder: it holds neither {TRANSCRIPT} nor "
        f"{partial.name}; give the folder that 'unilavira run' printed."
    )


def _entry(line: dict[str, Any]) -> Entry | None:
    system, event, data = line["system"], line["event"], line["data"]
    t = float(line["t"])
    kind = _TYPES.get((system, event))
    if kind is None:
        return None
    readers = {Panorama: _panorama, OccupancyMap: _map, MllmRequest: _request}
    read = readers.get(kind)
    message = read(data) if read is not None else _typed(kind, data)
    return Entry(t, system, event, message)


@functools.cache
def _adapter(kind: type) -> pydantic.TypeAdapter[Any]:
    return pydantic.TypeAdapter(kind)


def _typed(kind: type, data: dict[str, Any]) -> Any:
    return _adapter(kind).validate_python(data)


def _map(data: dict[str, Any]) -> MapNote:
    note: MapNote = _typed(MapNote, data)
    return note


def _panorama(data: dict[str, Any]) -> Panorama:
    frames = tuple(
        Frame(
            view=str(frame["view"]),
            time=float(frame["time"]),
            jpeg=str(frame["jpeg"]).encode("ascii"),
            intrinsics=_typed(Intrinsics, frame["intrinsics"]),
            X_WC=np.array(frame["X_WC"], float).reshape(4, 4),
        )
        for frame in data["frames"]
    )
    return Panorama(
        n=int(data["n"]),
        first=int(data["first"]),
        time=float(data["time"]),
        X_WB=np.array(data["X_WB"], float).reshape(4, 4),
        frames=frames,
        outcome=_typed(Outcome, data["outcome"]),
    )


def _request(data: dict[str, Any]) -> MllmRequest:
    variables = VisionVariables if data["role"] == "vision" else LanguageVariables
    return MllmRequest(
        role=str(data["role"]),
        n=int(data["n"]),
        attempt=int(data["attempt"]),
        call=str(data["call"]),
        variables=_typed(variables, data["variables"]),
        feedback=str(data["feedback"]),
    )


def _reason(error: Exception) -> str:
    if isinstance(error, json.JSONDecodeError):
        return "not JSON, or cut off"
    if isinstance(error, pydantic.ValidationError):
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        return f"{place}: {first['msg'].lower()}" if place else str(first["msg"]).lower()
    if isinstance(error, KeyError):
        return f"the key {error} is missing"
    return "not a line of a transcript"
