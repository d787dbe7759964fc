"""All triangles of a scene in one buffer, drawn by one call for each picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.raster.stage import Stage
from unilavira_drake.raster.surface import Model, Surface

COMMAND = np.dtype(
    [
        ("count", "<u4"),
        ("instances", "<u4"),
        ("first_index", "<u4"),
        ("base_vertex", "<i4"),
        ("instance", "<u4"),
    ]
)
"""OpenGL's indirect draw of one surface of one geometry."""

INSTANCE = np.dtype([("rows", "<f4", (3, 4)), ("tint", "<f4", 4), ("label", "<i4")])
"""One geometry: its pose, relative to the camera's position in world axes; sRGB colour and the
exponent of light; label."""

_VERTEX_FIELDS = (
    ("position", "3f", 12),
    ("normal", "4f1", 4),
    ("uv", "2f", 8),
    ("color", "4f1", 4),
)
_INSTANCE_FIELDS = (
    ("row_x", "4f", 16),
    ("row_y", "4f", 16),
    ("row_z", "4f", 16),
    ("tint", "4f", 16),
    ("label", "1i", 4),
)


@dataclass(frozen=True)
class Range:
    """Where a surface lies in the buffers."""

    first_index: int
    count: int
    base_vertex: int


class Batch:
    """The buffers of some models: one copy in a process, whoever shows them."""

    def __init__(self, stage: Stage, models: tuple[Model, ...]) -> None:
        surfaces = [surface for model in models for surface in model.surfaces]
        self.ranges: dict[str, list[Range]] = {}
        first_index = base_vertex = 0
        for model in models:
            ranges = self.ranges[model.key] = []
            for surface in model.surfaces:
                ranges.append(Range(first_index, surface.triangles.size, base_vertex))
                first_index += surface.triangles.size
                base_vertex += len(surface.vertices)
        with stage.current() as context:
            self.vertices = context.buffer(_joined([part.vertices for part in surfaces]))
            self.indices = context.buffer(_joined([part.triangles.ravel() for part in surfaces]))
            self.textures = {
                surface.texture.key: stage.texture(surface.texture)
                for surface in surfaces
                if surface.texture
            }


def shared_batch(stage: Stage, models: tuple[Model, ...]) -> Batch:
    """Returns the batch of some distinct models, made by the first who shows them."""
    key = tuple(model.key for model in models)
    batch: Batch | None = stage.batches.get(key)
    if batch is None:
        batch = Batch(stage, models)
        stage.batches[key] = batch
    return batch


def vertex_array(stage: Stage, program: Any, batch: Batch, instances: Any) -> Any:
    """Returns the buffers as a program reads them."""
    with stage.current() as context:
        return context.vertex_array(
            program,
            [
                _layout(program, batch.vertices, _VERTEX_FIELDS, ""),
                _layout(program, instances, _INSTANCE_FIELDS, "/i"),
            ],
            batch.indices,
        )


def _layout(
    program: Any, buffer: Any, fields: tuple[tuple[str, str, int], ...], rate: str
) -> tuple[Any, ...]:
    """Returns a buffer's layout; fields that the program does not read are skipped."""
    used = [name for name, _, _ in fields if name in program]
    parts = [code if name in program else f"{size}x" for name, code, size in fields]
    return (buffer, " ".join(parts) + rate, *used)


def bounds(surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the middle and half edges of a surface's box, each (3,)."""
    position = surface.vertices["position"]
    low, high = position.min(axis=0).astype(float), position.max(axis=0).astype(float)
    return (low + high) / 2.0, (high - low) / 2.0


def _joined(arrays: list[NDArray[Any]]) -> NDArray[np.uint8]:
    # OpenGL has no empty buffers.
    nothing = np.zeros(64, np.uint8)
    return np.concatenate([array.view(np.uint8) for array in arrays]) if arrays else nothing
