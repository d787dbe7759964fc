"""The metres that the page tells of each step: in space, and the steps sum to the run's way."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from run_on_paper import LENS, Pen, jpeg, pose

from unilavira_drake.messages import (
    DOWN,
    Frame,
    Goal,
    LanguageAction,
    NavigationStatus,
    Outcome,
    Panorama,
    VisionAction,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.report.model import read_run
from unilavira_drake.report.page import render_report
from unilavira_drake.report.words import travel_words

Place = tuple[float, float, float]

START: Place = (3.0, 4.0, 10.0)
CLIMBED: Place = (3.4, 4.0, 25.0)
FLOWN: Place = (15.4, 4.0, 30.0)
BRAKED: Place = (16.4, 4.0, 30.0)
AIMS: tuple[Place, ...] = ((3.0, 4.0, -1.6), (24.4, 4.0, 18.0), (16.4, 4.0, 30.0))
LEGS: tuple[tuple[Sequence[Place], Sequence[Place]], ...] = (
    ((START, CLIMBED), ()),
    ((CLIMBED, FLOWN), (FLOWN, BRAKED)),
    ((BRAKED, BRAKED), ()),
)
"""What each action flies until its arrival, and after it."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A climb of 15 m, a slanting way of 13 m with a metre of braking, and a step without a way."""
    path = tmp_path_factory.mktemp("distances") / "run"
    lens = Frame(view=DOWN, jpeg=jpeg((90, 90, 90)), intrinsics=LENS)
    with RunFolder(path) as run:
        pen = Pen(run)
        length, last = 0.0, START

        def at(place: Place) -> None:
            nonlocal length, last
            length += sum((a - b) ** 2 for a, b in zip(place, last, strict=True)) ** 0.5
            last = place
            metrics = EpisodeMetrics(0.0, *place, path_length=length)
            pen.say("episode_monitor", "metrics", metrics)

        for n, ((way, after), aim) in enumerate(zip(LEGS, AIMS, strict=True), start=1):
            X_WB = pose(*way[0][:2], 0.0)
            X_WB[2, 3] = way[0][2]
            pen.say("observer", "panorama", Panorama(n, n, 0.1, X_WB, (lens,), Outcome()))
            pen.say("language", "language_action", LanguageAction(n, "decide", "turn", DOWN))
            pen.say("vision", "vision_action", VisionAction(n, DOWN, point=(320, 240)))
            pen.say("goal_selector", "goal", Goal(n, "go", aim))
            for place in way:
                at(place)
            height = aim[2] - last[2]
            away = sum((a - b) ** 2 for a, b in zip(aim, last, strict=True)) ** 0.5
            status = NavigationStatus(n, "arrived", remaining=away, height=height)
            pen.say("planner", "navigation_status", status)
            for place in after:
                at(place)
    return path


def outcomes(folder: Path) -> list[str]:
    """Returns what the page says came of each step."""
    found = re.findall(r'<p class="outcome">(.*?)</p>', render_report(folder), re.DOTALL)
    return [" ".join(text.split()) for text in found]


def test_height_is_told_of_what_is_left_and_of_the_way(folder: Path) -> None:
    climb, slanting, standing = outcomes(folder)
    assert climb == (
        "Arrived, 26.6 m above what was aimed at. It took 0.5 s and 15.0 m: it climbed 15.0 m."
    )
    assert slanting == (
        "Arrived, 15.0 m from what was aimed at, 12.0 m above it. It took 0.5 s and 14.0 m, 5.0 m "
        "up; the last 1.0 m came after that, until it stood."
    )
    assert standing == "Arrived, 0.0 m from what was aimed at."


def test_what_was_flown_before_the_first_decision_is_told_apart(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run") as run:
        pen = Pen(run)
        for z in (0.0, 1.2):
            metrics = EpisodeMetrics(0.0, 3.0, 4.0, z, path_length=z)
            pen.say("episode_monitor", "metrics", metrics)
        lens = Frame(view=DOWN, jpeg=jpeg((90, 90, 90)), intrinsics=LENS)
        X_WB = pose(3.0, 4.0, 0.0)
        pen.say("observer", "panorama", Panorama(1, 1, 0.1, X_WB, (lens,), Outcome()))
        pen.say("language", "language_action", LanguageAction(1, "plan_todo", "stay"))
        pen.say("planner", "navigation_status", NavigationStatus(1, "arrived"))
    [taken_off] = outcomes(tmp_path / "run")
    assert taken_off.endswith("Before that it went 1.2 m.")


def test_an_aim_is_as_far_away_as_it_is_in_space(folder: Path) -> None:
    page = " ".join(re.sub(r"<[^>]+>", " ", render_report(folder)).split())
    assert "in the world (3.00, 4.00, -1.60) m, 11.6 m away" in page
    assert "in the world (24.40, 4.00, 18.00) m, 22.1 m away" in page


def test_the_steps_sum_to_the_path_length(folder: Path) -> None:
    run = read_run(folder)
    spans = [run.span(step) for step in run.steps]
    assert [begin for begin, _ in spans[1:]] == [end for _, end in spans[:-1]]
    ways = [run.trace.travel(*span) for span in spans]
    assert ways == pytest.approx([15.005, 14.0, 0.0], abs=0.001)
    assert sum(ways) == pytest.approx(29.005, abs=0.001)
    assert [run.trace.climb(step.n) for step in run.steps] == [15.0, 5.0, 0.0]


@pytest.mark.parametrize(
    ("travel", "after", "climb", "words"),
    [
        (0.04, 0.0, 0.0, ""),
        (3.0, 0.2, 0.1, "It took 6.8 s and 3.0 m."),
        (0.1, 0.0, -0.1, "It took 6.8 s and 0.1 m."),
        (3.1, 0.0, 2.8, "It took 6.8 s and 3.1 m: it climbed 2.8 m."),
        (15.2, 0.9, -15.0, "It took 6.8 s and 15.2 m: it descended 15.0 m; the last 0.9 m came "
         "after that, until it stood."),
        (5.0, 0.0, -2.8, "It took 6.8 s and 5.0 m, 2.8 m down."),
    ],
)  # fmt: skip
def test_a_way_in_words(travel: float, after: float, climb: float, words: str) -> None:
    assert travel_words(6.8, travel, after, climb) == words
