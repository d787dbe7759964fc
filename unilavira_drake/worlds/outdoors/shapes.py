"""Plants, vehicles and street furniture of a few quads each.

A shape is a list of coloured solids in a frame whose z points up, whose origin is the middle of the
footprint on the ground, and whose front faces +x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from unilavira_drake.messages import Message
from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.outdoors.solids import (
    Quads,
    blob,
    box,
    gable,
    moved,
    prism,
    pyramid,
    standing,
)
from unilavira_drake.worlds.outdoors.things import Exterior, Place
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import Box

Part = tuple[str, Quads]
"""A swatch and what has its colour."""

SWATCHES = {
    "leaf_0": (0.24, 0.46, 0.18),
    "leaf_1": (0.29, 0.53, 0.21),
    "leaf_2": (0.35, 0.60, 0.25),
    "needle_0": (0.14, 0.34, 0.20),
    "needle_1": (0.18, 0.40, 0.24),
    "bark": (0.36, 0.26, 0.18),
    "tyre": (0.10, 0.10, 0.11),
    "window": (0.20, 0.25, 0.30),
    "metal": (0.42, 0.43, 0.45),
    "dark": (0.20, 0.21, 0.23),
    "light": (0.98, 0.96, 0.84),
    "wood": (0.52, 0.37, 0.23),
    "stone": (0.66, 0.65, 0.62),
    "water": (0.30, 0.55, 0.75),
    "canvas": (0.95, 0.94, 0.90),
    "rail": (0.70, 0.71, 0.72),
}
"""Name -> colour of a part; ``paint`` is the thing's own."""


@dataclass(frozen=True)
class Shape(Message):
    """A shape and what a robot collides with."""

    color: str
    """Colour word of most of what is seen of it."""
    parts: Callable[[np.random.Generator], list[Part]]
    boxes: tuple[Box, ...]
    painted: bool = False
    """Whether another colour word can be given."""


def shape_boxes(shape: str, place: Place) -> tuple[Box, ...]:
    """Returns the collision boxes of a shape at a place."""
    x, y, z, yaw = place
    c, s = np.cos(yaw), np.sin(yaw)
    boxes = []
    for part in SHAPES[shape].boxes:
        a, b, height = part.center
        center = (float(x + c * a - s * b), float(y + s * a + c * b), z + height)
        boxes.append(Box(center, part.size, yaw))
    return tuple(boxes)


def exterior_quads(thing: Exterior) -> TexturedQuads:
    """Returns the mesh of a thing, in the world."""
    shape = SHAPES[thing.shape]
    colors = dict(SWATCHES, paint=PALETTE[thing.color or shape.color])
    names = list(colors)
    corners, columns = [], []
    for index, place in enumerate(thing.places):
        generator = np.random.default_rng((thing.seed, index))
        for swatch, quads in shape.parts(generator):
            corners.append(moved(quads, place, mirrored=thing.mirrored))
            columns.append(np.full(len(quads), names.index(swatch)))
    count = 1 << (len(names) - 1).bit_length()
    picture = np.zeros((4, 4 * count, 3), np.uint8)
    for i, color in enumerate(colors.values()):
        picture[:, 4 * i : 4 * i + 4] = np.round(255.0 * np.array(color))
    u = (np.concatenate(columns) + 0.5) / count
    uv = np.stack((np.repeat(u[:, None], 4, axis=1), np.full((len(u), 4), 0.5)), axis=2)
    return TexturedQuads(np.concatenate(corners), uv, picture)


def _box(x: float, y: float, z: float, length: float, width: float, height: float) -> Box:
    return Box((x, y, z + height / 2), (length, width, height))


def _crown(
    middle: tuple[float, float, float],
    radii: tuple[float, float, float],
    generator: np.random.Generator,
) -> list[Part]:
    """A crown, dark below and light above."""
    quads = blob(middle, radii, generator)
    height = (quads[:, :, 2].mean(axis=1) - middle[2]) / radii[2]
    shade = np.clip(np.floor(1.5 * height + 1.5), 0, 2).astype(int)
    return [(f"leaf_{k}", quads[shade == k]) for k in range(3) if (shade == k).any()]


def _tree(generator: np.random.Generator) -> list[Part]:
    grow = generator.uniform(0.9, 1.15)
    return [
        ("bark", prism((0, 0, 0), (0.28, 0.18), 3.2 * grow, 5)),
        *_crown((0.0, 0.0, 5.2 * grow), (2.5, 2.5, 2.6), generator),
        *_crown((1.2, 0.6, 4.4 * grow), (1.5, 1.5, 1.4), generator),
        *_crown((-0.9, -1.1, 4.7 * grow), (1.6, 1.6, 1.5), generator),
    ]


def _poplar(generator: np.random.Generator) -> list[Part]:
    return [
        ("bark", prism((0, 0, 0), (0.22, 0.16), 2.0, 5)),
        *_crown((0.0, 0.0, 6.6), (1.15, 1.15, 5.2), generator),
    ]


def _conifer(generator: np.random.Generator) -> list[Part]:
    grow = generator.uniform(0.9, 1.2)
    cones = [
        (
            f"needle_{i % 2}",
            prism((0, 0, (1.2 + 2.2 * i) * grow), (2.3 - 0.55 * i, 0.0), 3.4 * grow, 7),
        )
        for i in range(3)
    ]
    return [("bark", prism((0, 0, 0), (0.25, 0.2), 1.6 * grow, 5)), *cones]


def _bush(generator: np.random.Generator) -> list[Part]:
    return _crown((0.0, 0.0, 0.7), (1.0, 1.0, 0.9), generator)


def _hedgerow(generator: np.random.Generator) -> list[Part]:
    return [("leaf_1", standing((0, 0, 0), (0.9, 3.0, 1.3)))]


def _wheels(x: float, y: float, radius: float) -> list[Part]:
    wheels = [
        box((a * x, b * y, radius), (2 * radius, 0.22, 2 * radius))
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    return [("tyre", np.concatenate(wheels))]


def _car(generator: np.random.Generator) -> list[Part]:
    cabin = prism((0, 0, 0), (0.7071, 0.53), 0.58, 4)
    cabin = moved(cabin, (0, 0, 0, np.pi / 4), mirrored=False) * np.array([2.5, 1.62, 1.0])
    cabin = cabin + np.array([-0.25, 0.0, 0.88])
    return [
        ("paint", box((0, 0, 0.60), (4.3, 1.76, 0.58))),
        ("window", cabin[:4]),
        ("paint", cabin[4:]),
        ("light", box((2.14, 0, 0.68), (0.06, 1.5, 0.14))),
        *_wheels(1.35, 0.80, 0.33),
    ]


def _van(generator: np.random.Generator) -> list[Part]:
    return [
        ("paint", box((-0.4, 0, 1.32), (4.4, 2.0, 1.96))),
        ("paint", box((2.2, 0, 0.86), (0.9, 1.96, 1.04))),
        ("window", box((1.86, 0, 1.72), (0.5, 1.8, 0.66))),
        ("window", box((1.2, 0, 1.72), (0.7, 2.03, 0.56))),
        *_wheels(1.6, 0.9, 0.38),
    ]


def _truck(generator: np.random.Generator) -> list[Part]:
    return [
        ("paint", box((-1.0, 0, 2.1), (6.0, 2.45, 2.6))),
        ("dark", box((0.4, 0, 0.72), (8.4, 2.2, 0.3))),
        ("paint", box((3.3, 0, 1.75), (1.9, 2.4, 2.1))),
        ("window", box((3.6, 0, 2.2), (1.36, 2.43, 0.7))),
        *_wheels(2.9, 1.05, 0.5),
        *_wheels(1.6, 1.05, 0.5),
    ]


def _lamp(generator: np.random.Generator) -> list[Part]:
    return [
        ("dark", prism((0, 0, 0), (0.10, 0.07), 6.0, 5)),
        ("dark", box((0.7, 0, 6.05), (1.6, 0.12, 0.12))),
        ("light", box((1.3, 0, 5.95), (0.6, 0.24, 0.10))),
    ]


def _bench(generator: np.random.Generator) -> list[Part]:
    return [
        ("wood", box((0, 0, 0.45), (0.5, 1.8, 0.07))),
        ("wood", box((-0.24, 0, 0.75), (0.07, 1.8, 0.45))),
        ("dark", np.concatenate([standing((0, y, 0), (0.45, 0.1, 0.42)) for y in (-0.7, 0.7)])),
    ]


def _stall(generator: np.random.Generator) -> list[Part]:
    posts = [standing((x, y, 0), (0.1, 0.1, 2.3)) for x in (-1.2, 1.2) for y in (-1.5, 1.5)]
    slopes, ends = gable((0, 0, 2.3), (3.2, 3.8, 0.9))
    return [
        ("wood", np.concatenate([*posts, standing((0.4, 0, 0), (0.9, 2.6, 0.95))])),
        ("paint", slopes),
        ("canvas", ends),
    ]


def _statue(generator: np.random.Generator) -> list[Part]:
    return [
        ("stone", standing((0, 0, 0), (2.0, 2.0, 0.5))),
        ("stone", standing((0, 0, 0.5), (1.1, 1.1, 1.7))),
        ("paint", prism((0, 0, 2.2), (0.42, 0.24), 1.5, 6)),
        ("paint", blob((0, 0, 3.95), (0.24, 0.24, 0.3), np.random.default_rng(1))),
        ("paint", box((0.3, 0.28, 3.3), (0.8, 0.16, 0.16))),
    ]


def _fountain(generator: np.random.Generator) -> list[Part]:
    rim = prism((0, 0, 0), (3.6, 3.6), 0.7, 14)
    return [
        ("stone", rim[:14]),
        ("water", rim[14:] - np.array([0, 0, 0.12])),
        ("stone", prism((0, 0, 0), (0.5, 0.3), 2.2, 8)),
        ("stone", prism((0, 0, 2.0), (0.4, 1.3), 0.4, 10)),
        ("water", prism((0, 0, 2.4), (0.3, 0.0), 0.9, 6)),
    ]


def _shelter(generator: np.random.Generator) -> list[Part]:
    return [
        ("paint", box((0, 0, 2.45), (1.7, 4.2, 0.14))),
        ("window", box((-0.7, 0, 1.3), (0.06, 4.0, 2.0))),
        ("dark", np.concatenate([standing((0.6, y, 0), (0.1, 0.1, 2.4)) for y in (-1.9, 1.9)])),
        ("wood", box((-0.4, 0, 0.5), (0.4, 3.0, 0.07))),
    ]


def _pavilion(generator: np.random.Generator) -> list[Part]:
    posts = [prism((x, y, 0), (0.13, 0.13), 2.8, 5) for x in (-2.3, 2.3) for y in (-2.3, 2.3)]
    return [
        ("stone", standing((0, 0, 0), (5.6, 5.6, 0.25))),
        ("canvas", np.concatenate(posts)),
        ("paint", pyramid((0, 0, 2.8), (6.0, 6.0, 2.0))),
    ]


def _boat(generator: np.random.Generator) -> list[Part]:
    hull = prism((0, 0, 0), (0.6, 1.0), 0.6, 8) * np.array([2.1, 0.8, 1.0])
    benches = [box((x, 0, 0.58), (0.3, 1.3, 0.08)) for x in (-0.7, 0.5)]
    deck = hull[8:] - np.array([0, 0, 0.08])
    return [("paint", np.concatenate([hull[:8], deck])), ("wood", np.concatenate(benches))]


def _swing(generator: np.random.Generator) -> list[Part]:
    beams = [standing((x, y, 0), (0.12, 0.12, 2.5)) for x in (-0.9, 0.9) for y in (-1.9, 1.9)]
    return [
        ("paint", np.concatenate([*beams, box((0, 0, 2.5), (0.14, 4.2, 0.14))])),
        ("paint", np.concatenate([box((0, y, 2.5), (1.9, 0.12, 0.12)) for y in (-1.9, 1.9)])),
        ("wood", np.concatenate([box((0, y, 0.6), (0.3, 0.6, 0.06)) for y in (-0.8, 0.8)])),
        ("dark", np.concatenate([box((0, y, 1.55), (0.03, 0.03, 1.9)) for y in (-0.8, 0.8)])),
    ]


def _water_tower(generator: np.random.Generator) -> list[Part]:
    legs = [prism((x, y, 0), (0.45, 0.35), 20.0, 5) for x in (-3, 3) for y in (-3, 3)]
    rings = [box((0, 0, z), (6.4, 6.4, 0.3)) for z in (7.0, 14.0)]
    return [
        ("metal", np.concatenate([*legs, *rings, prism((0, 0, 0), (0.8, 0.8), 20.0, 6)])),
        ("paint", prism((0, 0, 19.0), (2.2, 5.0), 2.0, 14)),
        ("paint", prism((0, 0, 21.0), (5.0, 5.0), 5.5, 14)),
        ("paint", prism((0, 0, 26.5), (5.2, 0.0), 2.6, 14)),
    ]


def _chimney(generator: np.random.Generator) -> list[Part]:
    bands = [("paint", prism((0, 0, 0), (1.9, 1.6), 20.0, 10))]
    bands += [("canvas", prism((0, 0, 20.0), (1.6, 1.5), 3.0, 10))]
    return [*bands, ("paint", prism((0, 0, 23.0), (1.5, 1.35), 5.0, 10))]


SHAPES: dict[str, Shape] = {
    "tree": Shape("green", _tree, (_box(0, 0, 0, 0.5, 0.5, 3.0), _box(0, 0, 2.8, 4.2, 4.2, 5.2))),
    "poplar": Shape("green", _poplar, (_box(0, 0, 0, 0.4, 0.4, 2), _box(0, 0, 1.6, 2, 2, 10.0))),
    "conifer": Shape("green", _conifer, (_box(0, 0, 0, 0.5, 0.5, 1.5), _box(0, 0, 1.3, 3, 3, 8.4))),
    "bush": Shape("green", _bush, (_box(0, 0, 0, 1.6, 1.6, 1.5),)),
    "hedge": Shape("green", _hedgerow, (_box(0, 0, 0, 0.9, 3.0, 1.3),)),
    "car": Shape(
        "blue", _car, (_box(0, 0, 0.0, 4.36, 1.8, 0.9), _box(-0.25, 0, 0.8, 2.6, 1.6, 0.66)), True
    ),
    "van": Shape("white", _van, (_box(0.1, 0, 0, 5.4, 2.02, 2.3),), True),
    "truck": Shape("orange", _truck, (_box(0.15, 0, 0, 8.3, 2.46, 3.4),), True),
    "street lamp": Shape(
        "black", _lamp, (_box(0, 0, 0, 0.2, 0.2, 6.1), _box(0.75, 0, 5.9, 1.7, 0.25, 0.22))
    ),
    "bench": Shape("brown", _bench, (_box(0, 0, 0, 0.56, 1.8, 0.97),)),
    "market stall": Shape("red", _stall, (_box(0, 0, 0, 3.2, 3.8, 3.2),), True),
    "statue": Shape(
        "black", _statue, (_box(0, 0, 0, 2.0, 2.0, 0.5), _box(0, 0, 0.5, 1.1, 1.1, 3.8)), True
    ),
    "fountain": Shape(
        "gray",
        _fountain,
        (_box(0, 0, 0, 6.6, 6.6, 0.7), _box(0, 0, 0.7, 2.6, 2.6, 2.6)),
    ),
    "bus stop": Shape("blue", _shelter, (_box(0, 0, 0, 1.7, 4.2, 2.52),), True),
    "pavilion": Shape(
        "red", _pavilion, (_box(0, 0, 0, 5.6, 5.6, 2.8), _box(0, 0, 2.8, 4.2, 4.2, 2.0)), True
    ),
    "boat": Shape("red", _boat, (_box(0, 0, 0, 4.2, 1.6, 0.6),), True),
    "swing": Shape("red", _swing, (_box(0, 0, 0, 2.0, 4.2, 2.6),), True),
    "water tower": Shape(
        "white", _water_tower, (_box(0, 0, 0, 7.0, 7.0, 19.0), _box(0, 0, 19, 9.4, 9.4, 8.6)), True
    ),
    "chimney": Shape("red", _chimney, (_box(0, 0, 0, 3.6, 3.6, 28.0),), True),
}
"""What a person calls it -> its shape."""
