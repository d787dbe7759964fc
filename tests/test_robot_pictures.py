"""The script that draws the robots for the documentation."""

from __future__ import annotations

import base64
import gzip
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(DOCS))

import make_robot_pictures  # noqa: E402
import robot_recording  # noqa: E402
import robot_stage  # noqa: E402

from unilavira_drake.worlds.load import load_world  # noqa: E402

ROBOTS = tuple(make_robot_pictures.ENTRIES)


def test_every_robot_is_shown():
    assert set(ROBOTS) == {"cobot_magic", "unitree_go1", "unitree_g1", "quadrotor"}
    for name in ROBOTS:
        assert (DOCS / "robots" / f"{name}.jpg").stat().st_size < 150_000
        assert (DOCS / "robots" / f"{name}.html").stat().st_size < 3_000_000
        assert f"robots/{name}.html" in (DOCS / "robots.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "arguments", [["nothing"], ["portraits", "--robot", "toaster"], ["portraits", "--size", "9"]]
)
def test_what_cannot_be_drawn_is_refused(arguments):
    with pytest.raises(SystemExit):
        make_robot_pictures.main(arguments)


def test_a_portrait_shows_the_robot(tmp_path):
    arguments = ["portraits", "--robot", "unitree_go1", "--size", "96x54", "--out", str(tmp_path)]
    make_robot_pictures.main(arguments)
    drawn = Image.open(tmp_path / "robots" / "unitree_go1.jpg")
    kept = Image.open(DOCS / "robots" / "unitree_go1.jpg").resize((96, 54))
    assert drawn.size == (96, 54)
    # As in the documentation, but for the blur of a small picture.
    assert np.abs(np.asarray(drawn, float) - np.asarray(kept, float)).mean() < 12.0


def test_a_camera_looks_at_its_target():
    X_WC = robot_stage.look_at((1.0, 2.0, 3.0), (4.0, -1.0, 0.5))
    x, y, z = X_WC.inverse().multiply(np.array([4.0, -1.0, 0.5]))
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert z == pytest.approx(np.sqrt(9 + 9 + 6.25))
    assert X_WC.rotation().matrix()[2, 0] == pytest.approx(0.0)
    assert X_WC.rotation().matrix()[2, 1] < 0.0


def test_a_dolls_house_keeps_what_stands_low():
    world = load_world("flat")
    low = robot_stage.dolls_house(world, 0.6)
    tops = [box.center[2] + box.size[2] / 2 for box in low.walls]
    assert max(tops) == pytest.approx(0.6)
    for thing, cut in zip(world.objects, low.objects, strict=True):
        assert (cut == thing) == (thing.category != "door")
        assert all(box.center[2] - box.size[2] / 2 < 0.6 for box in cut.boxes) or cut == thing


def test_a_ribbon_has_the_length_of_the_way():
    way = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0)])
    vertices, faces = robot_recording.ribbon(way, 0.1)
    corners = vertices.T[faces.T]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(0.3)
    assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_a_recording_unpacks(name):
    page = (DOCS / "robots" / f"{name}.html").read_text(encoding="utf-8")
    (packed,) = re.findall(r'atob\("([^"]+)"\)', page)
    inner = gzip.decompress(base64.b64decode(packed)).decode()
    assert "Drake MeshCat" in inner
    assert make_robot_pictures.ENTRIES[name].title in inner
