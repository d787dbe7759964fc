"""Few matte materials out of many: near colours become one, slivers take their neighbour's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from furniture_conversion.shape import triangle_areas
from furniture_conversion.wavefront import Part

_NEAR = 0.07
_SLIVER = 0.004
_GLASS = np.array([0.74, 0.82, 0.86])

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """One matte material: a colour as shown on a screen, times a picture."""

    color: Color
    texture: Path | None = None


@dataclass(frozen=True)
class Group:
    """All triangles of a model that share a material."""

    material: Material
    part: Part
    area: float


def merge(parts: list[Part], colors: Mapping[str, Sequence[float]]) -> list[Group]:
    """Returns the parts grouped by material, the largest area first.

    Args:
        parts: of one model.
        colors: material name -> the colour it gets instead of its own.
    """
    groups: list[Group] = []
    for part in parts:
        area = float(triangle_areas(part.positions).sum())
        groups.append(Group(_matte(part, colors), part, area))
    groups.sort(key=lambda group: -group.area)
    total = sum(group.area for group in groups)
    merged: list[Group] = []
    for group in groups:
        host = _host(group, merged, group.area < _SLIVER * total)
        if host is None:
            merged.append(group)
        else:
            merged[host] = _join(merged[host], group)
    return sorted(merged, key=lambda group: -group.area)


def _matte(part: Part, colors: Mapping[str, Sequence[float]]) -> Material:
    source = part.material
    if source.name in colors:
        red, green, blue = (float(value) for value in colors[source.name])
        return Material((red, green, blue))
    if source.texture is not None:
        return Material((1.0, 1.0, 1.0), source.texture)
    # Panes stay opaque: a camera that sees depth and labels sees them so too.
    color = np.clip(source.color, 0.0, 1.0)
    color = source.opacity * color + (1.0 - source.opacity) * _GLASS
    red, green, blue = np.clip(color, 0.02, 0.95).round(3).tolist()
    return Material((red, green, blue))


def _host(group: Group, merged: list[Group], sliver: bool) -> int | None:
    best, nearest = None, 0.5 if sliver else _NEAR
    for i, other in enumerate(merged):
        if group.material.texture is not None or other.material.texture is not None:
            if group.material.texture == other.material.texture:
                return i
            continue
        distance = float(np.abs(np.subtract(group.material.color, other.material.color)).max())
        if distance < nearest:
            best, nearest = i, distance
    return best


def _join(a: Group, b: Group) -> Group:
    part = Part(
        a.part.material,
        np.concatenate((a.part.positions, b.part.positions)),
        np.concatenate((a.part.normals, b.part.normals)),
        np.concatenate((a.part.uv, b.part.uv)),
    )
    return Group(a.material, part, a.area + b.area)


def shrunk(texture: Path, side: int) -> bytes:
    """Returns a picture as JPEG of at most ``side`` pixels a side.

    Raises:
        ValueError: if it cannot be read.
    """
    read: Any = cv2.imread(str(texture), cv2.IMREAD_UNCHANGED)
    if read is None:
        raise ValueError(f"{texture}: not a picture that can be read.")
    image = _eight_bit(read)
    factor = side / max(image.shape[:2])
    if factor < 1.0:
        size = (max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor)))
        image = _eight_bit(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    opaque: Any = _filled(image) if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    return cv2.imencode(".jpg", opaque, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()


def _filled(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Fills holes with the mean colour of the rest: VTK takes minutes for see-through pictures."""
    if image.shape[2] < 4 or not (image[..., 3] > 127).any():
        return image[..., :3]
    seen = image[..., 3:] / 255.0
    mean = image[image[..., 3] > 127][:, :3].mean(axis=0)
    filled: NDArray[np.uint8] = np.round(seen * image[..., :3] + (1.0 - seen) * mean).astype(
        np.uint8
    )
    return filled


def _eight_bit(image: Any) -> NDArray[np.uint8]:
    wide = image.dtype == np.uint16
    narrow: NDArray[np.uint8] = (image // 257 if wide else image).astype(np.uint8)
    return narrow
