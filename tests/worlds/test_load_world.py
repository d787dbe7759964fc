import math
import re

import pytest

from unilavira_drake.errors import ScenarioError
from unilavira_drake.resources import models_path
from unilavira_drake.sensors.color_names import color_word
from unilavira_drake.worlds.furniture import CATEGORIES, furniture_boxes
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.palette import PALETTE

SMALL = """
name: small
rooms:
- {name: hall, kind: hall, rectangle: [0, 0, 4, 3]}
- {name: den, kind: den, rectangle: [4, 0, 7, 3]}
doors:
- {name: den_door, rooms: [hall, den], position: [4, 1.5]}
objects:
- {name: sofa_1, category: sofa, color: red, room: hall, position: [1.5, 0.7], yaw_degrees: 90}
"""


def read(tmp_path, text):
    path = tmp_path / "small.yaml"
    path.write_text(text)
    return load_world(str(path))


def test_flat_has_the_promised_things():
    world = load_world("flat")
    assert len(world.rooms) == 7
    assert len(world.objects) >= 25
    assert len({thing.category for thing in world.objects}) >= 15
    assert sum(thing.category == "door" for thing in world.objects) == 7
    assert sorted(world.labels) == list(range(1, len(world.labels) + 1))
    floors = [entry for entry in world.labels.values() if entry.category == "floor"]
    assert {entry.room_kind for entry in floors} == {room.kind for room in world.rooms}
    assert [entry.category for entry in world.labels.values()].count("wall") == 1
    for thing in world.objects:
        assert world.labels[world.label_of(thing.name)].category == thing.category


def test_doors_are_a_colour_no_furniture_has():
    world = load_world("flat")
    doors = {thing.color for thing in world.objects if thing.category == "door"}
    others = {thing.color for thing in world.objects if thing.category != "door"}
    assert len(doors) == 1
    assert not doors & others


def test_mirror_negates_y_and_yaw_of_every_box():
    world, mirror = load_world("flat"), load_world("flat", mirror=True)
    assert mirror.mirrored
    assert not world.mirrored
    pairs = list(zip(world.walls, mirror.walls, strict=True))
    for thing, image in zip(world.objects, mirror.objects, strict=True):
        pairs += zip(thing.boxes, image.boxes, strict=True)
    for box, image in pairs:
        x, y, z = box.center
        assert image.center == (x, -y, z)
        assert image.size == box.size
        assert image.yaw == -box.yaw
    for room, image in zip(world.rooms, mirror.rooms, strict=True):
        x, y = room.center
        assert image.center == pytest.approx((x, -y))


def test_walls_leave_the_doorway_free_below_the_lintel(tmp_path):
    world = read(tmp_path, SMALL)
    across = [box for box in world.walls if abs(box.center[0] - 4.0) < 1e-9]
    low = [box for box in across if box.center[2] - box.size[2] / 2 < 1.0]
    lintels = [box for box in across if box not in low]
    assert [box.center[2] - box.size[2] / 2 > 2.1 for box in lintels] == [True]
    door = world.object("den_door")
    below = [box for box in door.boxes if box.center[2] - box.size[2] / 2 < 1.0]
    for box in (*low, *below):
        reach = abs(box.center[1] - 1.5) - box.size[1] / 2
        assert reach >= 0.5 - 1e-9


def test_shared_walls_are_built_once(tmp_path):
    world = read(tmp_path, SMALL)
    for i, a in enumerate(world.walls):
        for b in world.walls[:i]:
            inside = all(
                abs(a.center[k] - b.center[k]) < (a.size[k] + b.size[k]) / 2 - 0.051
                for k in range(3)
            )
            assert not inside, (a, b)


@pytest.mark.parametrize("category", CATEGORIES)
def test_furniture_turns_with_its_yaw(category):
    boxes = furniture_boxes(category, 0.0, 0.0, 0.0)
    turned = furniture_boxes(category, 2.0, 1.0, math.pi / 2)
    for box, image in zip(boxes, turned, strict=True):
        x, y, z = box.center
        assert image.center == pytest.approx((2.0 - y, 1.0 + x, z))
        assert z - box.size[2] / 2 >= -1e-9


def test_palette_words_are_what_the_pixels_say():
    for word, rgb in PALETTE.items():
        for shade in (0.74, 0.86, 1.0):
            assert color_word(tuple(shade * value for value in rgb)) == word


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("color: red", "colour: red", "objects: entry 'sofa_1'.*unknown key 'colour'.*'color'"),
        ("category: sofa", "category: sofar", "unknown category 'sofar'; did you mean 'sofa'"),
        ("color: red", "color: rad", "unknown color 'rad'; did you mean 'red'"),
        ("room: hall,", "room: hal,", "unknown room 'hal'; did you mean 'hall'"),
        ("room: hall,", "room: den,", "not wholly inside room 'den'"),
        ("position: [1.5, 0.7]", "position: [1.5, oops]", "'sofa_1': position: wrong type.*oops"),
        ("position: [1.5, 0.7]", "position: [1.5]", "expected 2 numbers"),
        ("yaw_degrees: 90", "yaw_degrees: north", "yaw_degrees: wrong type"),
        ("position: [4, 1.5]", "position: [4.2, 1.5]", "not on a wall shared by hall and den"),
        ("position: [4, 1.5]", "position: [4, 0.2]", "not on a wall shared by hall and den"),
        ("rooms: [hall, den]", "rooms: [hall]", "name the two rooms"),
        ("rectangle: [0, 0, 4, 3]", "rectangle: [4, 0, 0, 3]", "is empty"),
        ("name: den_door", "name: hall", "'hall' is used twice"),
        ("name: small", "nme: small", "unknown key 'nme'; did you mean 'name'"),
        ("name: small", "wall_color: [2, 0, 0]", r"must lie in \[0, 1\]"),
        ("- {name: hall, kind", "- {nam: hall, kind", "rooms: entry 1: unknown key 'nam'"),
        ("doors:\n-", "doors: 3\nobjects:\n-", "not valid YAML|expected a list|doors"),
    ],
)
def test_bad_files_are_refused_with_place_value_and_remedy(tmp_path, old, new, message):
    assert old in SMALL
    with pytest.raises(ScenarioError) as error:
        read(tmp_path, SMALL.replace(old, new, 1))
    text = str(error.value)
    assert "small.yaml" in text
    assert re.search(message, text, re.DOTALL), text


def test_an_unknown_world_names_the_nearest():
    with pytest.raises(ScenarioError, match="unknown world 'flatt'; did you mean 'flat'"):
        load_world("flatt")
    with pytest.raises(ScenarioError, match=r"no file 'nowhere\.yaml'"):
        load_world("nowhere.yaml")


def test_every_world_file_loads():
    for path in sorted((models_path() / "worlds").glob("*.yaml")):
        assert load_world(path.stem).name == path.stem
