"""Reads ``.sh3f`` libraries: a catalogue of furniture, its models and who made them."""

from __future__ import annotations

import html
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LICENCES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
}
"""The licences that a model may have, and their addresses."""

_LIBRARY_LICENCES = {
    "BlendSwap-CC-0": "CC0-1.0",
    "BlendSwap-CC-BY": "CC-BY-3.0",
    "Scopia": "CC-BY-3.0",
}
_LIBRARY_AUTHORS = {
    "Scopia": "Scopia Visual Interfaces Systems, s.l.; Emmanuel Puybaret / eTeks",
}
_LIBRARY_PAGES = {"Scopia": "http://www.scopia.es"}
_ENTRY = re.compile(r"(\w+)#(\d+)=(.*)")


@dataclass(frozen=True)
class Entry:
    """One piece of furniture in a library.  Lengths in metres."""

    library: str
    source_id: str
    title: str
    obj: Path
    width: float
    depth: float
    height: float
    elevation: float
    support: float | None
    """Height above its base at which things stand on it; ``None`` where nothing can."""
    rotation: NDArray[np.float64]
    """(3, 3) rotation of the model before it is scaled."""
    author: str
    page: str
    licence: str


def unpack(libraries: Path, folder: Path) -> dict[tuple[str, str], Entry]:
    """Unpacks every ``.sh3f`` file of a folder; returns (library, id) -> entry.

    Raises:
        FileNotFoundError: if there is none.
    """
    archives = sorted(libraries.glob("*.sh3f"))
    if not archives:
        raise FileNotFoundError(f"{libraries}: no .sh3f file.")
    entries: dict[tuple[str, str], Entry] = {}
    for archive in archives:
        target = folder / archive.stem
        with zipfile.ZipFile(archive) as content:
            content.extractall(target)
        for entry in _entries(archive.stem, target):
            entries[entry.library, entry.source_id] = entry
    return entries


def _entries(library: str, folder: Path) -> list[Entry]:
    fields: dict[int, dict[str, str]] = {}
    text = (folder / "PluginFurnitureCatalog.properties").read_text(encoding="latin-1")
    for line in text.splitlines():
        if match := _ENTRY.fullmatch(line.strip()):
            fields.setdefault(int(match[2]), {})[match[1]] = match[3]
    return [
        _entry(library, folder, values)
        for _, values in sorted(fields.items())
        if "model" in values and (folder / values["model"].lstrip("/")).is_file()
    ]


def _entry(library: str, folder: Path, values: dict[str, str]) -> Entry:
    obj = folder / values["model"].lstrip("/")
    height = float(values["height"]) / 100
    top = float(values.get("dropOnTopElevation", 100 * height)) / 100
    rotation = [float(word) for word in values.get("modelRotation", "1 0 0 0 1 0 0 0 1").split()]
    title, author, page = _origin(library, obj.parent, values)
    return Entry(
        library=library,
        source_id=values["id"].rpartition("#")[2],
        title=title,
        obj=obj,
        width=float(values["width"]) / 100,
        depth=float(values["depth"]) / 100,
        height=height,
        elevation=float(values.get("elevation", 0.0)) / 100,
        support=top if top > 0 else None,
        rotation=np.array(rotation).reshape(3, 3),
        author=author,
        page=page,
        licence=_licence(library),
    )


def _licence(library: str) -> str:
    """Returns the licence of a library; one that is not known must not be guessed.

    Raises:
        ValueError: if the library is unknown.
    """
    if library not in _LIBRARY_LICENCES:
        known = ", ".join(sorted(_LIBRARY_LICENCES))
        raise ValueError(f"{library}: its licence is not known; use {known}, or add it here.")
    return _LIBRARY_LICENCES[library]


def _origin(library: str, folder: Path, values: dict[str, str]) -> tuple[str, str, str]:
    """Returns title, author and page as the model's own licence note states them."""
    title, author = values["name"], values.get("creator", "")
    author = _LIBRARY_AUTHORS.get(library, author)
    page = _LIBRARY_PAGES.get(library, "http://www.sweethome3d.com")
    for note in sorted(folder.glob("*LICENSE*")):
        raw = note.read_text(encoding="utf-8", errors="replace")
        text = html.unescape(re.sub(r"<[^>]*>", " ", raw))
        if match := re.search(r'downloading "(.+?)" by (.+)', text):
            title, author = " ".join(match[1].split()), match[2].strip()
        elif match := re.search(r"Blend #\d+: (.+?)\s{2,}|\d+ - (.+?) - Downloaded", text):
            title = " ".join((match[1] or match[2]).split())
        if match := re.search(r"https?://www\.blendswap\.com/blends/view/\d+", raw):
            page = match[0]
    if _LIBRARY_LICENCES.get(library) == "CC0-1.0":
        # Nothing obliges to repeat an author's title, which may be a product's name.
        title = values["name"]
    return title, author, page
