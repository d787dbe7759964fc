"""The converter on a library made by hand."""

from __future__ import annotations

import csv
import importlib
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

_TOOLS = Path(__file__).resolve().parents[2] / "tools"

# Width 2, height 1, depth 4 in units of its own; the top is a pentagon cut in on one side.
_OBJ = """mtllib box.mtl
v -1 0 -2\nv 1 0 -2\nv 1 0 2\nv -1 0 2\nv -1 1 -2\nv 1 1 -2\nv 1 1 2\nv -1 1 2\nv 0 1 0
usemtl wood
f 1 2 3 4
f 5 9 8 7 6
f 1 5 6 2
f 4 3 7 8
f 2 6 7 3
f 1 4 8 5
usemtl knob
f 1 2 5
"""
_MTL = "newmtl wood\nKd 0.5 0.25 0.1\nd 1.0\nnewmtl knob\nKd 0.1 0.1 0.1\n"
_CATALOGUE = """id=x
id#1=Scopia#box
name#1=Wooden box
category#1=Living room
model#1=/scopia/box/box.obj
width#1=60.0
depth#1=40.0
height#1=90.0
elevation#1=10
dropOnTopElevation#1=80
creator#1=Somebody
"""


@pytest.fixture
def libraries(tmp_path: Path) -> Path:
    folder = tmp_path / "libraries"
    folder.mkdir()
    with zipfile.ZipFile(folder / "Scopia.sh3f", "w") as archive:
        archive.writestr("PluginFurnitureCatalog.properties", _CATALOGUE)
        archive.writestr("scopia/box/box.obj", _OBJ)
        archive.writestr("scopia/box/box.mtl", _MTL)
    return folder


@pytest.fixture
def convert(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(_TOOLS))
    return importlib.import_module("convert_furniture").main


def _selection(folder: Path, **more: Any) -> Path:
    line = {"name": "box", "category": "box", "library": "Scopia", "id": "box", **more}
    path = folder / "selection.yaml"
    path.write_text(yaml.safe_dump({"models": [line]}), encoding="utf-8")
    return path


def _run(convert: Any, libraries: Path, *more: str, **fields: Any) -> Path:
    out = libraries.parent / "out"
    selection = _selection(libraries.parent, **fields)
    assert convert([str(libraries), "--selection", str(selection), "--out", str(out), *more]) == 0
    return out


def _positions(folder: Path, name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / name / f"{name}.gltf").read_text())
    return document


def test_box_gets_the_catalogues_size_in_our_frame(convert: Any, libraries: Path) -> None:
    out = _run(convert, libraries)
    entry = yaml.safe_load((out / "catalogue.yaml").read_text())["box"]
    # The library's depth is along our x: the front faces +x.
    assert entry["size"] == [0.4, 0.6, 0.9]
    assert entry["elevation"] == 0.1
    assert entry["support_height"] == pytest.approx(0.9)
    assert entry["color"] == "brown"
    document = _positions(out, "box")
    accessor = document["accessors"][0]
    np.testing.assert_allclose(accessor["min"], [-0.2, 0.1, -0.3], atol=1e-6)
    np.testing.assert_allclose(accessor["max"], [0.2, 1.0, 0.3], atol=1e-6)
    main = [material["extras"]["main"] for material in document["materials"]]
    assert main == [True, False]
    assert document["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0


def test_polygon_that_is_not_convex_keeps_its_area(convert: Any, libraries: Path) -> None:
    polygon = importlib.import_module("furniture_conversion.polygon")
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]], dtype=float)
    for turned in (points, points[::-1], points[:, [2, 0, 1]]):
        triangles = polygon.triangulated(turned)
        corners = turned[np.array(triangles)]
        edges = corners[:, 1:] - corners[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
        assert area == pytest.approx(10.0)
        assert len(triangles) == 3


def test_yaw_turns_the_size(convert: Any, libraries: Path) -> None:
    out = _run(convert, libraries, yaw=90)
    assert yaml.safe_load((out / "catalogue.yaml").read_text())["box"]["size"] == [0.6, 0.4, 0.9]


def test_attribution_names_author_licence_and_changes(convert: Any, libraries: Path) -> None:
    out = _run(convert, libraries)
    with (out / "ATTRIBUTION.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["title"] == "Wooden box"
    assert "Scopia" in row["author"]
    assert row["licence"] == "CC-BY-3.0"
    assert "glTF" in row["changes"]


def test_everything_takes_what_no_line_names(convert: Any, libraries: Path) -> None:
    out = _run(convert, libraries, "--all")
    assert list(yaml.safe_load((out / "catalogue.yaml").read_text())) == ["scopia_box"]


def test_missing_model_is_reported(
    convert: Any, libraries: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = _run(convert, libraries, id="chair")
    assert "box: not in 'Scopia'" in capsys.readouterr().err
    assert yaml.safe_load((out / "catalogue.yaml").read_text()) == {}
