"""The town as a camera sees it from the air and from the street."""

import math

import numpy as np
import pytest
from town_views import FAR, HEIGHT, WIDTH, TownCamera

from unilavira_drake.sensors.color_names import COLOR_WORDS, color_indices
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.outdoors.things import Building

DOWN = math.pi / 2
LEAST_PIXELS = 12


@pytest.fixture(scope="module")
def town():
    return load_world("town")


@pytest.fixture(scope="module")
def camera(town):
    return TownCamera(town)


@pytest.fixture(scope="module")
def from_above(camera):
    """The most pixels of each label in one of 143 views straight down from 50 m."""
    most = np.zeros(32768, int)
    for x in np.arange(20.0, 440.0, 40.0):
        for y in np.arange(15.0, 400.0, 30.0):
            most = np.maximum(most, camera.labels((x, y, 50.0), DOWN, DOWN))
    return most


def test_everything_is_seen_from_above(town, from_above):
    missing = [
        entry.instance for label, entry in town.labels.items() if from_above[label] < LEAST_PIXELS
    ]
    assert missing == []


def test_what_is_seen_has_a_label(town, from_above):
    shown = set(np.flatnonzero(from_above)) - {32766}
    assert shown <= set(town.labels)


@pytest.mark.parametrize(
    "name", ["church", "town_hall", "red_van", "market_fountain", "water_tower", "west_statue"]
)
def test_landmarks_are_seen_from_the_side_before_their_collision_boxes_are_hit(town, camera, name):
    thing = town.object(name)
    label = town.label_of(name)
    corners = np.array([corner for box in thing.boxes for corner in box.corners()])
    middle = corners.mean(axis=0)
    high = max(box.center[2] + box.size[2] / 2 for box in thing.boxes)
    reach = float(np.hypot(*np.ptp(corners, axis=0))) / 2
    for heading in np.arange(0.0, 2 * math.pi, math.pi / 2):
        back = reach + 8.0
        x, y = middle - back * np.array([math.cos(heading), math.sin(heading)])
        frame = camera.frame((float(x), float(y), 0.7 * high), heading, 0.0)
        seen = frame.label == label
        assert seen.sum() > 100
        # The mesh fills its boxes, and stays in them but for eaves.
        assert frame.depth[seen].min() > back - reach - 1.5


def test_depth_is_that_of_the_boxes(town, camera):
    tower = town.object("glass_tower").boxes[0]
    x = tower.center[0] + tower.size[0] / 2 + 20.0
    frame = camera.frame((x, tower.center[1], 30.0), math.pi, 0.0)
    assert frame.depth[HEIGHT // 2, WIDTH // 2] == pytest.approx(20.0, abs=1e-3)
    ground = camera.frame((210.0, 100.0, 40.0), 0.0, DOWN)
    assert ground.depth[HEIGHT // 2, WIDTH // 2] == pytest.approx(40.0, abs=1e-3)


def test_facades_show_the_colour_of_their_label(town, camera):
    for thing in town.objects:
        if not isinstance(thing.visual, Building) or not thing.name.startswith("apartment_block"):
            continue
        x, y, _ = thing.boxes[0].center
        half = thing.boxes[0].size[0] / 2
        yaw = thing.boxes[0].yaw
        p_WC = (x + (half + 7) * math.cos(yaw), y + (half + 7) * math.sin(yaw), 9.0)
        frame = camera.frame(p_WC, yaw + math.pi, 0.0)
        pixels = np.asarray(frame.color)[:, :, :3][frame.label == town.label_of(thing.name)]
        counts = np.bincount(color_indices(pixels), minlength=len(COLOR_WORDS))
        assert COLOR_WORDS[int(counts.argmax())] == thing.color, thing.name


def test_nothing_ends_at_the_border_of_the_town(camera):
    frame = camera.frame((220.0, 200.0, 60.0), 0.0, 0.1)
    below = frame.label[HEIGHT // 2 + 40 :]
    assert not np.isin(below, [32766]).any()
    assert frame.depth.max() <= FAR or math.isinf(frame.depth.max())


def test_a_mirrored_town_looks_mirrored(town, camera):
    mirror = TownCamera(load_world("town", mirror=True))
    there = camera.frame((150.0, 30.0, 40.0), DOWN, 0.4)
    here = mirror.frame((150.0, -30.0, 40.0), -DOWN, 0.4)
    same = (there.label[:, ::-1] == here.label).mean()
    assert same > 0.98
    difference = np.abs(
        np.asarray(there.color)[:, ::-1, :3].astype(int) - np.asarray(here.color)[:, :, :3]
    )
    assert np.median(difference) < 12
