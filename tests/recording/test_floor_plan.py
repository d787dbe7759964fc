from __future__ import annotations

import itertools
import math

import cv2
import numpy as np
import pytest

from unilavira_drake.recording.floor_plan import FloorPlan, floor_plan
from unilavira_drake.recording.plan_labels import Lettering, room_labels, thing_labels
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import Box, Room, World, WorldObject

FLAT = load_world("flat")


def thing(name: str, *boxes: Box) -> WorldObject:
    return WorldObject(f"{name}_1", name, boxes=boxes)


def plan_of(*things: WorldObject) -> FloorPlan:
    return floor_plan(World(rooms=(Room("hall", "hall", (0.0, 0.0, 6.0, 4.0)),), objects=things))


def test_a_doorway_is_an_opening_between_walls() -> None:
    plan = floor_plan(FLAT)
    doors = [thing for thing in FLAT.objects if thing.category == "door"]
    assert len(plan.openings) == len(doors) == 7
    for door in doors:
        middle = np.mean([box.center[:2] for box in door.boxes], axis=0)
        inside = [
            cv2.pointPolygonTest(np.float32(o), middle.tolist(), False) for o in plan.openings
        ]
        assert sum(value > 0 for value in inside) == 1
        walls = [cv2.pointPolygonTest(np.float32(o), middle.tolist(), False) for o in plan.walls]
        assert max(walls) < 0
    assert {thing.category for thing in plan.things} >= {"sofa", "bed"}
    assert "door" not in {thing.category for thing in plan.things}


def test_an_outline_is_that_of_all_boxes_together() -> None:
    corner_sofa = thing("sofa", Box((1.0, 1.0, 0.4), (2.0, 1.0, 0.8)), Box((0.5, 2.0, 0.4)))
    (found,) = plan_of(corner_sofa).things
    (outline,) = found.outlines
    assert cv2.contourArea(np.float32(outline)) == pytest.approx(3.0, abs=0.1)
    assert found.box == (0.0, 0.5, 2.0, 2.5)
    apart = thing("chairs", Box((1.0, 1.0, 0.4)), Box((4.0, 1.0, 0.4), yaw=0.3))
    assert len(plan_of(apart).things[0].outlines) == 2


def test_what_hangs_overhead_is_slight_and_nothing_shapeless_is_drawn() -> None:
    plan = plan_of(thing("ceiling lamp", Box((1.0, 1.0, 2.3), (0.4, 0.4, 0.2))), thing("idea"))
    assert [(t.category, t.slight) for t in plan.things] == [("ceiling lamp", True)]
    assert thing_labels(plan, Lettering(0.01, 0.01)) == ()


def test_words_stand_on_their_things_and_on_no_other_word() -> None:
    plan, lettering = floor_plan(FLAT), Lettering(0.14, 0.08)
    labels = thing_labels(plan, lettering)
    assert {"sofa", "bed", "bathtub"} <= {label.text for label in labels}
    boxes = []
    for label in labels:
        width, height = lettering.size(label.lines)
        w, h = (height, width) if label.upright else (width, height)
        boxes.append((label.x - w / 2, label.y - h / 2, label.x + w / 2, label.y + h / 2))
    for a, b in itertools.combinations(boxes, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_a_word_that_does_not_fit_is_turned_broken_or_left_out() -> None:
    tall = thing("wardrobe", Box((1.0, 1.0, 0.5), (0.3, 2.0, 1.0)))
    wide = thing("washing machine", Box((3.0, 1.0, 0.5), (0.8, 0.6, 1.0)))
    small = thing("refrigerator", Box((5.0, 1.0, 0.5), (0.3, 0.3, 1.0)))
    labels = thing_labels(plan_of(tall, wide, small), Lettering(0.2, 0.1))
    assert {(label.text, label.upright) for label in labels} == {
        ("wardrobe", True),
        ("washing\nmachine", False),
    }


def test_a_room_s_name_is_inside_and_off_the_way() -> None:
    plan, lettering = floor_plan(FLAT), Lettering(0.25, 0.16)
    # A way right through the middle of the kitchen.
    points = np.column_stack([np.linspace(5.2, 9.3, 60), np.full(60, 2.1)])
    for room, (label, box) in zip(plan.rooms, room_labels(plan, lettering, points), strict=True):
        assert label.text.replace("\n", " ") == room.kind
        x_min, y_min, x_max, y_max = room.rectangle
        assert x_min <= box[0] <= box[2] <= x_max
        assert y_min <= box[1] <= box[3] <= y_max
        if room.kind == "kitchen":
            assert not math.isclose(label.y, 2.1, abs_tol=0.2)


def test_a_room_s_name_keeps_off_the_marks() -> None:
    plan, lettering = floor_plan(FLAT), Lettering(0.25, 0.16)
    nowhere = np.zeros((0, 2))
    unmarked = [box for _, box in room_labels(plan, lettering, nowhere)]
    # A mark right on each name, as the ring of a goal in the middle of the room would be.
    middles = [((a + c) / 2, (b + d) / 2) for a, b, c, d in unmarked]
    marks = [(x - 0.3, y - 0.3, x + 0.3, y + 0.3) for x, y in middles]
    for _, box in room_labels(plan, lettering, nowhere, marks):
        for mark in marks:
            assert box[2] <= mark[0] or mark[2] <= box[0] or box[3] <= mark[1] or mark[3] <= box[1]
