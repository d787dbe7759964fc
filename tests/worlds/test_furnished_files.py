"""World files with models, materials and panels: what they make, and how mistakes are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from unilavira_drake.errors import ScenarioError
from unilavira_drake.worlds.furniture_library import furniture_models
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import Panel, Placement, World

FILE = """
name: small
rooms:
- {name: den, kind: study, rectangle: [0, 0, 4, 4], floor: oak, walls: cream_paint}
- {name: hall, kind: corridor, rectangle: [4, 0, 7, 4], floor: oak, walls: cream_paint}
doors:
- {name: den_door, rooms: [den, hall], position: [4, 1.5], color: white}
- {name: gap, rooms: [den, hall], position: [4, 3.2], width: 0.8, open: true}
objects:
- {name: desk_1, model: desk_simple, color: blue, room: den, wall: north, position: [2.0]}
- {name: lamp_1, model: desk_lamp, room: den, position: [2.0, 3.5], stands_on: desk_1}
panels:
- {name: window_1, category: window, color: white, room: den, position: [0, 2], size: [1.0, 1.0]}
- {name: rug_1, category: rug, color: red, room: den, position: [2.0, 1.0], size: [1.0, 0.8]}
"""


def read(folder: Path, text: str) -> World:
    file = folder / "small.yaml"
    file.write_text(text, encoding="utf-8")
    return load_world(str(file))


def test_models_stand_at_walls_and_on_each_other(tmp_path: Path) -> None:
    world = read(tmp_path, FILE)
    desk, lamp = world.object("desk_1"), world.object("lamp_1")
    assert desk is not None
    assert lamp is not None
    assert isinstance(desk.visual, Placement)
    assert isinstance(lamp.visual, Placement)
    models = furniture_models()
    back = max(corner[1] for box in desk.boxes for corner in box.corners())
    assert back == pytest.approx(4.0 - 0.05 - 0.02, abs=0.03)
    assert lamp.visual.position[2] == pytest.approx(models["desk_simple"].support_height)
    assert (desk.color, lamp.color) == ("blue", models["desk_lamp"].color)


def test_panels_hang_on_the_nearest_wall_and_stop_nobody(tmp_path: Path) -> None:
    world = read(tmp_path, FILE)
    window = world.object("window_1")
    assert window is not None
    assert isinstance(window.visual, Panel)
    assert window.visual.facing == pytest.approx(0.0)
    assert not window.solid


def test_an_open_passage_is_no_thing(tmp_path: Path) -> None:
    world = read(tmp_path, FILE)
    assert world.object("gap") is None
    assert world.object("den_door") is not None
    beside = [box for box in world.walls if abs(box.center[0] - 4.0) < 1e-6]
    for box in beside:
        assert abs(box.center[1] - 3.2) >= (box.size[1] + 0.8) / 2 - 1e-6


def test_a_mirrored_home_has_its_things_on_the_other_side(tmp_path: Path) -> None:
    read(tmp_path, FILE)
    mirrored = load_world(str(tmp_path / "small.yaml"), mirror=True)
    desk, window = mirrored.object("desk_1"), mirrored.object("window_1")
    assert desk is not None
    assert window is not None
    assert desk.boxes[0].center[1] < -3.0
    assert isinstance(window.visual, Panel)
    assert window.visual.box.center[1] == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("model: desk_simple", "model: desk_simpel", "'desk_1'.*did you mean 'desk_simple'"),
        ("floor: oak", "floor: oka", "'den': floor: unknown material 'oka'.*'oak'"),
        (", walls: cream_paint}", "}", "'den': floor or walls without a material"),
        ("wall: north", "wall: up", "'desk_1'.*unknown wall 'up'"),
        ("position: [2.0]}", "position: [2.0, 3.0]}", "'desk_1': position.*expected 1 numbers"),
        ("stands_on: desk_1", "stands_on: desk_2", "'lamp_1': stands_on.*'desk_1'"),
        ("stands_on: desk_1", "on: desk_1", "write stands_on"),
        ("stands_on: desk_1", "stands_on: desk_1, height: 0.7", "both given"),
        ("stands_on: desk_1", "height: -1.0", "under the floor"),
        ("category: window", "category: windo", "'window_1'.*did you mean 'window'"),
        ("size: [1.0, 1.0]", "size: [1.0, 0.0]", "'window_1': size"),
        ("size: [1.0, 1.0]", "size: [1.0, 1.0], height: 9.0", "does not fit under"),
        ("width: 0.8, open: true", "width: -1.0", "'gap': width: -1.0"),
        ("position: [4, 3.2]", "position: [4, 2.3]", "'den_door' and 'gap' overlap"),
        ("model: desk_simple, color: blue", "category: desk, color: blue", "wall: needs a model"),
    ],
)
def test_mistakes_are_told_with_place_value_and_remedy(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in FILE
    with pytest.raises(ScenarioError, match=message) as error:
        read(tmp_path, FILE.replace(old, new, 1))
    assert "small.yaml" in str(error.value)
