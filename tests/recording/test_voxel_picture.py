from __future__ import annotations

import json
import math

import numpy as np
from test_map_picture import WORLD, episode

from unilavira_drake.messages import OccupancyMap, VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.recording.map_picture import map_picture
from unilavira_drake.recording.transcript import transcript_line
from unilavira_drake.recording.voxel_picture import STANDING, top_view


def voxel_map(*keys: tuple[int, int, int], seed: int = 0) -> VoxelMap:
    random = np.random.default_rng(seed)
    tiles = {}
    for key in keys:
        tile = random.integers(-30, 0, (TILE,) * 3).astype(np.int8)
        tile[random.random(tile.shape) < 0.7] = 0
        tile[random.random(tile.shape) < 0.002] = 20
        tiles[key] = tile
    return VoxelMap(n=4, version=9, time=2.5, resolution=0.5, tiles=tiles)


def test_an_empty_map_is_unknown() -> None:
    view = top_view(VoxelMap(n=3, resolution=0.5))
    assert (view.n, view.resolution, view.shape) == (3, 0.5, (1, 1))
    assert not view.log_odds.any()


def test_a_column_is_what_stands_in_it() -> None:
    voxels = voxel_map((0, 0, 0), (0, 0, 1), (-1, 0, 0), (2, 1, -1), seed=5)
    view = top_view(voxels)
    assert view.origin == (-TILE * 0.5, 0.0)
    assert view.shape == (2 * TILE, 4 * TILE)
    for i in range(0, 2 * TILE, 3):
        for j in range(0, 4 * TILE, 5):
            x, y = j - TILE, i
            key = (x // TILE, y // TILE)
            stack = [t for k, t in sorted(voxels.tiles.items()) if k[:2] == key]
            levels = [k[2] * TILE for k in sorted(voxels.tiles) if k[:2] == key]
            heights = [
                (base + k) * 0.5
                for tile, base in zip(stack, levels, strict=True)
                for k in range(TILE)
                if (tile[:, :, k] > 0).any()
            ]
            column = [
                ((base + k) * 0.5, int(tile[x % TILE, y % TILE, k]))
                for tile, base in zip(stack, levels, strict=True)
                for k in range(TILE)
            ]
            ground = min(heights, default=math.inf)
            expected = 0
            if any(value != 0 for _, value in column):
                expected = -1
            if any(value > 0 and z >= ground + STANDING for z, value in column):
                expected = 1
            assert view.log_odds[i, j] == expected, (i, j)


def test_a_transcript_and_the_map_show_it_from_above() -> None:
    voxels = voxel_map((0, 0, 0))
    pictures: dict[str, bytes] = {}
    line = json.loads(transcript_line(1.0, 4, "mapper", "map", voxels, pictures))
    flat: dict[str, bytes] = {}
    same = json.loads(transcript_line(1.0, 4, "mapper", "map", top_view(voxels), flat))
    assert line == same
    assert pictures == flat
    assert len(pictures) == 1
    assert line["data"]["shape"] == [TILE, TILE]
    assert isinstance(top_view(voxels), OccupancyMap)
    assert map_picture(WORLD, episode(), voxels) == map_picture(WORLD, episode(), top_view(voxels))
