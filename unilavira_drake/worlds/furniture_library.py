"""The library of furniture: models, what they are, and their meshes in any colour.

A model's frame M: z up, its origin the middle of its footprint on the floor, its front facing +x.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
import yaml
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.messages import Message
from unilavira_drake.resources import models_path
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import Box

_SHADING = 0.30
"""How far a picture's light and dark may change a colour that replaces the picture's own."""


@dataclass(frozen=True)
class FurnitureModel(Message):
    """One piece of furniture, in its frame M.  Lengths in metres."""

    name: str
    category: str
    """What a person calls it."""
    size: tuple[float, float, float]
    """Along x, y and z; the front faces +x."""
    elevation: float
    """Height of its lowest point above the floor; above zero for things on walls and ceilings."""
    support_height: float | None
    """Height above the floor of the surface that carries other things; ``None`` without one."""
    color: str
    """Colour word of most of what is seen of it."""
    triangles: int
    parts: tuple[Box, ...]
    """What a robot collides with: a few boxes that cover its outline seen from above."""

    @property
    def path(self) -> Path:
        """Its glTF file."""
        return furniture_path() / self.name / f"{self.name}.gltf"


def furniture_path() -> Path:
    """Returns the folder of the library.

    Raises:
        InfrastructureError: if the installation lacks its data.
    """
    return models_path() / "furniture"


@lru_cache(maxsize=1)
def furniture_models() -> Mapping[str, FurnitureModel]:
    """Returns name -> model of the whole library, by name."""
    text = (furniture_path() / "catalogue.yaml").read_text(encoding="utf-8")
    entries: dict[str, dict[str, Any]] = yaml.safe_load(text)
    models = {}
    for name, entry in sorted(entries.items()):
        length, width, height = (float(value) for value in entry["size"])
        support = entry["support_height"]
        models[name] = FurnitureModel(
            name=name,
            category=entry["category"],
            size=(length, width, height),
            elevation=float(entry["elevation"]),
            support_height=None if support is None else float(support),
            color=entry["color"],
            triangles=int(entry["triangles"]),
            parts=tuple(_part(*(float(value) for value in part)) for part in entry["parts"]),
        )
    return MappingProxyType(models)


def _part(x: float, y: float, z: float, length: float, width: float, height: float) -> Box:
    """Returns the box that stands on a point."""
    return Box((x, y, z + height / 2), (length, width, height))


def furniture_model(name: str, place: str) -> FurnitureModel:
    """Returns the model of a name; ``place`` says where the name stands, for the message.

    Raises:
        ScenarioError: if there is none, with the nearest name that there is.
    """
    models = furniture_models()
    if name not in models:
        raise ScenarioError(unknown_name("furniture model", name, models, place))
    return models[name]


@lru_cache(maxsize=1)
def furniture_licences() -> Mapping[str, str]:
    """Returns name -> licence of each model, as its attribution states it."""
    with (furniture_path() / "ATTRIBUTION.csv").open(encoding="utf-8", newline="") as file:
        return MappingProxyType({row["name"]: row["licence"] for row in csv.DictReader(file)})


def furniture_mesh(model: FurnitureModel, color: str | None = None) -> Mesh:
    """Returns the mesh of a model, in frame M.

    Args:
        model: of the library.
        color: a word of the palette that the model's main material gets in place of its own
            colour, or ``None`` for the model as it is.  Of a picture on that material only light
            and dark remain.

    Raises:
        KeyError: if the palette lacks the word.
    """
    if color is None:
        return Mesh(model.path, 1.0)
    return Mesh(mesh_data=_recolored(model, PALETTE[color]), scale=1.0)


def _recolored(model: FurnitureModel, color: tuple[float, float, float]) -> InMemoryMesh:
    document: dict[str, Any] = json.loads(model.path.read_text(encoding="utf-8"))
    uris = [entry["uri"] for entry in (*document["buffers"], *document.get("images", ()))]
    files = {uri: (model.path.parent / uri).read_bytes() for uri in uris}
    for material in document["materials"]:
        if not material["extras"]["main"]:
            continue
        matte = material["pbrMetallicRoughness"]
        matte["baseColorFactor"] = [*_linear(color), 1.0]
        if "baseColorTexture" in matte:
            source = document["textures"][matte["baseColorTexture"]["index"]]["source"]
            uri = document["images"][source]["uri"]
            files[uri] = _shading(files[uri])
    supporting = {
        uri: MemoryFile(data, Path(uri).suffix, uri) for uri, data in sorted(files.items())
    }
    text = json.dumps(document)
    return InMemoryMesh(
        mesh_file=MemoryFile(text, ".gltf", f"{model.name}.gltf"), supporting_files=supporting
    )


def _linear(color: tuple[float, float, float]) -> list[float]:
    """Returns a colour as on a screen in glTF's factors, which are linear in light."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color]


def _shading(picture: bytes) -> bytes:
    """Returns a picture's light and dark in gray, near white."""
    gray = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_GRAYSCALE)
    light = np.asarray(gray, dtype=np.float64) / 255.0
    spread = max(float(np.ptp(light)), 1.0 / 255.0)
    shade = 1.0 - min(_SHADING, spread) * (light.max() - light) / spread
    return cv2.imencode(".jpg", np.round(255.0 * shade).astype(np.uint8))[1].tobytes()
