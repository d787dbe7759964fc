"""What happens where the raster camera cannot draw, and in more than one process."""

import multiprocessing
import os
import sys

import numpy as np
import pytest
from two_cameras import TwoCameras, pose, shapes, wall

from unilavira_drake import load_scenario
from unilavira_drake.errors import RenderingError
from unilavira_drake.raster import RasterFallbackWarning, stage
from unilavira_drake.rendering_check import check_rendering
from unilavira_drake.station import make_navigation_station


@pytest.fixture
def without_moderngl(monkeypatch):
    monkeypatch.setattr(stage, "_stage", None)
    monkeypatch.setitem(sys.modules, "moderngl", None)


@pytest.mark.parametrize("views", [1, 3])
def test_vtk_draws_where_moderngl_is_missing(without_moderngl, views):
    with pytest.warns(RasterFallbackWarning, match="pip install moderngl") as warned:
        cameras = TwoCameras(shapes(wall()), vtk=False, views=views)
    assert len(warned) == 1
    cameras.look(pose(0, 0, 0, 2.0 * np.pi * (views - 1) / views))
    prefix = f"view_{views - 1}." if views > 1 else ""
    _, depth, label = cameras.ours(
        *(f"{prefix}{name}" for name in ("color_image", "depth_image_32f", "label_image"))
    )
    assert label[117, 163] == 9
    assert depth[117, 163] == pytest.approx(4.95, abs=1e-3)


def test_an_old_opengl_is_named(monkeypatch):
    monkeypatch.setattr(stage, "_stage", None)
    monkeypatch.setattr(stage, "REQUIRED_VERSION", 990)
    with (
        pytest.warns(RasterFallbackWarning, match=r"no OpenGL 9\.9.*libgl1-mesa-dri"),
    ):
        TwoCameras(shapes(wall()), vtk=False)


def test_the_station_falls_back_with_the_same_ports(without_moderngl):
    scenario = load_scenario("flat", "renderer: raster")
    with pytest.warns(RasterFallbackWarning):
        station = make_navigation_station(scenario)
    assert station.HasOutputPort("front.depth_image")
    assert station.GetSubsystemByName("cameras").GetSystemType().endswith("SceneCamera")


def test_the_preflight_draws_with_either():
    check_rendering(renderer="raster")
    lacking = (
        "import sys; sys.modules['moderngl'] = None; "
        "import unilavira_drake.rendering_check as check; check._render('raster')"
    )
    check_rendering([sys.executable, "-c", lacking])


def draw(queue):
    cameras = TwoCameras(shapes(wall()), vtk=False)
    cameras.look(pose(0, 0, 0, 0.3))
    queue.put([image.tobytes() for image in cameras.ours()])


def test_spawned_processes_draw_the_same():
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    workers = [context.Process(target=draw, args=(queue,)) for _ in range(2)]
    for worker in workers:
        worker.start()
    first, second = (queue.get(timeout=120) for _ in workers)
    for worker in workers:
        worker.join()
        assert worker.exitcode == 0
    assert first == second


def test_a_forked_process_is_told_to_be_spawned(monkeypatch):
    stage.shared_stage()
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(RenderingError, match="spawn"):
        stage.shared_stage()
