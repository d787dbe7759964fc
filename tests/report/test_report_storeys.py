"""The report of a house with two storeys: each step on the plan of its floor."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from run_on_paper import Pen, pose

from unilavira_drake.evaluation.air_goal import make_goal
from unilavira_drake.messages import LanguageAction, NavigationStatus, Outcome, Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.report.model import read_run
from unilavira_drake.report.page import render_report
from unilavira_drake.report.setting import read_setting
from unilavira_drake.report.sheet import Sheet
from unilavira_drake.scenario_loading import dump_scenario, load_scenario
from unilavira_drake.task_choice import choose_task
from unilavira_drake.worlds.load import load_world

FLOORS = ((7.0, 1.2, 0.0), (7.0, 8.0, 2.8), (8.0, 8.0, 2.8))


def write(path: Path, floors: tuple[tuple[float, float, float], ...], last: float = 0.0) -> Path:
    """Writes a run with a panorama at each place; its end lies ``last`` metres higher."""
    with RunFolder(path) as run:
        run.write("scenario.yaml", dump_scenario(load_scenario("two_storey")))
        pen = Pen(run)
        for n, (x, y, z) in enumerate(floors, start=1):
            X_WB = pose(x, y, 1.57)
            X_WB[2, 3] = z
            pen.say("observer", "panorama", Panorama(n, n, 0.1, X_WB, (), Outcome()))
            pen.ask(n, "decide", n, ("{}",))
            action = LanguageAction(n, "decide", "turn", "front")
            pen.say("language", "language_action", action)
            for _ in range(2):
                pen.say("episode_monitor", "metrics", EpisodeMetrics(x=x, y=y, z=z))
                x += 0.1
        if last:
            pen.say("episode_monitor", "metrics", EpisodeMetrics(x=x, y=y, z=z + last))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("storeys") / "run", FLOORS)


def test_each_step_lies_on_the_plan_of_its_floor(folder: Path) -> None:
    page = render_report(folder)
    assert re.findall(r'<g id="plan(\d*)">', page) == ["", "2"]
    # The overview first, on the floor of the last step.
    assert re.findall(r'<use href="#plan(\d*)"/>', page) == ["2", "", "2", "2"]
    plans = page.split('<g id="plan2">')
    assert "bathtub" in plans[1].split("</g>")[0]
    assert "bathtub" not in plans[0]
    assert "on another floor" in page


def test_the_overview_tells_other_floors_from_the_last(folder: Path) -> None:
    trace = read_run(folder).trace
    assert [trace.height(n) for n in (0, 1, 2, 3, 9)] == [0.0, 0.0, 2.8, 2.8, 2.8]
    assert sorted(trace.waypoints) == [1, 2, 3]
    overview = render_report(folder).split("<svg")[2]
    assert re.findall(r'dy=".35em">(\d)<', overview) == ["2", "3"]


def test_the_goal_lies_on_its_own_floor(folder: Path) -> None:
    lower, upper = read_setting(folder, None).storeys
    assert (lower.elevation, upper.elevation) == (0.0, 2.8)
    assert (lower.goals, lower.goal_area) == ((), ())
    assert len(upper.goals) == 1
    task = choose_task(load_scenario("two_storey"))
    goal = make_goal("bathtub_1|sofa_1", load_world("two_storey"), task.rule, radius=0.2)
    for elevation, room in ((0.0, "living_room"), (2.8, "bathroom")):
        (target,) = goal.on(elevation).targets
        assert target.elevation == elevation
        assert room in target.rooms


def test_a_step_shows_the_way_before_it_on_its_own_floor_alone(folder: Path) -> None:
    run = read_run(folder)
    sheet = Sheet(run, read_setting(folder, None))
    first, _, third = (sheet.overlay(step, "") for step in run.steps)
    assert (first.floor, first.way, third.floor) == ("", (), "2")
    (way,) = third.way
    # The last place downstairs, two upstairs and where this step begins.
    assert len(way.split()) == 4
    assert f'<polyline class="way" points="{way}"/>' in render_report(folder)


CLIMB = ((7.7, 1.0, 0.0), (7.7, 4.0, 0.7), (7.7, 6.5, 2.2), (7.7, 7.0, 2.6), (7.7, 8.5, 2.8))
"""South to north over the stairs; the floor above begins a little below it."""


def climb(path: Path, places: Iterable[tuple[float, float, float]]) -> Sheet:
    """Returns the drawing of a run whose first action drives over places, the second nowhere."""
    with RunFolder(path) as run:
        run.write("scenario.yaml", dump_scenario(load_scenario("two_storey")))
        pen = Pen(run)
        driven = tuple(places)
        for n, way in enumerate((driven, driven[-1:]), start=1):
            X_WB = pose(*way[0][:2], 1.57)
            X_WB[2, 3] = way[0][2]
            pen.say("observer", "panorama", Panorama(n, n, 0.1, X_WB, (), Outcome()))
            pen.say("language", "language_action", LanguageAction(n, "decide", "go_stair", "front"))
            for x, y, z in way:
                pen.say("episode_monitor", "metrics", EpisodeMetrics(x=x, y=y, z=z))
            pen.say("planner", "navigation_status", NavigationStatus(n))
    return Sheet(read_run(path), read_setting(path, None))


def ordinates(points: str) -> list[float]:
    """Returns how far down the page the points lie."""
    return [float(point.partition(",")[2]) for point in points.split()]


def test_a_climb_is_drawn_on_each_floor_as_far_as_it_led_there(tmp_path: Path) -> None:
    for up in (True, False):
        path = tmp_path / f"{up}"
        sheet = climb(path, CLIMB if up else CLIMB[::-1])
        first, second = (sheet.overlay(step, "") for step in read_run(path).steps)
        assert (first.floor, second.floor) == (("", "2") if up else ("2", ""))
        (leg,), (way,) = first.leg, second.way
        ((_, left),), ((_, reached),) = first.stairs, second.stairs
        # Each ends where the other floor begins, on the stairs, and that is marked.
        assert ordinates(leg)[-1] == left
        assert ordinates(way)[0] == reached
        assert (min if up else max)(ordinates(leg)) == left
        assert (max if up else min)(ordinates(way)) == reached
        page = render_report(path)
        assert page.count('<path class="stairs"') == 4
        assert page.count("to or from another floor") == 2


def test_an_end_on_another_floor_is_not_drawn(tmp_path: Path) -> None:
    for last, drawn in ((0.0, True), (2.8, False)):
        path = write(tmp_path / f"{last}", FLOORS[:1], last)
        start, end = Sheet(read_run(path), read_setting(path, None)).ends()
        assert start
        assert bool(end) is drawn
