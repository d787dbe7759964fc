import math

import numpy as np
import pytest

from unilavira_drake.errors import TaskError
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start

RADIUS = 0.36


@pytest.fixture(scope="module")
def flat():
    return load_world("flat")


@pytest.fixture(scope="module")
def mirrored():
    return load_world("flat", mirror=True)


def test_numbers_are_taken_as_they_are(flat):
    assert parse_start(" 2.9, 7.4,-1.57", flat, radius=RADIUS) == (2.9, 7.4, -1.57)


def test_numbers_are_mirrored_with_the_world(mirrored):
    assert parse_start("2.9,7.4,-1.57", mirrored, radius=RADIUS) == (2.9, -7.4, 1.57)


@pytest.mark.parametrize("name", ["kitchen", "dining_room", "dining room", "corridor"])
def test_a_room_is_its_roomiest_free_point(flat, name):
    x, y, yaw = parse_start(name, flat, radius=RADIUS)
    room = flat.room(name)
    assert room.contains(x, y)
    assert yaw == 0.0
    best = clearance(flat, np.array([[x, y]]))[0]
    random = np.random.default_rng(0)
    x_min, y_min, x_max, y_max = room.rectangle
    others = random.uniform((x_min, y_min), (x_max, y_max), (2000, 2))
    assert best >= clearance(flat, others).max() - 0.05


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("1,2", "'1,2' is not X,Y,YAW"),
        ("1,2,north", "is not X,Y,YAW"),
        ("1,2,nan", "is not X,Y,YAW"),
        ("kitchn", "unknown room 'kitchn'; did you mean 'kitchen'"),
        ("20,2,0", "outside the world 'flat'"),
        ("1.6,0.5,0", r"inside sofa_1 .* nearest free place is \d"),
        ("5.0,3.0,0", "inside wall"),
        ("2.5,1.2,0", r"only 0\.\d+ m from sofa_1"),
    ],
)
def test_bad_starts_name_value_and_remedy(flat, text, message):
    with pytest.raises(TaskError, match=message):
        parse_start(text, flat, radius=RADIUS)


def test_the_remedy_is_itself_a_valid_start(flat, mirrored):
    for world in (flat, mirrored):
        with pytest.raises(TaskError) as error:
            parse_start("1.6,0.5,0", world, radius=RADIUS)
        x, y = str(error.value).split("free place is ")[1].split(" ")[0].strip(",").split(",")
        assert math.hypot(float(x) - 1.6, float(y) - 0.5) < 2.0
        parse_start(f"{x},{y},0", world, radius=RADIUS - 0.01)


def test_a_room_without_place_is_refused(flat):
    with pytest.raises(TaskError, match=r"no place for a robot of radius 3\.00 m"):
        parse_start("bathroom", flat, radius=3.0)
