"""The report of a flight: five views, a voxel map from above, moves that the ground has not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from run_on_paper import COLORS, LENS, Pen, jpeg, pose

from unilavira_drake.messages import (
    DOWN,
    ON_THE_WAY,
    Frame,
    Goal,
    LanguageAction,
    NavigationStatus,
    Outcome,
    Panorama,
    VisionAction,
    VoxelMap,
)
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.recording.result import EpisodeResult, MetricsResult, TaskResult
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.report.figures import run_figures
from unilavira_drake.report.model import read_run
from unilavira_drake.report.page import render_report


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "run"
    tile = np.full((TILE, TILE, TILE), -5, np.int8)
    tile[:, :, 0] = 9
    tile[4:8, 4:8, :20] = 9
    with RunFolder(path) as run:
        pen = Pen(run)

        def look(n: int, x: float) -> None:
            colors = {**COLORS, DOWN: (90, 90, 90)}
            frames = tuple(
                Frame(view=view, jpeg=jpeg(color), intrinsics=LENS)
                for view, color in colors.items()
            )
            X_WB = pose(x, 1.0, 0.5)
            X_WB[2, 3] = 10.0
            pen.say("observer", "panorama", Panorama(n, n, 0.1, X_WB, frames, Outcome()))
            pen.say("mapper", "map", VoxelMap(n, n, 0.1, 0.5, {(0, 0, 0): tile}))

        look(1, 1.0)
        pen.act(LanguageAction(1, "decide", "turn", DOWN, climb=8.0))
        pen.say("vision", "vision_action", VisionAction(1, DOWN, point=(320, 240), target_desc="a"))
        pen.drive(Goal(1, "go", (1.0, 1.0, 18.0), p_WT=(1.0, 1.0, 0.0)), (1.0, 1.0))
        look(2, 1.0)
        pen.act(LanguageAction(2, "decide", "fly", bearing=-30.0, distance=12.0, climb=-2.0))
        pen.drive(Goal(2, "go", (11.0, 7.0, 16.0), partial=True), (1.0, 1.0))
        status = NavigationStatus(2, "arrived", ON_THE_WAY)
        pen.say("planner", "navigation_status", status)
    return path


def test_the_page_shows_five_views_and_the_moves(folder: Path) -> None:
    page = render_report(folder)
    assert 'class="panorama five"' in page
    assert "<figcaption>down <strong>chosen</strong></figcaption>" in page
    assert "turn down, 8 m up" in page
    assert "fly 12 m at 30 degrees to the right, 2 m down" in page


def test_the_map_is_there_and_the_goals_are_read_back(folder: Path) -> None:
    run = read_run(folder)
    assert not any("cannot be read" in problem for problem in run.problems[1:])
    assert [step.map.shape for step in run.steps if step.map is not None] == [(TILE, TILE)] * 2
    first, second = run.steps
    assert first.goal is not None
    assert second.goal is not None
    assert first.goal.p_WT == (1.0, 1.0, 0.0)
    assert second.goal.partial
    assert "data:image/png" in render_report(folder)


@pytest.mark.parametrize(("family", "flight"), [("aerial_vln", True), ("vln", False)])
def test_the_figures_of_a_flight_are_not_those_of_a_room(
    folder: Path, family: str, flight: bool
) -> None:
    result = EpisodeResult(task=TaskResult(family), metrics=MetricsResult(path_type="easy"))
    figures = dict(run_figures(dataclasses.replace(read_run(folder), result=result)))
    assert figures.get("path type") == ("easy" if flight else None)
    assert ("in the goal's room" in figures) is ("goal in the last view" in figures) is not flight
