"""The library of furniture as it is shipped."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    GeometryId,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo, ImageLabel16I, ImageRgba8U

from unilavira_drake.errors import ScenarioError
from unilavira_drake.sensors.color_names import COLOR_WORDS, color_indices
from unilavira_drake.worlds.furniture_library import (
    FurnitureModel,
    furniture_licences,
    furniture_mesh,
    furniture_model,
    furniture_models,
    furniture_path,
)
from unilavira_drake.worlds.palette import PALETTE

_TRADE_MARKS = re.compile(
    r"apple|i[- ]?mac|i[- ]?phone|i[- ]?pad|peugeot|renault|\bvw\b|volkswagen|\bford\b|"
    r"\bseat (leon|ibiza)|\bsmart\b|yamaha|chevrolet|playstation|rubi[kx]|ikea|samsung|"
    r"microlab|kitchenaid|thonet|audi\b|mercedes|\bge-",
    re.IGNORECASE,
)


def _document(model: FurnitureModel) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(model.path.read_text(encoding="utf-8"))
    return document


def _attribution() -> dict[str, dict[str, str]]:
    with (furniture_path() / "ATTRIBUTION.csv").open(encoding="utf-8", newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def test_library_is_broad_and_small() -> None:
    models = furniture_models()
    assert 80 <= len(models) <= 120
    assert len({model.category for model in models.values()}) >= 35
    files = [path for path in furniture_path().rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 12e6
    folders = {path.name for path in furniture_path().iterdir() if path.is_dir()}
    assert folders == set(models)


@pytest.mark.parametrize(
    ("category", "count"),
    [("chair", 4), ("sofa", 3), ("armchair", 3), ("table", 4), ("bed", 3), ("plant", 4)],
)
def test_common_classes_have_variants(category: str, count: int) -> None:
    assert sum(model.category == category for model in furniture_models().values()) >= count


def test_lamps_and_shelves_have_variants() -> None:
    categories = [model.category for model in furniture_models().values()]
    assert sum(category.endswith("lamp") for category in categories) >= 4
    assert sum(category in ("bookshelf", "cabinet") for category in categories) >= 3


@pytest.mark.parametrize("name", sorted(furniture_models()))
def test_model_is_what_the_catalogue_says(name: str) -> None:
    model = furniture_model(name, "test")
    document = _document(model)
    accessors = document["accessors"]
    primitives = document["meshes"][0]["primitives"]
    triangles = sum(accessors[p["indices"]]["count"] // 3 for p in primitives)
    assert triangles == model.triangles <= 5000
    positions = [accessors[p["attributes"]["POSITION"]] for p in primitives]
    low = np.min([accessor["min"] for accessor in positions], axis=0)
    high = np.max([accessor["max"] for accessor in positions], axis=0)
    # Drake turns glTF's y up to z up: (x, y, z) -> (x, -z, y).
    low_M, high_M = (low[0], -high[2], low[1]), (high[0], -low[2], high[1])
    length, width, height = model.size
    expected_low = (-length / 2, -width / 2, model.elevation)
    expected_high = (length / 2, width / 2, model.elevation + height)
    np.testing.assert_allclose(low_M, expected_low, atol=0.01)
    np.testing.assert_allclose(high_M, expected_high, atol=0.01)
    assert model.color in PALETTE
    if model.support_height is not None:
        assert model.elevation < model.support_height <= model.elevation + height + 0.01


@pytest.mark.parametrize("name", sorted(furniture_models()))
def test_materials_are_matte_and_one_is_main(name: str) -> None:
    materials = _document(furniture_model(name, "test"))["materials"]
    for material in materials:
        assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
        assert material["pbrMetallicRoughness"]["roughnessFactor"] >= 0.8
        assert material["doubleSided"]
        # VTK takes minutes for see-through pictures.
        assert material.get("alphaMode", "OPAQUE") == "OPAQUE"
    assert sum(material["extras"]["main"] for material in materials) == 1


@pytest.mark.parametrize("name", sorted(furniture_models()))
def test_triangles_wind_as_their_normals_point(name: str) -> None:
    model = furniture_model(name, "test")
    document = _document(model)
    blob = (model.path.parent / document["buffers"][0]["uri"]).read_bytes()

    def read(index: int, dtype: str) -> np.ndarray[Any, Any]:
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        count = accessor["count"] * width
        return np.frombuffer(blob, dtype, count, view["byteOffset"]).reshape(-1, width)

    for primitive in document["meshes"][0]["primitives"]:
        points = read(primitive["attributes"]["POSITION"], "<f4")
        normals = read(primitive["attributes"]["NORMAL"], "<f4")
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-3)
        short = document["accessors"][primitive["indices"]]["componentType"] == 5123
        triangles = read(primitive["indices"], "<u2" if short else "<u4").reshape(-1, 3)
        a, b, c = (points[triangles[:, i]].astype(float) for i in range(3))
        faces = np.cross(b - a, c - a)
        agreement = np.einsum("ij,ij->i", faces, normals[triangles].sum(axis=1))
        area = np.linalg.norm(faces, axis=1)
        assert area[agreement < 0].sum() < 0.005 * area.sum()


def test_every_model_is_attributed() -> None:
    rows = _attribution()
    assert set(rows) == set(furniture_models()) == set(furniture_licences())
    uris = {
        "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
        "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
    }
    for row in rows.values():
        assert row["licence_uri"] == uris[row["licence"]]
        for field in ("title", "author", "source", "library", "changes"):
            assert row[field].strip(), (row["name"], field)


def test_licence_texts_are_complete() -> None:
    by = (furniture_path() / "LICENSE-CC-BY-3.0.txt").read_text(encoding="utf-8")
    zero = (furniture_path() / "LICENSE-CC0.txt").read_text(encoding="utf-8")
    assert "Attribution 3.0 Unported" in by
    assert "7. Termination" in by
    assert "CC0 1.0 Universal" in zero
    assert "Public License Fallback" in zero


def test_no_trade_marks() -> None:
    for name, row in _attribution().items():
        words = " ".join((name, furniture_models()[name].category, row["title"], row["library"]))
        assert not _TRADE_MARKS.search(words), words


def test_unknown_name_names_the_nearest() -> None:
    with pytest.raises(ScenarioError, match=r"apartment\.yaml: unknown furniture .*'monitor'"):
        furniture_model("monitr", "apartment.yaml")


def test_catalogue_is_read_only() -> None:
    with pytest.raises(TypeError):
        furniture_models()["x"] = furniture_models()["monitor"]  # type: ignore[index]


# Untextured, textured, and nearly black of itself.
@pytest.mark.parametrize(
    ("name", "color"),
    [("armchair_padded", "green"), ("desk_simple", "blue"), ("sofa_corner", "red")],
)
def test_recoloured_model_is_seen_in_the_colour(name: str, color: str) -> None:
    model = furniture_model(name, "test")
    assert model.color != color
    assert _seen_color(furniture_mesh(model), model) == model.color
    assert _seen_color(furniture_mesh(model, color), model) == color


def _seen_color(mesh: Mesh, model: FurnitureModel) -> str:
    # White square to a light of strength pi is white.
    light = LightParameter(
        type="directional", frame="camera", direction=[0.3, 0.3, 1.0], intensity=0.9 * math.pi
    )
    engine = MakeRenderEngineVtk(RenderEngineVtkParams(lights=[light], backend="EGL"))
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    engine.RegisterVisual(GeometryId.get_new_id(), mesh, properties, RigidTransform(), False)
    R_WC = RotationMatrix(np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]))
    middle = model.elevation + model.size[2] / 2
    engine.UpdateViewpoint(RigidTransform(R_WC, [2.0 * max(model.size), 0.0, middle]))
    core = RenderCameraCore(
        "default", CameraInfo(96, 96, 0.7), ClippingRange(0.01, 50.0), RigidTransform()
    )
    camera = ColorRenderCamera(core, False)
    color, label = ImageRgba8U(96, 96), ImageLabel16I(96, 96)
    engine.RenderColorImage(camera, color)
    engine.RenderLabelImage(camera, label)
    seen = color.data[..., :3][label.data[..., 0] == 1]
    assert len(seen) > 300
    votes = np.bincount(color_indices(seen), minlength=len(COLOR_WORDS))
    return COLOR_WORDS[int(np.argmax(votes))]


def test_files_named_by_a_model_exist() -> None:
    for model in furniture_models().values():
        document = _document(model)
        uris = [entry["uri"] for entry in (*document["buffers"], *document.get("images", ()))]
        assert {Path(uri).name for uri in uris} == set(uris)
        assert {*uris, model.path.name} == {path.name for path in model.path.parent.iterdir()}
