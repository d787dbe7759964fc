from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
from test_map_picture import WORLD, episode

from unilavira_drake.messages import OccupancyMap, VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.recording.map_picture import map_picture
from unilavira_drake.recording.transcript import transcript_line
from unilavira_drake.recording.voxel_picture import top_view

ALTITUDES = (2.0, 12.4)


def voxel_map(*keys: tuple[int, int, int], seed: int = 0) -> VoxelMap:
    random = np.random.default_rng(seed)
    tiles = {}
    for key in keys:
        tile = random.integers(-30, 0, (TILE,) * 3).astype(np.int8)
        tile[random.random(tile.shape) < 0.7] = 0
        tile[random.random(tile.shape) < 0.002] = 20
        tiles[key] = tile
    return VoxelMap(n=4, version=9, time=2.5, resolution=0.5, tiles=tiles, altitudes=ALTITUDES)


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
            column = [
                ((base + k) * 0.5, int(tile[x % TILE, y % TILE, k]))
                for tile, base in zip(stack, levels, strict=True)
                for k in range(TILE)
            ]
            lowest, highest = ALTITUDES
            expected = 0
            if any(value != 0 and z < highest for z, value in column):
                expected = -1
            if any(value > 0 and lowest < z + 0.5 and z < highest for z, value in column):
                expected = 1
            assert view.log_odds[i, j] == expected, (i, j)


def seen(
    resolution: float, altitudes: tuple[float, float], boxes: dict[str, tuple[float, ...]]
) -> VoxelMap:
    """Returns a stack of columns known up to 6.4 m or more: free but for the boxes in it.

    Args:
        boxes: x_min, y_min, z_min, x_max, y_max, z_max of each, metres.
    """
    dense = np.full((TILE, TILE, 3 * TILE), -20, np.int8)
    for box in boxes.values():
        low, high = np.rint(np.array(box).reshape(2, 3) / resolution).astype(int)
        dense[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = 20
    tiles = {(0, 0, c): dense[:, :, c * TILE : (c + 1) * TILE].copy() for c in range(3)}
    return VoxelMap(1, 1, 0.0, resolution, tiles, altitudes=altitudes)


def test_in_a_room_furniture_and_walls_stand_in_the_way_but_no_ceiling() -> None:
    boxes = {
        "floor": (0.0, 0.0, 0.0, 3.2, 3.2, 0.1),
        "ceiling": (0.0, 0.0, 2.6, 3.2, 3.2, 2.7),
        "wall": (0.0, 0.0, 0.0, 3.2, 0.1, 2.6),
        "bed": (0.0, 1.0, 0.4, 1.0, 3.0, 0.5),
        "table": (2.0, 2.0, 0.7, 3.0, 2.6, 0.8),
    }
    cells = top_view(seen(0.1, (0.4, 2.2), boxes)).log_odds
    expected = np.full((TILE, TILE), -1, np.int8)
    expected[0] = 1
    expected[10:30, :10] = 1
    expected[20:26, 20:30] = 1
    assert (cells == expected).all()


def test_a_ceiling_alone_says_nothing_of_the_room_below() -> None:
    tile = np.zeros((TILE,) * 3, np.int8)
    tile[:, :, 26] = 20
    tile[:, :, 24] = -20
    tile[3, 5, 1] = 20
    view = top_view(VoxelMap(1, 1, 0.0, 0.1, {(0, 0, 0): tile}, altitudes=(0.4, 2.2)))
    assert [tuple(cell) for cell in np.argwhere(view.log_odds)] == [(5, 3)]
    assert view.log_odds[5, 3] == -1


def test_outdoors_the_ground_is_free_and_a_wall_a_roof_and_a_crown_are_not() -> None:
    boxes = {
        "ground": (0.0, 0.0, 0.0, 16.0, 16.0, 0.5),
        "kerb": (0.0, 0.0, 0.5, 16.0, 1.0, 1.0),
        "wall": (2.0, 4.0, 0.5, 12.0, 4.5, 30.0),
        "roof": (2.0, 8.0, 29.5, 12.0, 12.0, 30.0),
        "crown": (13.0, 13.0, 4.0, 15.0, 15.0, 7.0),
    }
    cells = top_view(seen(0.5, (2.0, 80.0), boxes)).log_odds
    expected = np.full((TILE, TILE), -1, np.int8)
    expected[8, 4:24] = 1
    expected[16:24, 4:24] = 1
    expected[26:30, 26:30] = 1
    assert (cells == expected).all()


def test_the_altitudes_travel_with_the_map() -> None:
    voxels = voxel_map((0, 0, 0))
    copied = pickle.loads(pickle.dumps(voxels))
    assert copied.altitudes == voxels.altitudes == ALTITUDES
    with pytest.raises(ValueError, match="lowest altitude"):
        VoxelMap(altitudes=(2.0, 2.0))


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
