"""The meshes of a world under the open sky, each with its name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.worlds.gltf import TexturedQuads
from unilavira_drake.worlds.outdoors.build import SURROUNDINGS
from unilavira_drake.worlds.outdoors.buildings import building_quads
from unilavira_drake.worlds.outdoors.ground import ground_quads
from unilavira_drake.worlds.outdoors.ground_picture import GroundPicture
from unilavira_drake.worlds.outdoors.materials import GROUND
from unilavira_drake.worlds.outdoors.shapes import exterior_quads
from unilavira_drake.worlds.outdoors.things import Building, Exterior, GroundPatch
from unilavira_drake.worlds.world import Box, World

SOIL = 10.0
"""Depth of the solid ground, metres."""
_SUNK = 0.02
"""By which its surface lies lower than what is seen, metres: wheels that touch the ground are no
collision."""


def thing_quads(visual: Building | Exterior) -> list[TexturedQuads]:
    """Returns the mesh of a building or of a shape, in the world."""
    if isinstance(visual, Building):
        return building_quads(visual)
    return [exterior_quads(visual)]


def ground_meshes(world: World) -> Iterator[tuple[str, TexturedQuads]]:
    """Yields the instance name and the mesh of each part of the ground that is seen."""
    inner = [patch for patch in world.ground if patch.name != SURROUNDINGS]
    boxes = (box for thing in world.objects for box in thing.boxes)
    picture = GroundPicture(inner, boxes, mirrored=world.mirrored)
    districts = {room.name for room in world.rooms}
    for patch, corners in zip(world.ground, ground_quads(world.ground), strict=True):
        if not len(corners):
            continue
        name = f"{patch.name}_floor" if patch.name in districts else patch.name
        if patch.name == SURROUNDINGS:
            yield name, _plain(patch, corners)
            continue
        low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
        image = picture.part((low[0], low[1], high[0], high[1]))
        u = (corners[:, :, 0] - low[0]) / (high[0] - low[0])
        v = (high[1] - corners[:, :, 1]) / (high[1] - low[1])
        yield name, TexturedQuads(corners, np.stack((u, v), axis=2), image, lossy=True)


def solid_ground(world: World) -> Box:
    """Returns what is solid below the districts and their surroundings."""
    rectangles = np.array([patch.rectangle for patch in world.ground])
    x0, y0 = rectangles[:, :2].min(axis=0)
    x1, y1 = rectangles[:, 2:].max(axis=0)
    middle = (float(x0 + x1) / 2, float(y0 + y1) / 2, -_SUNK - SOIL / 2)
    return Box(middle, (float(x1 - x0), float(y1 - y0), SOIL))


def _plain(patch: GroundPatch, corners: NDArray[np.float64]) -> TexturedQuads:
    color = np.round(255.0 * np.array(GROUND[patch.material].color)).astype(np.uint8)
    image = np.broadcast_to(color, (4, 4, 3))
    return TexturedQuads(corners, np.full((len(corners), 4, 2), 0.5), np.ascontiguousarray(image))
