#!/usr/bin/env python3
"""Converts furniture libraries (``.sh3f``) into the models of ``models/furniture``.

The libraries are those of Debian's package ``sweethome3d-furniture``:

    apt-get download sweethome3d-furniture && dpkg-deb -x sweethome3d-furniture_*.deb unpacked
    python tools/convert_furniture.py unpacked/usr/share/sweethome3d/furniture

Which models are taken, and what they are called, stands in ``furniture_selection.yaml``; add lines
for more, or take everything with ``--all``.  Models that have to lose triangles need the package
``fast-simplification``.
"""

from __future__ import annotations

import argparse
import csv
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parent))

from furniture_conversion.catalogue import LICENCES, Entry, unpack
from furniture_conversion.color import mark_main, measured_color
from furniture_conversion.decimation import thin_out
from furniture_conversion.gltf import write_gltf
from furniture_conversion.materials import merge
from furniture_conversion.parts import collision_parts
from furniture_conversion.shape import clean, extent, fit, place
from furniture_conversion.wavefront import Part, read_obj

_HERE = Path(__file__).resolve().parent
_LOWEST_SUPPORT = 0.2
"""What the libraries give below that is a dish's or a bag's bottom, metres."""
_COLUMNS = ("name", "title", "author", "source", "library", "licence", "licence_uri", "changes")


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = argparse.ArgumentParser(description="Converts .sh3f furniture into glTF models.")
    parser.add_argument("libraries", type=Path, help="folder with .sh3f files")
    parser.add_argument("--selection", type=Path, default=_HERE / "furniture_selection.yaml")
    parser.add_argument("--out", type=Path, default=_HERE.parent / "models" / "furniture")
    parser.add_argument("--all", action="store_true", help="every model, not the selection")
    parser.add_argument("--only", nargs="*", metavar="NAME", help="these of the selection alone")
    parser.add_argument("--triangles", type=int, default=5000, help="at most, for a model")
    parser.add_argument("--texture", type=int, default=256, help="pixels a side, at most")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        entries = unpack(options.libraries, Path(folder))
        lines = _everything(entries) if options.all else _selection(options.selection)
        wanted = [line for line in lines if not options.only or line["name"] in options.only]
        rows = [_convert(line, entries, options) for line in wanted]
    _write_tables(options.out, [row for row in rows if row is not None])
    return 0


def _selection(path: Path) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = yaml.safe_load(path.read_text(encoding="utf-8"))["models"]
    names = [line["name"] for line in lines]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise SystemExit(f"{path}: names used twice: {', '.join(sorted(repeated))}")
    return lines


def _everything(entries: dict[tuple[str, str], Entry]) -> list[dict[str, Any]]:
    lines = []
    for library, source_id in sorted(entries):
        word = re.sub(r"\W+", "_", f"{library}_{source_id}").lower()
        category = entries[library, source_id].title.lower()
        lines.append({"name": word, "category": category, "library": library, "id": source_id})
    return lines


def _convert(
    line: dict[str, Any], entries: dict[tuple[str, str], Entry], options: argparse.Namespace
) -> dict[str, Any] | None:
    """Writes one model; returns its rows of the catalogue and of the attribution."""
    folder = options.out / line["name"]
    entry = entries.get((line["library"], line["id"]))
    if entry is None:
        print(f"{line['name']}: not in {line['library']!r}. Left out.", file=sys.stderr)
        return None
    try:
        parts, before = _shape(line, entry, min(line.get("triangles", 10**9), options.triangles))
    except ValueError as error:
        print(f"{line['name']}: {error} Left out.", file=sys.stderr)
        return None
    side = int(line.get("texture", options.texture))
    groups = merge(parts, line.get("colors", {}))
    shutil.rmtree(folder, ignore_errors=True)
    triangles = write_gltf(folder, line["name"], groups, texture_side=side)
    low, high = extent(parts)
    size, elevation = (high - low).round(3).tolist(), round(float(low[2]), 3)
    top: float | None = line.get("support", entry.support)
    carried = None if top is None or top < _LOWEST_SUPPORT else round(top + elevation, 3)
    mark_main(folder / f"{line['name']}.gltf", size, elevation)
    color = measured_color(folder / f"{line['name']}.gltf", size, elevation)
    print(f"{line['name']}: {before} -> {triangles} triangles, {color}")
    catalogue = {
        "category": line["category"],
        "size": size,
        "elevation": elevation,
        "support_height": carried,
        "color": color,
        "triangles": triangles,
        "parts": _parts(parts),
    }
    attribution = {
        "name": line["name"],
        "title": line.get("title", entry.title),
        "author": entry.author,
        "source": entry.page,
        "library": f"{entry.library} ({entry.source_id})",
        "licence": entry.licence,
        "licence_uri": LICENCES[entry.licence],
        "changes": _changes(line, before, triangles),
    }
    return {"name": line["name"], "catalogue": catalogue, "attribution": attribution}


def _shape(line: dict[str, Any], entry: Entry, limit: int) -> tuple[list[Part], int]:
    """Returns a model's parts in its frame M and how many triangles the source has."""
    elevation = float(line.get("elevation", entry.elevation))
    source = read_obj(entry.obj)
    placed = place(source, entry, yaw=float(line.get("yaw", 0.0)), elevation=elevation)
    kept = [part for part in placed if part.material.name not in line.get("drop", ())]
    low, high = extent(kept)
    thinned = thin_out([part for part in map(clean, kept) if len(part.positions)], limit)
    return fit(thinned, low, high), sum(len(part.positions) for part in source)


def _parts(parts: list[Part]) -> list[list[float]]:
    corners = np.concatenate([part.positions.reshape(-1, 3) for part in parts])
    boxes = collision_parts(corners, np.arange(len(corners)).reshape(-1, 3))
    return [list(box) for box in boxes]


def _changes(line: dict[str, Any], before: int, after: int) -> str:
    notes = ["converted from OBJ to glTF", "scaled to metres", "materials merged and made matte"]
    if line.get("yaw"):
        notes.append(f"turned by {line['yaw']:g} degrees")
    if line.get("drop"):
        notes.append("some parts left out")
    if line.get("colors"):
        notes.append("some colours changed")
    if after < 0.97 * before:
        notes.append(f"reduced from {before} to {after} triangles")
    return ", ".join(notes)


def _write_tables(out: Path, rows: list[dict[str, Any]]) -> None:
    """Merges the rows into the catalogue and the attribution.

    A model leaves both when its folder is gone; nothing is deleted here.
    """
    out.mkdir(parents=True, exist_ok=True)
    catalogue_file, attribution_file = out / "catalogue.yaml", out / "ATTRIBUTION.csv"
    catalogue: dict[str, Any] = {}
    attribution: dict[str, dict[str, str]] = {}
    if catalogue_file.is_file() and attribution_file.is_file():
        catalogue = yaml.safe_load(catalogue_file.read_text(encoding="utf-8")) or {}
        with attribution_file.open(encoding="utf-8", newline="") as file:
            attribution = {row["name"]: row for row in csv.DictReader(file)}
    catalogue.update({row["name"]: row["catalogue"] for row in rows})
    attribution.update({row["name"]: row["attribution"] for row in rows})
    kept = sorted(name for name in catalogue if (out / name).is_dir())
    chosen = {name: catalogue[name] for name in kept}
    text = yaml.safe_dump(chosen, sort_keys=False, default_flow_style=None)
    catalogue_file.write_text(text, encoding="utf-8")
    with attribution_file.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(attribution[name] for name in kept)


if __name__ == "__main__":
    raise SystemExit(main())
