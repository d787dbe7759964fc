"""A world of several storeys: what stands where, what is said of a file that cannot be built."""

import math

import numpy as np
import pytest

from unilavira_drake import load_scenario
from unilavira_drake.errors import ScenarioError, TaskError
from unilavira_drake.worlds.clearance import clearance, nearest_obstacle
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.stairs import Stairs
from unilavira_drake.worlds.stairwell import pieces
from unilavira_drake.worlds.start import parse_start_pose

HOUSE = load_world("two_storey")
STAIRS = HOUSE.stairs[0]

FILE = """\
name: small
storeys:
- {name: up, elevation: 2.8}
rooms:
- {name: hall, rectangle: [0, 0, 4, 8]}
- {name: loft, storey: up, rectangle: [0, 0, 4, 8]}
stairs:
- {name: stairs_1, rooms: [hall, loft], rectangle: [2.7, 2, 3.95, 6.2], direction: north}
"""


def test_the_house_has_ten_rooms_on_two_storeys() -> None:
    assert len(HOUSE.rooms) == 10
    assert HOUSE.elevations == (0.0, 2.8)
    assert HOUSE.room_at(2.0, 2.0).name == "living_room"
    assert HOUSE.room_at(2.0, 2.0, 2.8).name == "bedroom"
    # Half a metre under the upper floor is on the last steps, a metre is not.
    assert HOUSE.room_at(7.7, 7.0, 2.5).name == "landing"
    assert HOUSE.room_at(7.7, 5.0, 1.5).name == "hall"
    categories = {entry.instance: entry.category for entry in HOUSE.labels.values()}
    assert categories["stairs_1"] == "stairs"
    assert categories["stairs_1_railing"] == "railing"


@pytest.mark.parametrize("mirror", [False, True])
def test_things_stand_on_their_floors(mirror: bool) -> None:
    world = load_world("two_storey", mirror=mirror)
    for thing in world.objects:
        if "|" in thing.room:
            continue
        room = world.room(thing.room)
        low = min(box.center[2] - box.size[2] / 2 for box in thing.boxes)
        high = max(box.center[2] + box.size[2] / 2 for box in thing.boxes)
        assert room.elevation - 1e-6 <= low < high <= room.elevation + world.wall_height, thing.name
        for x, y in (corner for box in thing.boxes for corner in box.corners()):
            assert room.contains(x, y), thing.name


def test_each_storey_has_its_own_walls() -> None:
    for elevation in HOUSE.elevations:
        boxes = [box for box in HOUSE.walls if HOUSE.stands_on(box, elevation)]
        low = [box.center[2] - box.size[2] / 2 for box in boxes]
        high = [box.center[2] + box.size[2] / 2 for box in boxes]
        # Lintels begin higher.
        assert {round(z - elevation, 6) for z in low} == {0.0, 2.19}
        assert high == pytest.approx([elevation + HOUSE.wall_height] * len(high))


@pytest.mark.parametrize("landing", [0.0, 1.0])
@pytest.mark.parametrize("heading", [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_the_way_up_rises_from_floor_to_floor_at_most_a_riser_off_the_treads(
    landing: float, heading: float
) -> None:
    along = abs(math.cos(heading)) > 0.5
    rectangle = (1.0, 2.0, 6.2, 3.2) if along else (1.0, 2.0, 2.2, 7.2)
    stairs = Stairs("s", ("a", "b"), rectangle, heading, 0.5, 3.3, 15, landing)
    assert (stairs.length, stairs.width) == pytest.approx((5.2, 1.2))
    s = np.linspace(0.0, stairs.length, 200)[:-1]
    heights = [stairs.height(*stairs.point(one)) for one in s]
    assert (heights[0], heights[-1]) == pytest.approx((0.5, 3.3))
    assert (np.diff(heights) >= -1e-9).all()
    riser = 2.8 / 15
    for one, height in zip(s, heights, strict=True):
        tread = next(z for begin, end, z in stairs.treads() if begin - 1e-9 <= one < end)
        assert abs(tread - height) <= riser + 1e-6
    assert stairs.treads()[-1][1:] == pytest.approx((5.2, 3.3))
    x, y = stairs.point(1.3, 0.2)
    assert stairs.along(x, y) == pytest.approx(1.3)


def test_the_ground_is_a_floor_or_the_stairs() -> None:
    x, y = STAIRS.point(2.0)
    assert HOUSE.ground_height(x, y, 1.4) == pytest.approx(STAIRS.height(x, y))
    assert HOUSE.ground_height(2.0, 2.0, 0.1) == 0.0
    assert HOUSE.ground_height(2.0, 2.0, 2.7) == 2.8


def test_the_opening_and_the_steps_stop_a_robot_and_the_landing_does_not() -> None:
    middle = np.array([STAIRS.point(2.0)])
    assert clearance(HOUSE, middle)[0] == clearance(HOUSE, middle, 2.8)[0] == 0.0
    x, y = STAIRS.point(STAIRS.length + 0.5)
    name, distance = nearest_obstacle(HOUSE, x, y, 2.8)
    assert distance >= 0.5, name


def test_starts_on_an_upper_storey() -> None:
    assert parse_start_pose("7.0,8.4,2.8,1.57", HOUSE, radius=0.4) == (7.0, 8.4, 2.8, 1.57)
    assert parse_start_pose("7.0,1.4,1.57", HOUSE, radius=0.4) == (7.0, 1.4, 0.0, 1.57)
    x, y, z, _ = parse_start_pose("bathroom", HOUSE, radius=0.4)
    assert HOUSE.room_at(x, y, z).name == "bathroom"
    for text, words in (
        ("7.0,8.4,1.4,0", "no floor lies at height 1.4"),
        ("7.7,5.0,2.8,0", "inside stairs_1"),
        ("2.0,2.0,0,0,0", "X,Y,YAW"),
    ):
        with pytest.raises(TaskError, match=words):
            parse_start_pose(text, HOUSE, radius=0.4)


def test_who_cannot_climb_cannot_start_upstairs() -> None:
    for text in ("bathroom", "7.0,8.4,2.8,1.57"):
        with pytest.raises(TaskError, match="cannot climb"):
            parse_start_pose(text, HOUSE, radius=0.4, climbs=False)
    assert parse_start_pose("kitchen", HOUSE, radius=0.4, climbs=False)[2] == 0.0
    with pytest.raises(TaskError, match=r"set robot\.can_climb"):
        load_scenario("two_storey", "robot: !UnitreeGo1 {can_climb: false}\ntask: {text: '@sofa'}")


def test_a_storey_alone_is_a_world_of_one() -> None:
    upper = HOUSE.storey(2.8)
    assert upper.elevations == (0.0,)
    assert {room.name for room in upper.rooms} == {
        room.name for room in HOUSE.rooms if room.elevation
    }
    assert upper.object("bathtub_1").boxes[0].center[2] < 1.0
    assert upper.object("piano_1") is None
    flat = load_world("flat")
    assert flat.storey(0.0) is flat


def test_pieces_cover_a_floor_but_for_its_holes() -> None:
    holes = [(1.0, 1.0, 2.0, 3.0), (1.5, 0.0, 5.0, 1.5)]
    parts = pieces((0.0, 0.0, 4.0, 4.0), holes)
    points = np.random.default_rng(0).uniform(0.0, 4.0, (500, 2))
    for x, y in points:
        inside = [a <= x < c and b <= y < d for a, b, c, d in parts]
        in_hole = any(a <= x < c and b <= y < d for a, b, c, d in holes)
        assert sum(inside) == (0 if in_hole else 1)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("elevation: 2.8", "elevation: 1.8"), "elevation: 1.8 leaves less"),
        (("storey: up", "storey: upp"), "did you mean 'up'"),
        (("direction: north", "direction: upwards"), "direction"),
        (("rooms: [hall, loft]", "rooms: [loft, hall]"), "storey above"),
        (("rooms: [hall, loft]", "rooms: [hall]"), "room below and above"),
        (("3.95, 6.2]", "3.95, 9.2]"), "not inside room"),
        (("direction: north", "direction: north, steps: 5"), "riser"),
        (("direction: north", "direction: north, landing: 2.0"), "tread"),
    ],
)
def test_a_file_that_cannot_be_built_says_why(change, words, tmp_path) -> None:
    file = tmp_path / "small.yaml"
    file.write_text(FILE, encoding="utf-8")
    assert load_world(str(file)).stairs[0].width == pytest.approx(1.25)
    assert change[0] in FILE
    file.write_text(FILE.replace(*change), encoding="utf-8")
    with pytest.raises(ScenarioError, match=words):
        load_world(str(file))
