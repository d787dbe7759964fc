"""The ground: parts that tile, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.errors import ScenarioError
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.outdoors.ground import ground_quads
from unilavira_drake.worlds.outdoors.ground_picture import DETAIL, GroundPicture
from unilavira_drake.worlds.outdoors.things import GroundPatch
from unilavira_drake.worlds.world import Box

FILE = """
name: small
outdoors: true
rooms:
- {name: field, kind: field, rectangle: [0, 0, 40, 40], floor: grass}
ground:
- {name: way, category: road, material: asphalt, rectangle: [0, 10, 40, 16], marking: lane}
- {name: pool, category: pond, material: water, rectangle: [20, 20, 30, 30], round: true}
buildings:
- {name: hut, position: [10, 26], size: [4, 6], height: 3, facade: red_brick, roof: gable}
rows:
- {name: trees, category: tree, start: [4, 36], end: [36, 36], count: 4}
objects:
- {name: car_1, category: car, color: red, room: field, position: [12, 12]}
"""


def read(folder, text):
    path = folder / "small.yaml"
    path.write_text(text, encoding="utf-8")
    return load_world(str(path))


def area(quads):
    """Signed areas from above."""
    x, y = quads[:, :, 0], quads[:, :, 1]
    ahead = np.roll(np.arange(4), -1)
    return 0.5 * (x * y[:, ahead] - x[:, ahead] * y).sum(axis=1)


spans = st.tuples(st.integers(0, 9), st.integers(1, 6)).map(lambda s: (s[0], min(10, s[0] + s[1])))


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(st.tuples(spans, spans), max_size=6))
def test_patches_tile_and_the_latest_is_on_top(places):
    patches = [GroundPatch("base", "floor", "grass", (0.0, 0.0, 10.0, 10.0))]
    for i, ((x0, x1), (y0, y1)) in enumerate(places):
        patches.append(GroundPatch(f"patch_{i}", "road", "asphalt", (x0, y0, x1, y1)))
    parts = ground_quads(patches)
    assert all((area(quads) > 0.0).all() for quads in parts)
    assert sum(area(quads).sum() for quads in parts) == pytest.approx(100.0)
    owner = np.zeros((10, 10), int)
    for i, ((x0, x1), (y0, y1)) in enumerate(places, start=1):
        owner[y0:y1, x0:x1] = i
    for i, quads in enumerate(parts):
        assert area(quads).sum() == pytest.approx((owner == i).sum())


def test_an_ellipse_and_its_corners_fill_its_rectangle():
    base = GroundPatch("base", "floor", "grass", (0.0, 0.0, 10.0, 10.0))
    pond = GroundPatch("pond", "pond", "water", (2.0, 3.0, 8.0, 7.0), round=True)
    grass, water = ground_quads([base, pond])
    assert area(water).sum() == pytest.approx(np.pi * 3 * 2, rel=0.01)
    assert area(grass).sum() + area(water).sum() == pytest.approx(100.0)
    assert (area(water) > 0.0).all()
    assert (area(grass) >= -1e-12).all()


def test_what_stands_on_the_ground_throws_a_shadow():
    base = [GroundPatch("base", "floor", "paving", (0.0, 0.0, 20.0, 20.0))]
    bare = GroundPicture(base, []).part((0.0, 0.0, 20.0, 20.0))
    box = Box((12.0, 12.0, 4.0), (2.0, 2.0, 8.0))
    shaded = GroundPicture(base, [box]).part((0.0, 0.0, 20.0, 20.0))
    assert bare.shape == (round(20 * DETAIL), round(20 * DETAIL), 3)
    x, y = 10.5, 10.5
    row, column = round((20 - y) * DETAIL), round(x * DETAIL)
    assert shaded[row, column].mean() < 0.8 * bare[row, column].mean()
    assert np.array_equal(shaded[:20, -20:], bare[:20, -20:])


def test_a_small_world_outdoors(tmp_path):
    world = read(tmp_path, FILE)
    assert world.outdoors
    assert world.object("hut").color == "red"
    assert world.object("trees").room == "field"
    assert len(world.object("trees").visual.places) == 4
    kinds = {entry.instance: entry for entry in world.labels.values()}
    assert kinds["field_floor"].category == "floor"
    assert kinds["pool"].category == "pond"
    assert not world.walls
    assert sorted(world.labels) == list(range(1, len(world.labels) + 1))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("outdoors: true", "outdoors: false", "ground: needs a world under the open sky"),
        ("floor: grass", "floor: oak", "unknown material 'oak'"),
        ("floor: grass", "floor: grass, walls: brick", "a district has a floor"),
        ("material: asphalt", "material: asfalt", "did you mean 'asphalt'"),
        ("marking: lane", "marking: lines", "unknown marking 'lines'"),
        ("category: pond", "category: ''", "say what a person calls it"),
        ("[0, 10, 40, 16]", "[0, 10, 45, 16]", "not inside the districts"),
        ("[0, 10, 40, 16]", "[0, 16, 40, 10]", "is empty"),
        ("[20, 20, 30, 30]", "[20, 12, 30, 22]", "'pool' is round"),
        ("facade: red_brick", "facade: brick", "did you mean 'red_brick'"),
        ("roof: gable", "roof: gabled", "did you mean 'gable'"),
        ("size: [4, 6]", "size: [4]", "expected 2 numbers"),
        ("size: [4, 6]", "size: [1, 6]", "give 2 to 120 m"),
        ("position: [10, 26]", "position: [1, 26]", "'hut': not wholly inside"),
        ("position: [10, 26]", "position: [100, 26]", "is in no district"),
        ("category: tree", "category: palm", "unknown category 'palm'"),
        ("count: 4", "count: 1", "count: 1"),
        ("category: car, color: red", "category: tree, color: red", "leave it out"),
        ("name: car_1", "name: hut", "'hut' is used twice"),
        ("objects:", "doors:\n- {name: d}\nobjects:", "a world outdoors has none"),
    ],
)
def test_bad_files_are_refused_with_place_value_and_remedy(tmp_path, old, new, message):
    assert old in FILE
    with pytest.raises(ScenarioError, match=message) as error:
        read(tmp_path, FILE.replace(old, new, 1))
    assert "small.yaml" in str(error.value)
