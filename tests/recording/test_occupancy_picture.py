from __future__ import annotations

import hashlib
import json
from pathlib import Path

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.recording.message_log import MessageLog
from unilavira_drake.recording.occupancy_picture import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    occupancy_from_png,
    occupancy_png,
)
from unilavira_drake.recording.run_folder import RunFolder

GRID = np.array([[-5, 0, 9], [0, 0, -1]], np.int8)


def test_the_picture_is_seen_from_above() -> None:
    image = cv2.imdecode(
        np.frombuffer(occupancy_png(OccupancyMap(log_odds=GRID)), np.uint8), cv2.IMREAD_UNCHANGED
    )
    assert image.dtype == np.uint8
    # The last row of the map has the greatest y: it is the first row of pixels.
    assert image.tolist() == [[UNKNOWN, UNKNOWN, FREE], [FREE, UNKNOWN, OCCUPIED]]


@settings(derandomize=True, deadline=None, max_examples=50)
@given(arrays.arrays(np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_the_signs_survive_the_picture(log_odds: np.ndarray) -> None:
    png = occupancy_png(OccupancyMap(log_odds=log_odds))
    read = occupancy_from_png(png, n=3, resolution=0.1, origin=(-1.0, 2.0))
    assert read is not None
    assert (read.n, read.resolution, read.origin) == (3, 0.1, (-1.0, 2.0))
    np.testing.assert_array_equal(np.sign(read.log_odds), np.sign(log_odds))


def test_what_is_no_picture_gives_no_map() -> None:
    for png in (b"", b"\x89PNG broken"):
        assert occupancy_from_png(png, n=1, resolution=0.1, origin=(0.0, 0.0)) is None


def test_the_run_folder_holds_one_map_for_each_panorama(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as folder:
        log = MessageLog([folder.record])
        for n, version, grid in ((0, 1, GRID), (1, 2, GRID), (1, 3, -GRID), (2, 4, GRID)):
            log(float(version), "mapper", "map", OccupancyMap(n=n, version=version, log_odds=grid))
    digest = hashlib.sha256(occupancy_png(OccupancyMap(log_odds=GRID))).hexdigest()
    assert [path.name for path in (tmp_path / "maps").iterdir()] == [f"{digest}.png"]
    lines = [json.loads(line) for line in (tmp_path / "transcript.jsonl").read_text().splitlines()]
    assert [(line["decision"], line["data"]["version"]) for line in lines] == [(1, 2), (2, 4)]
    assert (lines[0]["system"], lines[0]["event"]) == ("mapper", "map")
    assert set(lines[0]["data"]) == {
        "n",
        "version",
        "time",
        "resolution",
        "origin",
        "shape",
        "image",
    }
    assert lines[0]["data"]["shape"] == [2, 3]
    assert lines[0]["data"]["image"] == digest
