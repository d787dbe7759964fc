from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import (
    Goal,
    LanguageAction,
    NavigationStatus,
    OccupancyMap,
    Panorama,
)
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.recording.map_picture import map_picture, stacked
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.worlds.world import Box, Room, World, WorldObject

WORLD = World(
    rooms=(Room("hall", "hall", (0.0, 0.0, 6.0, 4.0)),),
    objects=(
        WorldObject("sofa_1", "sofa", "red", "hall", (Box((1.0, 3.5, 0.4), (1.5, 0.6, 0.8)),)),
    ),
    walls=(Box((3.0, 0.0, 1.3), (6.0, 0.1, 2.6)),),
)


def pose(x: float, y: float) -> NDArray[np.float64]:
    X_WB = np.eye(4)
    X_WB[:2, 3] = x, y
    return X_WB


def episode() -> EpisodeTrace:
    trace = EpisodeTrace()

    def record(t: float, message: object) -> None:
        trace.record(t, "", "", message)

    for n, (x, y) in enumerate([(1.0, 1.0), (4.0, 1.0), (4.0, 1.0), (1.0, 1.0)], start=1):
        record(10.0 * n, Panorama(n=n, X_WB=pose(x, y)))
        waypoint = (1, 2, 2, 1)[n - 1]
        record(10.0 * n, MllmRequest(n=n, variables=LanguageVariables(current_waypoint=waypoint)))
    record(10.0, Goal(n=1, kind="go", p_WG=(4.2, 1.1, 0.0)))
    record(30.0, Goal(n=3, kind="stay"))
    record(30.0, LanguageAction(n=3, tool="backtrack", waypoint=1))
    record(40.0, NavigationStatus(n=3, state="moving"))
    record(45.0, NavigationStatus(n=3, state="arrived"))
    for t in np.linspace(0.0, 50.0, 101):
        record(float(t), EpisodeMetrics(x=2.5 - 1.5 * math.cos(t / 8), y=1.0))
    return trace


def test_the_trace_keeps_way_waypoints_backtracks_and_aims() -> None:
    trace = episode()
    assert trace.points.shape == (101, 3)
    assert trace.waypoints == {1: (1.0, 1.0), 2: (4.0, 1.0)}
    assert trace.backtracks == ((30.0, 45.0),)
    assert trace.goals == [(4.2, 1.1)]
    assert trace.ends == ((1.0, 1.0, 0.0), (*trace.points[-1, 1:], 0.0))
    assert EpisodeTrace().ends == (None, None)
    assert trace.legs == {3: (30.0, 45.0)}
    assert trace.poses == {
        1: (1.0, 1.0, 0.0),
        2: (4.0, 1.0, 0.0),
        3: (4.0, 1.0, 0.0),
        4: (1.0, 1.0, 0.0),
    }


def test_what_lies_on_another_floor_is_told_from_the_way() -> None:
    trace = EpisodeTrace()
    for n, (t, x, z) in enumerate([(0.0, 1.0, 0.0), (8.0, 4.0, 2.8), (9.0, 5.0, 2.8)], start=1):
        X_WB = pose(x, 1.0)
        X_WB[2, 3] = z
        trace.record(t, "", "", Panorama(n=n, X_WB=X_WB))
        request = MllmRequest(n=n, variables=LanguageVariables(current_waypoint=n))
        trace.record(t, "", "", request)
        trace.record(t, "", "", Goal(n=n, kind="go", p_WG=(x + 1.0, 1.0, z)))
    trace.record(0.0, "", "", LanguageAction(n=1, tool="backtrack", waypoint=1))
    trace.record(2.0, "", "", NavigationStatus(n=1, state="arrived"))
    for t in range(11):
        trace.record(float(t), "", "", EpisodeMetrics(x=1.0 + 0.4 * t, y=1.0, z=min(0.4 * t, 2.8)))
    upper, lower = (trace.on(lambda z, top=top: (z > 2.5) is top) for top in (True, False))
    assert (upper.away, lower.away, trace.away) == (((0.0, 6.0),), ((7.0, 10.0),), ())
    assert (upper.backtracks, lower.backtracks) == ((), ((0.0, 2.0),))
    assert (list(upper.waypoints), list(lower.waypoints)) == ([2, 3], [1])
    assert (upper.goals, lower.goals) == ([(5.0, 1.0), (6.0, 1.0)], [(2.0, 1.0)])
    assert upper.ends[0] is None
    assert upper.ends[1] == trace.ends[1] == (5.0, 1.0, 0.0)
    assert lower.ends == ((1.0, 1.0, 0.0), None)
    assert np.array_equal(upper.points, trace.points)
    panels = [map_picture(WORLD, part) for part in (lower, upper)]
    assert panels[1] != map_picture(WORLD, trace)
    assert trace.heights[0] == 0.0
    assert trace.heights[-1] == 2.8
    images = [
        cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
        for png in (stacked(panels), *panels)
    ]
    assert np.array_equal(images[0], np.vstack(images[1:]))
    assert stacked(panels[:1]) is panels[0]


def test_each_floor_keeps_the_maps_that_were_made_on_it() -> None:
    trace = EpisodeTrace()
    for n, z in enumerate([0.0, 0.0, 2.8], start=1):
        X_WB = pose(1.0, 1.0)
        X_WB[2, 3] = z
        trace.record(float(n), "", "", Panorama(n=n, X_WB=X_WB))
        trace.record(float(n), "", "", OccupancyMap(n=n))
    assert list(trace.on(lambda z: z < 2.5).maps) == [1, 2]
    assert list(trace.on(lambda z: z > 2.5).maps) == [3]


def test_the_picture_is_a_png_of_the_same_bytes_each_time() -> None:
    occupancy = OccupancyMap(log_odds=np.array([[0, -5], [9, 0]], np.int8))
    pictures = [
        map_picture(WORLD, episode(), occupancy, goals=((5.0, 3.0),), title="To the sofa.")
        for _ in range(2)
    ]
    assert pictures[0] == pictures[1]
    image = cv2.imdecode(np.frombuffer(pictures[0], np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape[1] == 1440
    assert image.shape[0] > 700
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 50


def test_the_goal_and_its_area_are_drawn_and_a_long_title_is_wrapped() -> None:
    area = (np.array([[4.0, 2.0], [5.8, 2.0], [5.8, 3.9], [4.0, 3.9]]),)
    plain = map_picture(WORLD, episode())
    marked = map_picture(WORLD, episode(), goals=((5.0, 3.0),), goal_area=area)
    titled = map_picture(WORLD, episode(), title="Go to the $sofa$. " * 60)
    images = [
        cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
        for png in (plain, marked, titled)
    ]
    assert images[0].shape == images[1].shape
    assert images[2].shape[1] == images[0].shape[1]
    assert 0 < images[2].shape[0] - images[0].shape[0] < 200
    # The goal's colour (BGR) is in the marked picture alone.
    counts = [
        int((np.abs(image.astype(int) - (108, 32, 176)).max(2) < 8).sum()) for image in images
    ]
    assert counts[1] > 300
    assert counts[0] == counts[2] == 0


def test_an_episode_that_never_moved_has_a_picture_too() -> None:
    assert map_picture(WORLD, EpisodeTrace()).startswith(b"\x89PNG")
